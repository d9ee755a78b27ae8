// Where BIDS has what an image's header has no place for.
// SPDX-License-Identifier: MIT
#pragma once

#include <string>

namespace vkt {

/// scan.json beside scan.nii.gz, scan.nii or scan.hdr. Empty for files of other names.
std::string sidecar_of(std::string const& image);

} // namespace vkt
