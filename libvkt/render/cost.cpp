// What drawing takes: memory, rays, steps.
// SPDX-License-Identifier: MIT
#include "libvkt/render/cost.h"

#include "libvkt/amr/reconstruct.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/render/categories.h"
#include "libvkt/render/presets.h"
#include "libvkt/render/settings.h"
#include "libvkt/render/sparse.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vkt::render {

namespace {

/// Of a voxel, as Lattice keeps it.
std::size_t lattice_size(DataType type) {
    switch (type) {
    case DataType::uint8:
        return 1;
    case DataType::int8:
    case DataType::uint16:
    case DataType::int16:
        return 2;
    default:
        return 4;
    }
}

/// Whether a file is read to where rays sample it, so that the volume is in memory once.
bool read_to_its_place(Header const& header) {
    return header.dtype == DataType::uint8 || header.dtype == DataType::uint16 || header.dtype == DataType::int16;
}

/// What a Lattice takes: more than there is memory for is no reason to overflow.
std::size_t lattice_bytes(Header const& header) {
    double padded = 1, cells = 1;
    for (int axis = 0; axis < 3; ++axis) {
        padded *= static_cast<double>(header.dims[axis] + 2 * lattice_padding);
        cells *= std::ceil(static_cast<double>(header.dims[axis] + 1) / macrocell_size);
    }
    constexpr double per_cell = 3 * sizeof(float) + 3; // range, majorant, missing, distance, depth
    double const bytes = padded * static_cast<double>(lattice_size(header.dtype)) + cells * per_cell;
    return static_cast<std::size_t>(std::min(bytes, 0x1p61));
}

/// What a Tree takes, with the cells where rays can sample them as they are.
std::size_t tree_bytes(Header const& header) {
    // They stay where they are until bricks are joined; macrocells take a byte a cell.
    std::size_t const size = header.dtype == DataType::int8 ? sizeof(float) : lattice_size(header.dtype);
    bool const in_place = header.dtype == DataType::float32 || size < sizeof(float);
    auto const cells = static_cast<std::size_t>(header.cell_count);
    return (in_place ? header.bytes() : cells * sizeof(float)) + cells * (size + 1) +
           static_cast<std::size_t>(header.brick_count) * 140;
}

} // namespace

void check_memory(Header const& header, Execution const& execution, TreeDrawing tree, bool copied,
                  std::size_t picture) {
    if ((tree == TreeDrawing::bricks || tree == TreeDrawing::blocks) && header.kind == Kind::structured)
        throw Error(ErrorKind::usage, text("--tree ", enum_name(tree), ": the volume is a grid and has none"),
                    "vkt refine makes bricks of it");
    for (int axis = 0; axis < 3; ++axis) // lengths, their inverses and gradients are floats
        if (double const size = header.geometry.spacing[axis]; size < 1e-31 || size > 1e31)
            throw Error(ErrorKind::data, text("voxels are ", size, " wide, and pictures take 1e-31 to 1e31"),
                        "count in another unit: vkt set --spacing");
    std::size_t const volume = bytes_to_draw(header, tree, copied), bytes = volume + picture;
    if (bytes <= execution.memory) return;
    throw Error(ErrorKind::resources,
                text("drawing the volume needs ", bytes_text(static_cast<double>(bytes)), " of memory",
                     picture > volume ? text(", ", bytes_text(static_cast<double>(picture)), " of it for the picture")
                                      : std::string(),
                     ", the budget is ", bytes_text(static_cast<double>(execution.memory))),
                picture > volume ? "raise --memory, or make the picture smaller: --size"
                                 : "raise --memory, or make the volume smaller with 'vkt crop' or 'vkt resample'");
}

std::size_t bytes_of_picture(RenderSettings const& settings, Header const& header, PictureOptions const& file) {
    bool const paths = settings.algorithm == Algorithm::multi_scattering, projected = is_projection(settings.algorithm),
               surfaces = settings.algorithm == Algorithm::implicit_iso || draws_labels(settings, header),
               exr = file.format == PictureFormat::exr, has_layers = exr && !projected;
    constexpr int light = 4 * sizeof(float), sums = 4 * sizeof(double); // of a pixel
    int drawing = 0;
    if (paths)
        drawing = (has_layers ? 3 : 2) * sums + (settings.goal.noise > 0 ? 2 * sums + light : 0);
    else if (settings.goal.any())
        drawing = sums + 2 * light + 10; // halvings of the step, errors, rays; lists of pixels
    else if (may_leave_out(settings, header))
        drawing = light + 2; // corners of blocks of 16
    PartRows const part = rows_of_part(settings);
    int rows = part.last - part.first;
    if (may_leave_out(settings, header)) rows = std::min(settings.height, rows + 2 * sparse_halo);
    int const layers = !has_layers ? 0 : surfaces ? 7 : paths ? 4 : 1, channels = settings.background.alpha < 1 ? 4 : 3;
    int const making = !has_layers ? 0 : surfaces ? 2 * light : light;
    int const kept = layers * static_cast<int>(sizeof(float)) + (paths && has_layers ? 12 : 0); // variances
    int encoding = 2 * channels * (file.depth == 16 ? 2 : 1);                                   // and the file
    if (exr) encoding = 2 * (channels + layers) * static_cast<int>(sizeof(float));
    if (file.format == PictureFormat::pfm) encoding = 2 * 3 * static_cast<int>(sizeof(float));
    return static_cast<std::size_t>(settings.width) * static_cast<std::size_t>(rows) *
           static_cast<std::size_t>(light + kept + std::max({drawing, making, encoding}));
}

