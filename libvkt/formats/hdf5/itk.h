// What images of ITK in HDF5 files are called.
// SPDX-License-Identifier: MIT
#pragma once

#include <string_view>

namespace vkt::hdf5 {

inline constexpr std::string_view itk_voxels = "/VoxelData"; ///< the dataset of an image, in its group

} // namespace vkt::hdf5
