// Names of the files beside images.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/sidecar.h"

#include "libvkt/core/text.h"

namespace vkt {

std::string sidecar_of(std::string const& image) {
    std::string stem = image;
    for (char const* const end : {".gz", ".bz2", ".xz", ".zst"})
        if (lower_case(stem).ends_with(end)) stem.resize(stem.rfind('.'));
    for (char const* const end : {".nii", ".hdr", ".img"})
        if (lower_case(stem).ends_with(end)) return stem.substr(0, stem.rfind('.')) + ".json";
    return {};
}

} // namespace vkt
