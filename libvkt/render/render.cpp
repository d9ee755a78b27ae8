// Rendering: a volume made ready, and tiles that are shared out to threads.
// SPDX-License-Identifier: MIT
#include "libvkt/render/render.h"

#include "libvkt/amr/reconstruct.h"
#include "libvkt/core/device.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/labels.h"
#include "libvkt/render/content.h"
#include "libvkt/render/cost.h"
#include "libvkt/render/edges.h"
#include "libvkt/render/passes.h"
#include "libvkt/render/prepared.h"
#include "libvkt/render/room.h"
#include "libvkt/render/screen.h"
#include "libvkt/render/sparse.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <mutex>

namespace vkt::render {

namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Whether light from behind passes everywhere.
bool is_empty(Image const& image) {
    for (std::size_t i = 3; i < image.pixels.size(); i += 4)
        if (image.pixels[i] < 1) return false;
    return true;
}

/// All that decides what is prepared.
PreparedFor prepared_for(RenderSettings const& s, Header const& header) {
    return {s.algorithm, s.transfer,   s.lut,           s.preset,        s.colormap,
            s.opacity,   s.domain,     s.unit,          s.opacity_scale, s.shade,
            s.isos,      s.iso_colors, s.iso_opacities, s.chosen_from,   draws_labels(s, header),
            s.skip};
}

/// The finest cells of a box.
SampleGrid grid_in(Box const& box) {
    SampleGrid grid;
    for (int a = 0; a < 3; ++a) grid.lower[a] = static_cast<double>(box.lower[a]);
    grid.dims = box.dims();
    return grid;
}

/// The finest cells of a hierarchical volume, as vkt resample makes them, in the type of its cells.
Lattice lattice_of_tree(Volume const& volume, Execution const& execution) {
    Header const& header = volume.header();
    SampleGrid const grid = grid_in(box_of(header.dims));
    double const background = stored_background(header).value_or(header.values.stored(0));
    Reconstructor const cells(volume, grid, Reconstruction::basis, background);
    Execution host = execution;
    host.device = Device::cpu;
    return make_lattice(
        cells.header(), [&](AnyView const& to) { cells.run(to, host); }, execution);
}

} // namespace

Renderer::Renderer(Volume const& volume, Execution const& execution, TreeDrawing tree)
    : header_(volume.header()), execution_(execution),
      region_(header_.kind == Kind::hierarchical ? region_of(header_) : box_of(header_.dims)) {
    execution_.threads = std::max(1, execution.threads);
    auto const start = Clock::now();
    if (header_.kind == Kind::structured)
        lattice_ = make_lattice(volume.view(), header_.values, execution_);
    else if (drawn_as_grid(header_, tree, execution_.memory) &&
             (tree == TreeDrawing::grid || !leaves_holes(header_, volume.bricks(), grid_in(region_))))
        lattice_ = lattice_of_tree(volume, execution_);
    else
        tree_.emplace(volume, tree != TreeDrawing::bricks && !leaves_holes(header_, volume.bricks(), grid_in(region_)),
                      execution_);
    if (header_.kind == Kind::hierarchical && (is_integer(header_.dtype) || holds_labels(header_)))
        cells_of_labels_ = volume;
    cache_ = std::make_shared<Cache>();
    prepare_seconds_ = seconds_since(start);
}

Renderer::Renderer(Header header, ConstView voxels, Execution const& execution)
    : header_(std::move(header)), execution_(execution), region_(box_of(header_.dims)),
      cache_(std::make_shared<Cache>()) {
    execution_.threads = std::max(1, execution.threads);
    auto const start = Clock::now();
    lattice_ = make_lattice(voxels, header_.values, execution_);
    prepare_seconds_ = seconds_since(start);
}

Renderer::Renderer(Header header, VoxelReader const& read, Execution const& execution)
    : header_(std::move(header)), execution_(execution), region_(box_of(header_.dims)),
      cache_(std::make_shared<Cache>()) {
    execution_.threads = std::max(1, execution.threads);
    auto const start = Clock::now();
    double reading = 0; // is no part of what prepares a picture
    auto const timed = [&](AnyView const& to) {
        auto const begin = Clock::now();
        read(to);
        reading = seconds_since(begin);
    };
    lattice_ = make_lattice(header_, timed, execution_);
    prepare_seconds_ = seconds_since(start) - reading;
}

