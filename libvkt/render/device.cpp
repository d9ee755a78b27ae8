// Copies for the GPU, and passes over all pixels.
// SPDX-License-Identifier: MIT
#include "libvkt/render/device.h"

#include "libvkt/core/device.h"

#include <algorithm>
#include <chrono>
#include <optional>

namespace vkt::render {
namespace {

constexpr int paths_at_once = 8; ///< between two looks at the watch

/// Numbers that are summed up on the GPU: those of the host, or as many zeros.
class DeviceSums {
public:
    DeviceSums(double* host, std::size_t count, bool begun) : host_(host), count_(count) {
        memory_.reserve(count * sizeof(double));
        std::byte* const data = memory_.write(Space::device);
        if (host != nullptr && begun)
            copy_to_device(data, host, count * sizeof(double));
        else
            device_clear(data, count * sizeof(double));
    }
    double* get() { return reinterpret_cast<double*>(memory_.update(Space::device)); }
    std::vector<double> values() {
        std::vector<double> result(count_);
        copy_to_host(result.data(), memory_.read(Space::device), count_ * sizeof(double));
        return result;
    }
    void store() { copy_to_host(host_, memory_.read(Space::device), count_ * sizeof(double)); }

private:
    double* host_;
    std::size_t count_;
    Buffer memory_;
};

} // namespace

Buffer copied_to_device(void const* host, std::size_t bytes) {
    Buffer buffer = Buffer::adopt(static_cast<std::byte*>(const_cast<void*>(host)), bytes, std::make_shared<int>());
    (void)buffer.read(Space::device);
    return buffer;
}

DeviceCopies::DeviceCopies(LatticeView const& lattice, std::size_t bytes)
    : lattice_(lattice), voxels_(copied_to_device(lattice.data, bytes)) {}

LatticeView DeviceCopies::lattice() {
    LatticeView view = lattice_;
    view.data = on_device<std::byte>(voxels_);
    return view;
}

SceneView DeviceCopies::scene(SceneView const& scene, std::shared_ptr<void const> const& made_for,
                              std::shared_ptr<Environment const> const& environment) {
    if (made_for_ != made_for) {
        auto const cells = static_cast<std::size_t>(scene.cells.nx) * static_cast<std::size_t>(scene.cells.ny) *
                           static_cast<std::size_t>(scene.cells.nz);
        lowest_ = copied_to_device(scene.cells.lowest, cells * sizeof(float));
        majorant_ = copied_to_device(scene.cells.majorant, cells * sizeof(float));
        distance_ = copied_to_device(scene.cells.distance, cells);
        if (scene.cells.depth != nullptr) depth_ = copied_to_device(scene.cells.depth, cells);
        nodes_ = copied_to_device(scene.table.nodes, 2 * static_cast<std::size_t>(scene.table.count) * sizeof(Quad));
        knots_ = copied_to_device(scene.knots, static_cast<std::size_t>(scene.knot_count) * sizeof(Knot));
        if (scene.label_count > 0)
            labels_ = copied_to_device(scene.labels, static_cast<std::size_t>(scene.label_count) * sizeof(IsoView));
        made_for_ = made_for;
    }
    if (environment_ != environment && environment != nullptr) {
        pixels_ = copied_to_device(environment->pixels.data(), environment->pixels.size() * sizeof(float));
        row_ends_ = copied_to_device(environment->row_ends.data(), environment->row_ends.size() * sizeof(float));
        column_ends_ =
            copied_to_device(environment->column_ends.data(), environment->column_ends.size() * sizeof(float));
        environment_ = environment;
    }
    SceneView result = scene;
    if (environment != nullptr) {
        result.environment.pixels = on_device<float>(pixels_);
        result.environment.row_ends = on_device<float>(row_ends_);
        result.environment.column_ends = on_device<float>(column_ends_);
    }
    result.cells.lowest = on_device<float>(lowest_);
    result.cells.majorant = on_device<float>(majorant_);
    result.cells.distance = on_device<std::uint8_t>(distance_);
    if (scene.cells.depth != nullptr) result.cells.depth = on_device<std::uint8_t>(depth_);
    result.table.nodes = on_device<Quad>(nodes_);
    result.knots = on_device<Knot>(knots_);
    if (scene.label_count > 0) result.labels = on_device<IsoView>(labels_);
    return result;
}

#ifndef VKT_CUDA
void launch_drawing(SceneView const&, LatticeView const&, Integrator, Tile, float*, std::uint64_t*) {
    throw_without_cuda();
}
void launch_drawing(SceneView const&, TreeView const&, Integrator, Tile, float*, std::uint64_t*) {
    throw_without_cuda();
}
#endif

Quality draw_on_gpu(Drawing const& drawing, SceneView const& scene, Launch const& launch, Integrator integrator,
                    bool estimates, Image& image, Counters& total, double& seconds) {
    Watch const& watch = drawing.watch;
    Tile const part_drawn{0, drawing.first_row, image.width, drawing.last_row};
    std::size_t const count = image.pixels.size();
    Buffer pixels(count * sizeof(float)), totals(4 * sizeof(std::uint64_t));
    auto* const to = reinterpret_cast<float*>(pixels.write(Space::device));
    device_clear(totals.write(Space::device), 4 * sizeof(std::uint64_t));
    auto* const counts = reinterpret_cast<std::uint64_t*>(totals.update(Space::device));
    Quality quality;
    auto const draw = [&](SceneView const& some) {
        auto const start = std::chrono::steady_clock::now();
        launch(some, part_drawn, to, counts);
        device_synchronize();
        seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    };
    if (integrator == Integrator::scatter) {
        DeviceSums light(scene.sums.light, count, scene.before > 0);
        std::optional<DeviceSums> odd;
        estimates = estimates && scene.before == 0;
        if (estimates) odd.emplace(nullptr, count, false);
        SceneView part = scene;
        part.sums = {light.get(), odd ? odd->get() : nullptr, nullptr, {}};
        int done = 0;
        std::uint64_t met = 0;
        while (done < scene.samples) {
            part.samples = std::min(paths_at_once, scene.samples - done);
            part.first_sample = scene.first_sample + done;
            part.before = scene.before + done;
            draw(part);
            // Rays are pixels that meet the volume, however many passes there are.
            if (done == 0)
                copy_to_host(&met, counts, sizeof met);
            else
                copy_to_device(counts, &met, sizeof met);
            done += part.samples;
            if (watch.progress) watch.progress({static_cast<double>(done) / scene.samples, -1, 0});
            if (watch.stop && done < scene.samples && watch.stop()) {
                quality.stopped = true;
                break;
            }
        }
        bool const stopped = quality.stopped;
        if (estimates) quality = quality_of_paths(drawing, image.width, done, light.values(), odd->values());
        if (scene.sums.light != nullptr) light.store();
        quality.stopped = stopped;
        quality.rays = scene.before + done;
    } else {
        draw(scene);
    }
    std::size_t const row = 4 * static_cast<std::size_t>(image.width);
    std::size_t const first = static_cast<std::size_t>(drawing.first_row) * row,
                      last = static_cast<std::size_t>(drawing.last_row) * row;
    copy_to_host(image.pixels.data() + first, to + first, (last - first) * sizeof(float));
    auto const* const found = reinterpret_cast<std::uint64_t const*>(totals.read(Space::host));
    total.rays += static_cast<std::int64_t>(found[0]);
    total.segments += static_cast<std::int64_t>(found[1]);
    total.samples += static_cast<std::int64_t>(found[2]);
    total.capped += static_cast<std::int64_t>(found[3]);
    return quality;
}

} // namespace vkt::render
