// Sample grids: which regular grid a request over a hierarchical volume means.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/edit.h"
#include "libvkt/amr/reconstruct.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <cmath>

namespace vkt {

namespace {

__extension__ typedef __int128 WideCount; ///< logical grids of 2^40 cells along each axis hold 2^120

WideCount cells_in(Box const& box) {
    Index3 const n = box.dims();
    return box.empty() ? 0 : WideCount{n.x} * n.y * n.z;
}

std::int64_t rounded_count(double exact) {
    if (!(exact < static_cast<double>(max_extent)))
        throw Error(ErrorKind::usage, text("a grid of ", exact, " voxels along one axis is too large"));
    return std::max<std::int64_t>(1, std::llround(exact));
}

Box wanted_region(Header const& header, GridRequest const& request) {
    if (!request.roi.empty() && !request.world_roi.empty())
        throw Error(ErrorKind::usage, "--roi and --roi-world exclude each other");
    Box const present = region_of(header);
    if (request.roi.empty() && request.world_roi.empty()) return present;
    Box const wanted =
        request.roi.empty() ? resolve_in_tree(request.world_roi, header) : resolve_in_tree(request.roi, header);
    if (!present.contains(wanted))
        throw Error(ErrorKind::usage, text("region ", wanted, " leaves the part that is left of the volume, ", present),
                    "regions of a hierarchical volume count finest cells of the whole logical grid");
    return wanted;
}

Index3 count_for_cells(Header const& header, Index3 extent, std::int64_t cells) {
    if (cells < 1) throw Error(ErrorKind::usage, text("a grid of ", cells, " cells is empty"));
    double volume = 1;
    int axes = 0;
    for (int a = 0; a < 3; ++a) {
        if (extent[a] == 1) continue;
        volume *= static_cast<double>(extent[a]) * header.geometry.spacing[a];
        ++axes;
    }
    if (axes == 0) return {1, 1, 1};
    double const edge = std::pow(volume / static_cast<double>(cells), 1.0 / axes);
    Index3 dims;
    for (int a = 0; a < 3; ++a)
        dims[a] =
            extent[a] == 1 ? 1 : rounded_count(static_cast<double>(extent[a]) * header.geometry.spacing[a] / edge);
    return dims;
}

} // namespace

Box region_of(Header const& header) {
    auto const attribute = header.attributes.find("roi");
    if (attribute == header.attributes.end()) return box_of(header.dims);
    try {
        return Roi{attribute->second}.resolve(header.dims);
    } catch (Error const& error) {
        throw Error(ErrorKind::data, text("attribute 'roi' of the hierarchical volume: ", error.what()));
    }
}

Box resolve_in_tree(Roi const& roi, Header const& header) {
    Box box = resolve_cells(roi, header.dims);
    Box const present = region_of(header);
    auto const ranges = split(roi.text, ',');
    for (std::size_t a = 0; a < ranges.size() && a < 3; ++a) {
        auto const axis = static_cast<int>(a);
        if (ranges[a].empty() || ranges[a].front() == ':') box.lower[axis] = present.lower[axis];
        if (ranges[a].empty() || ranges[a].back() == ':') box.upper[axis] = present.upper[axis];
    }
    if (box.empty())
        throw Error(ErrorKind::usage, text("--roi '", roi.text, "' does not meet what the volume holds, ", present));
    return box;
}

Box resolve_in_tree(WorldRoi const& roi, Header const& header) {
    Box const present = region_of(header);
    Box const box = intersect(roi.resolve(header.geometry, header.dims), present);
    if (box.empty())
        throw Error(ErrorKind::usage,
                    text("--roi-world '", roi.text, "' does not meet what the volume holds, ", present));
    return box;
}

void require_in_region(Box const& region, Header const& header) {
    Box const present = region_of(header);
    if (region.empty() || !present.contains(region))
        throw Error(ErrorKind::usage, text("region ", region, " leaves the hierarchical volume's ", present));
}

SampleGrid plan_grid(Header const& header, GridRequest const& request) {
    if (static_cast<int>(request.dims.has_value()) + static_cast<int>(request.spacing.has_value()) +
            static_cast<int>(request.cells.has_value()) >
        1)
        throw Error(ErrorKind::usage, "--dims, --spacing and --cells exclude each other");
    Box const region = wanted_region(header, request);
    Index3 const extent = region.dims();
    Index3 dims = extent;
    if (request.dims) {
        dims = *request.dims;
    } else if (request.spacing) {
        for (int a = 0; a < 3; ++a) {
            if (!((*request.spacing)[a] > 0))
                throw Error(ErrorKind::usage, text("spacing ", *request.spacing, " is not positive"));
            dims[a] =
                rounded_count(static_cast<double>(extent[a]) * header.geometry.spacing[a] / (*request.spacing)[a]);
        }
    } else if (request.cells) {
        dims = count_for_cells(header, extent, *request.cells);
    }
    SampleGrid grid;
    grid.dims = dims;
    for (int a = 0; a < 3; ++a) {
        if (dims[a] < 1 || dims[a] > max_extent)
            throw Error(ErrorKind::usage, text("dims ", dims, " are not positive"));
        grid.lower[a] = static_cast<double>(region.lower[a]);
        grid.step[a] = static_cast<double>(extent[a]) / static_cast<double>(dims[a]);
    }
    return grid;
}

bool leaves_holes(Header const& header, BrickTable const& bricks, SampleGrid const& grid) {
    double const rounding = 1e-6; // of a voxel: a face that was to lie on one between cells
    Box looked_at;
    for (int a = 0; a < 3; ++a) {
        double const low = grid.lower[a], high = low + static_cast<double>(grid.dims[a]) * grid.step[a];
        auto const n = static_cast<double>(header.dims[a]), slack = rounding * grid.step[a];
        looked_at.lower[a] = static_cast<std::int64_t>(std::clamp(std::floor(low + slack), 0.0, n));
        looked_at.upper[a] = static_cast<std::int64_t>(std::clamp(std::ceil(high - slack), 0.0, n));
    }
    WideCount left = cells_in(looked_at);
    for (Brick const& brick : bricks) left -= cells_in(intersect(bounds_of(brick, header.dims), looked_at));
    return left > 0; // bricks do not overlap
}

Header gridded_header(Header const& header, SampleGrid const& grid) {
    Header result = header;
    result.kind = Kind::structured;
    result.dims = grid.dims;
    result.brick_count = result.cell_count = 0;
    result.level_count = 0;
    result.part.reset();
    result.attributes.erase("roi");
    Vec3 first;
    for (int a = 0; a < 3; ++a) {
        first[a] = grid.lower[a] + 0.5 * grid.step[a] - 0.5;
        result.geometry.spacing[a] = header.geometry.spacing[a] * grid.step[a];
    }
    result.geometry.origin = index_to_world(header.geometry, first);
    return result;
}

} // namespace vkt
