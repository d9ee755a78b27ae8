// What is said of a picture.
// SPDX-License-Identifier: MIT
#include "libvkt/core/text.h"
#include "libvkt/render/prepared.h"

#include <cmath>

namespace vkt::render {

namespace {

/// A mean number of paths, whole if it is.
std::string mean_text(double paths) { return to_text(std::round(paths * 10) / 10); }

std::string savings_text(RenderSettings const& settings, Savings const& savings) {
    auto const percent = [](double share) { return text(std::lround(100 * share), "%"); };
    return text(", within ", settings.shortcut, " levels: ", percent(1 - savings.filled), " of the pixels have rays, ",
                percent(savings.longer), " of these longer steps");
}

} // namespace

void Renderer::tell(RenderReport& report, RenderSettings const& settings, Prepared const& ready,
                    Drawn const& drawn) const {
    Appearance const& appearance = ready.appearance;
    Integrator const integrator = drawn.integrator;
    bool const projected = is_projection(settings.algorithm);
    report.unit = appearance.unit;
    report.domain = appearance.domain;
    report.transfer = appearance.transfer;
    report.recognised = appearance.recognised;
    report.isos = appearance.iso_values;
    report.iso_colors.clear();
    for (IsoView const& iso : appearance.isos)
        report.iso_colors.push_back({linear_to_srgb(static_cast<double>(iso.red)),
                                     linear_to_srgb(static_cast<double>(iso.green)),
                                     linear_to_srgb(static_cast<double>(iso.blue))});
    report.labels = appearance.labels ? appearance.labels->shown : nullptr;
    report.shade = appearance.shade;
    Counters const& counters = drawn.counters;
    report.rays = counters.rays, report.segments = counters.segments, report.samples = counters.samples;
    report.capped = counters.capped;
    bool const by_bricks = tree_ && integrator == Integrator::march;
    auto const visible = static_cast<double>(by_bricks ? ready.bricks.visible_count : ready.cells.visible_count);
    report.skipped = 1 - visible / static_cast<double>(by_bricks ? tree_->brick_count() : ready.cells.distance.size());
    report.parts = by_bricks ? "bricks" : "macrocells";
    report.lossy = projected ? appearance.lossy : unseen(appearance, ready.knots, ready.table);
    report.missing = histogram().missing, report.infinite = histogram().infinite;
    int const passed = drawn.before + settings.samples;
    if (integrator == Integrator::scatter) report.paths = drawn.in_passes ? report.quality.rays : passed;
    report.first_path = settings.first_sample;
    report.seed = settings.seed;
    report.method =
        appearance.labels ? text("labels, ", drawn.labels, " of them, nearest voxel, shading ", appearance.shade)
        : integrator == Integrator::iso
            ? text("implicit iso-surface, exact cubic per voxel, ", appearance.isos.size(), " value(s)",
                   smooths_edges(settings) ? text(", ", settings.edge_rays, " rays a pixel at edges") : std::string())
        : integrator == Integrator::scatter
            ? text("delta tracking, ",
                   settings.anisotropy == 0 ? std::string("isotropic")
                                            : text("Henyey-Greenstein of mean cosine ", settings.anisotropy),
                   ", ", drawn.in_passes ? mean_text(report.quality.rays) : text(passed), " paths per pixel, seed ",
                   settings.seed)
        : projected ? text(enum_name(settings.algorithm), " of the values along each ray, cubic by cubic")
        : settings.exact
            ? "exact, piece by piece between the points of the transfer function"
            : text("ray marching, step ",
                   drawn.in_passes && settings.goal.any() ? report.quality.finest : settings.step,
                   tree_                                ? " of the finest cell"
                   : header_.kind == Kind::hierarchical ? " voxel of the finest grid"
                                                        : " voxel",
                   drawn.sparsely ? savings_text(settings, report.savings) : "", ", shading ", appearance.shade);
    if (drawn.with_gpu) report.method += ", on a GPU";
    report.drawn_by = drawn.with_gpu ? text(execution_.gpus, execution_.gpus == 1 ? " GPU" : " GPUs")
                                     : text(execution_.threads, execution_.threads == 1 ? " thread, " : " threads, ",
                                            name_of(execution_.instructions));
    report.prepare_seconds = prepare_seconds_;
}

} // namespace vkt::render