std::int64_t Renderer::preparations() const {
    std::lock_guard const lock(cache_->mutex);
    return cache_->made;
}

std::shared_ptr<Renderer::Prepared const> Renderer::prepared(RenderSettings const& settings) const {
    std::lock_guard const lock(cache_->mutex);
    PreparedFor wanted = prepared_for(settings, header_);
    if (cache_->last && cache_->last->made_for == wanted) return cache_->last;
    cache_->last.reset(); // its memory is needed for the next
    Appearance appearance = appearance_of(settings);
    std::vector<Knot> knots =
        knots_of(appearance.transfer, header_.values, rescaling(), appearance.unit, settings.opacity_scale);
    TransferTable table(knots);
    CellVisibility cells;
    Tree::Visibility bricks;
    if (tree_) bricks = tree_->classify(table);
    cells = appearance.labels                             ? classify_cells(macrocells(), appearance.labels->nothing)
            : wanted.algorithm == Algorithm::implicit_iso ? classify_cells(macrocells(), appearance.isos)
                                                          : classify_cells(macrocells(), table);
    StoredBlocks blocks;
    if (tree_ && wanted.algorithm == Algorithm::ray_marching && !appearance.labels)
        blocks =
            tree_->blocks(cells, table, !settings.skip, memory_for_blocks(header_, execution_), execution_.threads);
    cache_->last = std::make_shared<Prepared const>(Prepared{std::move(wanted), std::move(appearance), std::move(knots),
                                                             std::move(table), std::move(cells), std::move(bricks),
                                                             std::move(blocks)});
    ++cache_->made;
    return cache_->last;
}

Renderer const& Renderer::on_grid() const {
    std::lock_guard const lock(cache_->mutex);
    if (cache_->grid) return *cache_->grid;
    if (!cells_of_labels_)
        throw Error(ErrorKind::usage,
                    "--labels always: the cells are no integers, and their header does not say labels",
                    "vkt set --attribute meaning=labels says so");
    SampleGrid const grid = plan_grid(header_, {});
    check_memory(gridded_header(header_, grid), execution_, TreeDrawing::automatic, true);
    Volume const cells = reconstruct(*cells_of_labels_, grid, Reconstruction::nearest, 0, execution_);
    cache_->grid = std::make_unique<Renderer const>(cells, execution_);
    return *cache_->grid;
}

double Renderer::value_at(Vec3 index) const {
    constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
    Index3 at;
    for (int axis = 0; axis < 3; ++axis) {
        double const i = std::floor(index[axis] + 0.5);
        if (!(i >= 0 && i < static_cast<double>(header_.dims[axis]))) return nothing;
        at[axis] = static_cast<std::int64_t>(i);
    }
    if (header_.kind == Kind::hierarchical && holds_labels(header_)) {
        Index3 const first = region_of(header_).lower;
        auto const moved = [&](int axis) { return static_cast<double>(at[axis] - first[axis]); };
        return on_grid().value_at({moved(0), moved(1), moved(2)});
    }
    double const sampled = tree_ ? tree_->value_at({index.x + 0.5, index.y + 0.5, index.z + 0.5}) : lattice_.at(at);
    Rescaling const& r = rescaling();
    return header_.values.physical(sampled / r.scale + r.offset);
}

bool Renderer::on_gpu(RenderSettings const& settings, bool refines) const {
    if (execution_.device == Device::automatic) {
        // Getting hold of a GPU takes as long as a picture, unless that takes many paths.
        constexpr double worth_it = 2e8;
        double const paths = static_cast<double>(settings.samples) * settings.width * settings.height;
        bool const heavy = settings.algorithm == Algorithm::multi_scattering && paths > worth_it;
        return heavy && !refines && gpu_count() > 0;
    }
    if (execution_.device != Device::gpu) return false;
    if (!refines) return true;
    if (execution_.only_gpu)
        throw Error(ErrorKind::usage,
                    "--device gpu: pictures with --noise, --time or --tolerance, and layers, are not drawn on a GPU",
                    "give --spp, write no .exr, or leave the choice to vkt: --device auto");
    return false;
}