bool drawn_as_grid(Header const& header, TreeDrawing tree, std::size_t memory) {
    if (header.kind != Kind::hierarchical || tree == TreeDrawing::bricks || tree == TreeDrawing::blocks) return false;
    if (tree == TreeDrawing::grid || lattice_bytes(header) <= tree_bytes(header)) return true;
    double finest = 1;
    for (int axis = 0; axis < 3; ++axis) finest *= static_cast<double>(header.dims[axis]);
    // Of more, most rays would take many steps through what is one cell.
    constexpr double most = 12;
    return finest <= most * static_cast<double>(header.cell_count) &&
           bytes_to_draw(header, TreeDrawing::grid) <= memory;
}

std::size_t bytes_to_draw(Header const& header, TreeDrawing tree, bool copied) {
    if (header.kind == Kind::structured)
        return (read_to_its_place(header) && !copied ? 0 : header.bytes()) + lattice_bytes(header);
    bool const in_place = header.dtype == DataType::float32 || lattice_size(header.dtype) < sizeof(float);
    std::size_t const bricks = tree_bytes(header) + (in_place ? 0 : header.bytes());
    if (!drawn_as_grid(header, tree, 0)) return bricks;
    // Until it is made there are the bricks, too; of types that are not kept there are the voxels.
    bool const kept = header.dtype != DataType::int8 && lattice_size(header.dtype) < sizeof(float);
    std::size_t const grid =
        header.bytes() + static_cast<std::size_t>(header.brick_count) * Reconstructor::bytes_per_brick +
        lattice_bytes(header) + (kept ? 0 : lattice_bytes(header) / lattice_size(header.dtype) * size_of(header.dtype));
    return tree == TreeDrawing::grid ? grid : std::max(grid, bricks);
}

std::size_t memory_for_blocks(Header const& header, Execution const& execution) {
    std::size_t const taken = bytes_to_draw(header, TreeDrawing::bricks);
    return execution.memory > taken ? execution.memory - taken : 0;
}

std::vector<std::string> explanation(RenderSettings const& settings, Header const& header, PictureOptions const& file) {
    constexpr std::size_t most_memory = std::numeric_limits<std::size_t>::max();
    PartRows const rows = rows_of_part(settings);
    std::int64_t const rays = std::int64_t{settings.width} * (rows.last - rows.first);
    auto const length = [&](int axis) { return static_cast<double>(header.dims[axis]); };
    std::string method, cost;
    if (settings.algorithm == Algorithm::multi_scattering) {
        method = text("delta tracking, isotropic, ", settings.goal.any() ? "at most " : "", settings.samples,
                      " paths a pixel, seed ", settings.seed);
        cost = text(settings.goal.any() ? "at most " : "", rays * settings.samples,
                    " paths, each as long as the volume is dense");
    } else if (is_projection(settings.algorithm)) {
        method = text(enum_name(settings.algorithm), " of the values along each ray, cubic by cubic");
        cost = text("at most ", header.dims.x + header.dims.y + header.dims.z, " voxels on each of ", rays, " rays");
    } else if (draws_labels(settings, header)) {
        method = "labels, the voxel nearest to each point, opaque";
        cost = text("at most ", header.dims.x + header.dims.y + header.dims.z, " voxels on each of ", rays, " rays");
    } else if (settings.algorithm == Algorithm::implicit_iso) {
        method = "implicit iso-surface, exact cubic per voxel";
        cost = text("at most ", header.dims.x + header.dims.y + header.dims.z, " voxels on each of ", rays, " rays");
    } else {
        method = settings.exact ? "exact, piece by piece between the points of the transfer function"
                                : text("ray marching, step ", settings.step,
                                       drawn_as_grid(header, settings.tree, most_memory) ? " voxel of the finest grid"
                                       : header.kind == Kind::hierarchical               ? " of the finest cell nearby"
                                                                                         : " voxel",
                                       settings.skip ? ", empty space skipped" : "",
                                       may_leave_out(settings, header)
                                           ? text(", fewer rays and longer steps within ", settings.shortcut, " levels")
                                           : std::string());
        double const diagonal = std::hypot(length(0), length(1), length(2));
        cost = settings.exact ? text("at most ", header.dims.x + header.dims.y + header.dims.z, " voxels on each of ",
                                     rays, " rays")
                              : text("at most ", static_cast<std::int64_t>(std::ceil(diagonal / settings.step)),
                                     " steps on each of ", rays, " rays");
    }
    int const ways = settings.ambient_occlusion + (settings.shadows ? 1 : 0);
    if (ways > 0) cost += text(", ", ways, ways == 1 ? " ray" : " rays", " to light from wherever something is seen");
    std::vector<std::string> lines = model_text(settings);
    lines.push_back("method " + method);
    bool const chosen = !settings.transfer && settings.lut.empty() && !settings.preset && settings.opacity == "auto" &&
                        settings.domain == "auto" && applies("opacity", settings.algorithm) &&
                        !draws_labels(settings, header);
    if (chosen)
        lines.push_back(header.units == hounsfield ? "colours and opacities those of --preset ct, as the header says HU"
                                                   : "colours and opacities chosen from the histogram, unless the "
                                                     "values are those of CT in HU: then those of --preset ct");
    std::size_t const volume = bytes_to_draw(header, settings.tree), picture = bytes_of_picture(settings, header, file);
    lines.push_back(text(cost, ", ", bytes_text(static_cast<double>(picture)), " for the picture, ",
                         bytes_text(static_cast<double>(volume + picture)), " of memory"));
    return lines;
}

} // namespace vkt::render
