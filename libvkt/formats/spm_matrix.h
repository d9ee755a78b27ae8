// What SPM keeps beside an Analyze pair: NAME.mat, a MATLAB file with the map from voxels, counted from 1, to the
// world.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/geometry.h"

#include <optional>
#include <string>

namespace vkt {

/// The place that such a file gives the voxels, counted from 0.
struct SpmMatrix {
    Geometry geometry;
    bool sided = false;         ///< it says which end of x is left (the matrix mat, not M)
    bool others_differ = false; ///< there is one for each volume, and not all are the first one
};

/// NAME.mat of NAME.hdr, NAME.hdr.gz or NAME.img.
std::string spm_matrix_beside(std::string const& header);
/// Of MATLAB's versions 4 and 5, compressed or not, with a matrix `mat` or `M`; none of anything else.
std::optional<SpmMatrix> read_spm_matrix(std::string const& path);
/// Both matrices, as nibabel and SPM read them, in version 4.
std::string spm_matrix_bytes(Geometry const& geometry);

} // namespace vkt