Image Renderer::render(RenderSettings const& settings, RenderReport* report, std::stop_token const& stop,
                       Accumulation* accumulation) const {
    Watch watch;
    if (stop.stop_possible()) watch.stop = [&] { return stop.stop_requested(); };
    return draw(settings, report, watch, accumulation, settings.goal.any() && accumulation == nullptr);
}

Image Renderer::watched(RenderSettings const& settings, RenderReport* report, Watch const& watch) const {
    return draw(settings, report, watch, nullptr, true);
}

std::vector<Layer> Renderer::layers_of(Drawing const& drawing, Image const& picture, Integrator integrator,
                                       TreeView const& tree) const {
    std::vector<Layer> layers;
    int const width = picture.width;
    std::size_t const count = picture.pixels.size() / 4;
    auto const drawn = [&](Integrator what) {
        Image image{width, picture.height, std::vector<float>(4 * count)};
        Drawing one = drawing;
        one.draw = [&](SceneView const& view, Tile tile, float* pixels, Counters& counters) {
            if (tree_)
                tree_tile_function(execution_.instructions)(view, tree, what, tile, pixels, width, counters);
            else
                tile_function(execution_.instructions)(view, lattice_.view, what, tile, pixels, width, counters);
        };
        one.scene.samples = 1;
        Counters counters;
        draw_once(one, image, counters);
        return image;
    };
    auto const add = [&](char const* name, Image const& from, std::size_t channel) {
        layers.push_back({name, std::vector<float>(count)});
        for (std::size_t i = 0; i < count; ++i) layers.back().values[i] = from.pixels[4 * i + channel];
    };
    if (integrator == Integrator::iso) {
        Image const place = drawn(Integrator::place), albedo = drawn(Integrator::albedo);
        add("Z", place, 3);
        add("normal.X", place, 0), add("normal.Y", place, 1), add("normal.Z", place, 2);
        add("albedo.R", albedo, 0), add("albedo.G", albedo, 1), add("albedo.B", albedo, 2);
    } else {
        add("Z", drawn(Integrator::half_distance), 3);
    }
    if (drawing.variance == nullptr) return layers;
    for (std::size_t c = 0; c < 3; ++c) {
        auto const plane = drawing.variance->begin() + static_cast<std::ptrdiff_t>(c * count);
        layers.push_back({c == 0   ? "variance.R"
                          : c == 1 ? "variance.G"
                                   : "variance.B",
                          {plane, plane + static_cast<std::ptrdiff_t>(count)}});
    }
    return layers;
}

Camera Renderer::camera_of(RenderSettings const& settings, Prepared const& ready) const {
    double const aspect = static_cast<double>(settings.width) / settings.height;
    Box shown = region_; // a grid may hold more than the part of a tree that there is
    if (!settings.clip.empty()) {
        Box const clip = settings.clip.resolve(header_.dims);
        shown = intersect(shown, clip);
        if (shown.empty()) shown = clip;
    }
    // What projections show is everywhere.
    if (settings.camera.fit == Fit::content && !is_projection(settings.algorithm) && follows_content(settings.camera)) {
        Appearance const& appearance = ready.appearance;
        bool const labels = appearance.labels != nullptr,
                   surfaces = settings.algorithm == Algorithm::implicit_iso && !labels;
        auto const seen = [&](float lowest, float highest) {
            if (labels) return lowest < appearance.labels->nothing || highest > appearance.labels->nothing;
            if (surfaces) return meets(appearance.isos, lowest, highest);
            return ready.table.greatest_extinction(lowest, highest) > 0;
        };
        VisibleContent const content(ready.cells, tree_ ? parts_of(*tree_) : parts_of(lattice_, labels), seen,
                                     header_.geometry, shown);
        if (content.any())
            return settings.camera.steady ? make_camera(settings.camera, content.corners(), aspect)
                                          : make_camera(settings.camera, content, aspect);
    }
    return make_camera(settings.camera, corners_of(header_.geometry, shown), aspect);
}

