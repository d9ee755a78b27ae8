// What an HDF5 file holds: its datasets of numbers, under their paths.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"
#include "libvkt/formats/hdf5/handle.h"

#include <hdf5.h>

#include <string>
#include <vector>

namespace vkt::hdf5 {

struct Dataset {
    std::string path;
    DataType type = DataType::float32; ///< of each part
    bool complex = false;              ///< two parts in each voxel
    std::vector<hsize_t> shape;
    bool scale = false; ///< it only says where others lie, or what others are
    std::string bounds; ///< of cells whose places it says: a dataset beside it
};

/// An open file.
class Datasets {
public:
    /// Throws Error{data} for what the library cannot open.
    explicit Datasets(std::string path);
    /// Of one that is open already, which messages call `path`.
    Datasets(std::string path, Handle file);

    std::string const& path() const { return path_; }
    hid_t file() const { return file_; }
    /// Where the file lies, which is handed over open; empty if it has no name.
    std::string const& home() const { return home_; }
    std::vector<Dataset> const& all() const { return datasets_; }
    [[noreturn]] void fail(std::string const& what, std::string const& hint = {}) const;

    /// Lists them; what holds no numbers is not read.
    void find(std::vector<std::string>& not_read);
    /// Adds a dataset by another of its names, as by a link, if there is one. Links to other files are not followed,
    /// since what a file leads to may be none of its writer's.
    void find_linked(std::string const& path);
    /// Voxels in other files are read if those lie beside this one, as with detached headers, and so do the next ones
    /// to which they lead.
    void check_elsewhere(hid_t data, std::vector<std::string>& not_read) const;
    /// A small dataset of numbers; empty if it is none.
    std::vector<double> values(std::string const& path) const;

private:
    std::string look_at(hid_t set, std::string const& path);
    void check_elsewhere(hid_t data, std::string const& file, int depth, std::vector<std::string>& not_read) const;
    void mark_places();

    std::string path_;
    Handle file_;
    std::string home_;
    std::vector<Dataset> datasets_;
};

} // namespace vkt::hdf5
