// What the fields of a NIfTI header are for a volume, and as they come back from a file.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/nifti_header.h"

namespace vkt {

/// All but vox_offset, of one volume or of a series, whose volumes are as many channels at all times each. Throws
/// Error{usage} for what the format cannot hold.
NiftiFields nifti_fields(Header const& header, std::int64_t volumes, std::int64_t channels);

/// With the precision of the version.
NiftiFields as_stored(NiftiFields const& fields, int version);

} // namespace vkt
