// Scales of dimensions, by which NetCDF-4 and xarray know what a dataset's dimensions are called and where its samples
// lie (HDF5 Dimension Scale Specification).
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/hdf5/handle.h"

#include <hdf5.h>

#include <string>
#include <vector>

namespace vkt::hdf5 {

/// What a dataset names as its scales, what scales know of their users, and what marks those that vkt made.
inline constexpr char const *scales_of = "DIMENSION_LIST", *users_of = "REFERENCE_LIST", *our_scale = "vkt_scale";

struct User {
    hobj_ref_t dataset = 0;
    int dimension = 0;
};
/// In memory.
Handle user_type();

/// Of one dimension, that has `size` samples.
struct Scale {
    std::string name; ///< "t"
    hsize_t size = 1;
    bool grows = false;
    /// Where they lie, or what they are called; neither where nobody says.
    std::vector<double> places;
    std::vector<std::string> names;
    std::string units;
};

/// Makes a scale for each dimension of a dataset, in its group: called as the dimension is, or DATASET_NAME where that
/// is taken, and none where this is taken too. False if the library cannot.
bool attach_scales(hid_t file, std::string const& dataset, std::vector<Scale> const& scales);

/// Of a scale that vkt made, the name is free for others: it is called DATASET_NAME from now on. False for anything
/// else, and if that is taken.
bool give_way(hid_t file, std::string const& path);

} // namespace vkt::hdf5
