// Opening a dataset, its axes, and reading its voxels.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/hdf5/chosen.h"

#include "libvkt/core/text.h"
#include "libvkt/formats/coordinates.h"
#include "libvkt/formats/hdf5/filters.h"
#include "libvkt/formats/hdf5/types.h"

#include <algorithm>
#include <filesystem>

namespace vkt::hdf5 {
namespace {

constexpr std::size_t chunk_cache = std::size_t{64} << 20;

} // namespace

ChosenDataset::ChosenDataset(Datasets const& all, Dataset const& one) : all_(all), path_(one.path) {
    Handle const access(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose);
    H5Pset_chunk_cache(access, 12421, chunk_cache, 1);
    if (!all_.home().empty()) { // relative names of other files begin there, not where the command runs
        std::string const folder = std::filesystem::path(all_.home()).parent_path().string();
        H5Pset_virtual_prefix(access, folder.c_str());
        H5Pset_efile_prefix(access, folder.c_str());
    }
    data_.emplace(H5Dopen2(all_.file(), one.path.c_str(), access), H5Dclose);
    if (!*data_) fail(text("damaged: dataset '", one.path, "' cannot be opened"));
    type_.emplace(H5Dget_type(*data_), H5Tclose);
    space_.emplace(H5Dget_space(*data_), H5Sclose);
    shape_ = one.shape;
    element_ = size_of(one.type);
    parts_ = one.complex ? 2 : 1;
}

void ChosenDataset::find_axes(ParsedGrids& grids) {
    if (Handle const creation(H5Dget_create_plist(*data_), H5Pclose); grids.choices.empty())
        if (std::string const absent = absent_filter(creation); !absent.empty())
            fail(text("dataset '", path_, "' is compressed by ", absent, ", which is not read"),
                 "where that filter is: h5repack -f GZIP=4 in.h5 out.h5");
    // The last dimensions with more than one sample, the last one x; a first one of times enumerates volumes, and so do
    // those before the third from the end.
    int next = 0;
    auto const rank = static_cast<int>(shape_.size());
    for (hsize_t const n : shape_)
        if (n == 0 || n > static_cast<hsize_t>(max_extent)) fail(text("dataset '", path_, "' is empty, or too large"));
    auto const first = std::find_if(shape_.begin(), shape_.end(), [](hsize_t n) { return n > 1; });
    int const times = first != shape_.end() && of_time(static_cast<int>(first - shape_.begin()))
                          ? static_cast<int>(first - shape_.begin())
                          : -1;
    std::vector<std::string> const names = labels();
    for (int k = rank - 1; k >= 0; --k) {
        bool const named = !names.empty() && enumerates(names[static_cast<std::size_t>(k)]);
        if (!named && shape_[static_cast<std::size_t>(k)] == 1 && (rank > 4 || next >= 3)) continue;
        bool const first_of_times = k == times && next >= 1;
        if (named || first_of_times || next >= 3)
            leading_.insert(leading_.begin(), k);
        else
            axis_[static_cast<std::size_t>(next)] = k;
        if (first_of_times) break;
        if (!named) ++next;
    }
    leading_places_.resize(leading_.size());
    for (int a = 0; a < 3; ++a)
        if (int const k = axis_[static_cast<std::size_t>(a)]; k >= 0)
            grids.header.dims[a] = static_cast<std::int64_t>(shape_[static_cast<std::size_t>(k)]);
    grids.volumes = parts_;
    for (int const k : leading_)
        if (__builtin_mul_overflow(grids.volumes, static_cast<std::int64_t>(shape_[static_cast<std::size_t>(k)]),
                                   &grids.volumes))
            fail(text("dataset '", path_, "' is of more volumes than any file can have"));
}

/// Marks a box of one volume in the space of the dataset, and returns that of its voxels in memory.
Handle ChosenDataset::select(std::int64_t volume, Box const& box) const {
    std::vector<hsize_t> start(shape_.size(), 0), count(shape_.size(), 1);
    for (int a = 0; a < 3; ++a)
        if (int const k = axis_[static_cast<std::size_t>(a)]; k >= 0) {
            start[static_cast<std::size_t>(k)] = static_cast<hsize_t>(box.lower[a]);
            count[static_cast<std::size_t>(k)] = static_cast<hsize_t>(box.dims()[a]);
        }
    auto rest = static_cast<hsize_t>(volume / parts_);
    for (std::size_t i = leading_.size(); i-- > 0;) {
        auto const k = static_cast<std::size_t>(leading_[i]);
        start[k] = rest % shape_[k];
        rest /= shape_[k];
    }
    H5Sselect_hyperslab(*space_, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr);
    // Of the same shape: HDF5 looks up the chunk of every element otherwise, thirty times as long.
    return {H5Screate_simple(static_cast<int>(count.size()), count.data(), nullptr), H5Sclose};
}

/// Of one volume, in memory.
Handle ChosenDataset::voxel_type(std::int64_t volume) const {
    return parts_ > 1 ? part_type(*type_, static_cast<int>(volume % parts_)) : memory_type(*type_);
}

void ChosenDataset::read(std::int64_t volume, Box const& box, std::byte* to) {
    Handle const memory = select(volume, box), type = voxel_type(volume);
    if (H5Dread(*data_, type, memory, *space_, H5P_DEFAULT, to) < 0)
        fail("damaged: voxels cannot be read, or are compressed in a way that this HDF5 does not know");
}

bool ChosenDataset::write(std::int64_t volume, Box const& box, std::byte const* from) {
    Handle const memory = select(volume, box), type = voxel_type(volume);
    return H5Dwrite(*data_, type, memory, *space_, H5P_DEFAULT, from) >= 0;
}

Index3 ChosenDataset::chunk() const {
    Handle const creation(H5Dget_create_plist(*data_), H5Pclose);
    std::vector<hsize_t> extents = shape_;
    if (H5Pget_layout(creation) == H5D_CHUNKED)
        H5Pget_chunk(creation, static_cast<int>(extents.size()), extents.data());
    Index3 result{1, 1, 1};
    for (int a = 0; a < 3; ++a)
        if (int const k = axis_[static_cast<std::size_t>(a)]; k >= 0)
            result[a] = static_cast<std::int64_t>(extents[static_cast<std::size_t>(k)]);
    return result;
}

} // namespace vkt::hdf5