Image Renderer::draw(RenderSettings const& settings, RenderReport* report, Watch const& watch,
                     Accumulation* accumulation, bool in_passes) const {
    check(settings);
    if (header_.kind == Kind::hierarchical && draws_labels(settings, header_)) {
        RenderSettings on_its_grid = settings;
        Box const region = region_of(header_);
        if (!settings.clip.empty()) {
            Box const clip = intersect(settings.clip.resolve(header_.dims), region);
            if (clip.empty()) throw Error(ErrorKind::usage, "--clip-box: nothing of the volume is in it");
            on_its_grid.clip = roi_of(clip.lower - region.lower, clip.upper - region.lower);
        }
        return on_grid().draw(on_its_grid, report, watch, accumulation, in_passes);
    }
    auto const start = Clock::now();
    std::shared_ptr<Prepared const> const ready = prepared(settings);
    Appearance const& appearance = ready->appearance;
    std::vector<Knot> const& knots = ready->knots;
    TransferTable const& table = ready->table;
    CellVisibility const& cells = ready->cells;
    Tree::Visibility const& bricks = ready->bricks;
    bool const labels = appearance.labels != nullptr;
    bool const surfaces = settings.algorithm == Algorithm::implicit_iso || labels,
               projected = is_projection(settings.algorithm);
    Camera const camera = camera_of(settings, *ready);
    SceneView scene = scene_of(settings, appearance, camera);
    scene.projection = settings.algorithm == Algorithm::minimum ? Projected::least
                       : settings.algorithm == Algorithm::mean  ? Projected::mean
                                                                : Projected::greatest;
    scene.table = table.view();
    scene.knots = knots.data();
    scene.knot_count = static_cast<int>(knots.size());
    std::vector<Knot> const bends = bends_of(knots);
    scene.bends = bends.data();
    scene.bend_count = static_cast<int>(bends.size());
    scene.cells = view_of(macrocells(), cells);
    TreeView const tree = tree_ ? tree_->view(bricks, ready->blocks) : TreeView{};
    Integrator const integrator = surfaces                                            ? Integrator::iso
                                  : settings.algorithm == Algorithm::multi_scattering ? Integrator::scatter
                                  : projected                                         ? Integrator::project
                                  : settings.exact                                    ? Integrator::exact
                                                                                      : Integrator::march;

    PartRows const rows = rows_of_part(settings);
    scene.frame.top = rows.first;
    Image image{settings.width, rows.last - rows.first, {}};
    bool const layers = settings.layers && report != nullptr && !projected;
    bool const with_gpu = on_gpu(settings, layers || (in_passes && settings.goal.any()));
    std::size_t const numbers = 4 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
    // Nothing is there until something is drawn; a GPU draws all of it at once.
    bool const room = make_room(image.pixels, numbers, watch, [&](std::size_t from, std::size_t to) {
        for (std::size_t i = from + 3; i < to && !with_gpu; i += 4) image.pixels[i] = 1;
    });
    if (!room) {
        image.height = 0;
        if (report != nullptr) report->quality.stopped = true, report->quality.undrawn = 1;
        return image;
    }
    if (accumulation != nullptr && integrator == Integrator::scatter) {
        if (accumulation->samples == 0) accumulation->sums.assign(image.pixels.size(), 0);
        scene.first_sample = settings.first_sample + accumulation->samples;
        scene.sums.light = accumulation->sums.data();
        scene.before = accumulation->samples;
        accumulation->samples += settings.samples;
    }

    // Most rays may pass no cell in which something can be seen, and are not worth following.
    bool const marched = integrator == Integrator::march;
    std::optional<Screen> screen;
    if ((integrator == Integrator::iso || marched) && !tree_ && !with_gpu && settings.skip) {
        // Marched with fewer rays, some rows around a part are drawn, too.
        int const first = std::max(0, rows.first - 2 * sparse_halo);
        screen.emplace(scene, cells, first, std::min(settings.height, rows.last + 2 * sparse_halo) - first,
                       execution_.threads);
    }
    Drawing drawing{[&, of_lattice = tile_function(execution_.instructions),
                     of_tree = tree_tile_function(execution_.instructions)](SceneView const& view, Tile tile,
                                                                            float* pixels, Counters& counters) {
                        if (tree_)
                            of_tree(view, tree, integrator, tile, pixels, image.width, counters);
                        else if (screen && view.sums.squares == nullptr)
                            screen->draw(view, marched, tile, pixels, counters, [&](Tile part) {
                                of_lattice(view, lattice_.view, integrator, part, pixels, image.width, counters);
                            });
                        else
                            of_lattice(view, lattice_.view, integrator, tile, pixels, image.width, counters);
                    },
                    scene,
                    settings.background,
                    settings.goal,
                    watch,
                    execution_.threads,
                    nullptr,
                    start};
    std::vector<float> variance;
    if (layers && integrator == Integrator::scatter && in_passes) drawing.variance = &variance;
    Counters counters;
    Quality quality;
    Savings savings;
    bool const sparsely = integrator == Integrator::march && !with_gpu && may_leave_out(settings, header_);
    bool const smooth = smooths_edges(settings) && !labels;
    std::optional<Image> fine; ///< with the rays of edges everywhere
    double gpu_seconds = 0;
    if (with_gpu) {
        std::lock_guard const lock(cache_->drawing);
        std::vector<DrawingGpu> gpus;
        cache_->copies.resize(static_cast<std::size_t>(execution_.gpus));
        for (OnGpu& there : cache_->copies) {
            int const gpu = execution_.gpu + static_cast<int>(gpus.size());
            device_select(gpu);
            if (!there.scene)
                there.scene = tree_ ? std::make_unique<DeviceCopies>()
                                    : std::make_unique<DeviceCopies>(lattice_.view, lattice_.voxels.bytes());
            SceneView const view =
                there.scene->scene(scene, ready, integrator == Integrator::scatter ? settings.environment : nullptr);
            if (tree_) {
                if (!there.tree) there.tree = std::make_unique<DeviceTree>(*tree_);
                gpus.push_back({gpu, view,
                                [bricks_there = there.tree->view(bricks, ready->blocks, ready), integrator](
                                    SceneView const& some, Bands const& bands, float* pixels, std::uint64_t* totals) {
                                    launch_drawing(some, bricks_there, integrator, bands, pixels, totals);
                                }});
            } else {
                gpus.push_back({gpu, view,
                                [voxels_there = there.scene->lattice(), integrator](
                                    SceneView const& some, Bands const& bands, float* pixels, std::uint64_t* totals) {
                                    launch_drawing(some, voxels_there, integrator, bands, pixels, totals);
                                }});
            }
        }
        quality = draw_on_gpus(drawing, gpus, integrator, in_passes, image, counters, gpu_seconds);
        if (smooth && !quality.stopped) { // all of it takes a GPU less than to be told which pixels
            fine.emplace(image);
            for (DrawingGpu& gpu : gpus) gpu.scene.rays = settings.edge_rays;
            draw_on_gpus(drawing, gpus, integrator, false, *fine, counters, gpu_seconds);
        }
    } else if (integrator == Integrator::scatter && in_passes)
        quality = draw_paths(drawing, image, counters);
    else if (settings.goal.any() && in_passes)
        quality = draw_adaptively(drawing, integrator == Integrator::march, image, counters);
    else if (sparsely)
        quality = draw_sparsely(drawing, settings.shortcut, image, counters, savings);
    else
        quality = draw_once(drawing, image, counters);
    if (smooth && !quality.stopped)
        smooth_edges(drawing, settings.edge_rays, fine ? &*fine : nullptr, image, counters, quality);
    if (report != nullptr) {
        Drawn const drawn{integrator, in_passes, sparsely, with_gpu, scene.label_count, scene.before, counters};
        report->quality = quality;
        report->savings = savings;
        tell(*report, settings, *ready, drawn);
        report->camera = camera;
        if (layers && !quality.stopped) report->layers = layers_of(drawing, image, integrator, tree);
        if (report->lossy.empty() && !quality.stopped && settings.parts == 1 && is_empty(image))
            report->lossy.emplace_back("the picture is empty: nothing that can be seen is in front of the camera");
        report->render_seconds = seconds_since(start);
        report->gpu_seconds = gpu_seconds;
    }
    return image;
}

Image render(Volume const& volume, RenderSettings const& settings, Execution const& execution, RenderReport* report) {
    return Renderer(volume, execution, settings.tree).render(settings, report);
}

} // namespace vkt::render
