// Comparing the grids of inputs.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/common/same_grid.h"

#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/text.h"

namespace vkt {

void require_same_grid(std::span<Header const> inputs) {
    Header const& first = inputs.front();
    for (Header const& other : inputs.subspan(1)) {
        if (first.kind != other.kind)
            throw Error(ErrorKind::usage, "one of the volumes is hierarchical",
                        "make it a grid first: vkt resample --cells 50M");
        char const* const hint = "vkt resample SECOND --like FIRST puts the second onto the grid of the first";
        if (!(first.dims == other.dims))
            throw Error(ErrorKind::usage,
                        text("the volumes differ in size: ", first.dims, " and ", other.dims, " voxels"), hint);
        if (!same_geometry(first.geometry, geometry_beside(first, other)))
            throw Error(ErrorKind::usage,
                        "the volumes lie at different places in the world (origin, spacing or direction)", hint);
    }
}

void require_same_grid(Header const& volume, Header const& beside, std::string_view option) {
    if (volume.kind != beside.kind)
        throw Error(ErrorKind::usage, text(option, ": one of the volumes is hierarchical"),
                    "make it a grid first: vkt resample --cells 50M");
    char const* const hint = "put it onto the volume's grid first: vkt resample --like VOLUME --method nearest";
    if (!(volume.dims == beside.dims))
        throw Error(ErrorKind::usage,
                    text(option, " has ", beside.dims, " voxels, the volume ", volume.dims, ": they differ in size"),
                    hint);
    if (!same_geometry(volume.geometry, geometry_beside(volume, beside)))
        throw Error(ErrorKind::usage,
                    text(option, " lies at another place in the world than the volume (origin, spacing or direction)"),
                    hint);
}

} // namespace vkt
