// --connectivity, as operations on components have it: which of a voxel's 26 neighbours touch it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/error.h"
#include "libvkt/core/parameters.h"
#include "libvkt/core/text.h"

#include <string>

namespace vkt {

/// Declares the option; `which` are the voxels that touch each other.
inline void connectivity_option(Parameters& p, int& connectivity, std::string const& which = "voxels") {
    p.option("connectivity", connectivity, "N",
             which + " touch through faces (6), edges as well (18), corners as well (26)");
}

/// Throws Error{usage} for numbers other than 6, 18 and 26.
inline void check_connectivity(int connectivity) {
    if (connectivity != 6 && connectivity != 18 && connectivity != 26)
        throw Error(ErrorKind::usage, text("--connectivity: ", connectivity, " is none of 6, 18, 26"));
}

} // namespace vkt
