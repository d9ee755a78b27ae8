// The dataset that is read: its dimensions as axes of volumes, what is said of these, and its voxels.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/hdf5/datasets.h"
#include "libvkt/formats/parsed_grids.h"

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace vkt::hdf5 {

class ChosenDataset {
public:
    /// One of `all`, which stays.
    ChosenDataset(Datasets const& all, Dataset const& one);

    hid_t data() const { return *data_; }
    /// Which dimensions are x, y and z, and which enumerate volumes.
    void find_axes(ParsedGrids& grids);
    /// Geometry, values, units, attributes, and the places of volumes.
    void read_about(ParsedGrids& grids);
    /// Where voxels lie in the file, if they can be read without the library.
    void find_places(ParsedGrids& grids) const;
    void read(std::int64_t volume, Box const& box, std::byte* to);
    /// The reverse, in a file that is open to be changed. False if the library cannot.
    bool write(std::int64_t volume, Box const& box, std::byte const* from);
    /// Voxels of a chunk along x, y and z; those of the dataset if it has none.
    Index3 chunk() const;

private:
    Handle select(std::int64_t volume, Box const& box) const;
    Handle voxel_type(std::int64_t volume) const;
    [[noreturn]] void fail(std::string const& what, std::string const& hint = {}) const { all_.fail(what, hint); }
    bool read_itk(ParsedGrids& grids);
    std::vector<std::string> labels() const;
    Handle scale_of(int dimension) const;
    bool of_time(int dimension) const;
    void read_scales(ParsedGrids& grids);
    void read_series(Header& header);
    void say_places(ParsedGrids& grids) const;
    void say_parts(ParsedGrids& grids) const;
    void use_ours(Header& header, std::string const& json) const;
    void find_chunks(std::vector<hsize_t> const& chunk, ParsedGrids& grids) const;

    Datasets const& all_;
    std::string path_; ///< of the dataset
    std::optional<Handle> data_, type_, space_;
    std::vector<hsize_t> shape_;
    std::array<int, 3> axis_{-1, -1, -1}; ///< of the dataset: of x, y, z
    std::vector<int> leading_;            ///< those that enumerate volumes, slowest first
    /// Of each of these, what is said of its entries; may be empty.
    std::vector<std::vector<std::map<std::string, std::string>>> leading_places_;
    std::size_t element_ = 1; ///< bytes of a voxel
    std::int64_t parts_ = 1;  ///< of each element, which are volumes of their own
};

} // namespace vkt::hdf5
