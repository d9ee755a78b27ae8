// Copies for the GPU, and passes over all pixels.
// SPDX-License-Identifier: MIT
#include "libvkt/render/device.h"

#include "libvkt/core/device.h"

#include <algorithm>
#include <chrono>
#include <deque>
#include <optional>
#include <utility>

namespace vkt::render {
namespace {

constexpr int paths_at_once = 8; ///< between two looks at the watch

/// Numbers of the pixels that are summed up on a GPU: those of the host, or zeros.
class DeviceSums {
public:
    DeviceSums(double const* host, std::size_t count) {
        memory_.reserve(count * sizeof(double));
        std::byte* const data = memory_.write(Space::device);
        if (host != nullptr)
            copy_to_device(data, host, count * sizeof(double));
        else
            device_clear(data, count * sizeof(double));
    }
    double* get() { return reinterpret_cast<double*>(memory_.update(Space::device)); }
    void copy(std::size_t first, std::size_t count, double* to) {
        copy_to_host(to + first, memory_.read(Space::device) + first * sizeof(double), count * sizeof(double));
    }

private:
    Buffer memory_;
};

/// What one GPU draws of a picture.
class PartOnGpu {
public:
    PartOnGpu(DrawingGpu const& on, Bands const& bands, Image const& image)
        : on_(on), bands_(bands), row_(4 * static_cast<std::size_t>(image.width)) {
        device_select(on_.gpu);
        pixels_.reserve(image.pixels.size() * sizeof(float));
        to_ = reinterpret_cast<float*>(pixels_.write(Space::device));
        device_clear(totals_.write(Space::device), 4 * sizeof(std::uint64_t));
        counts_ = reinterpret_cast<std::uint64_t*>(totals_.update(Space::device));
    }
    /// Sums for paths: of light, and of every second path.
    void begin_sums(double const* light, std::size_t count, bool odd) {
        device_select(on_.gpu);
        light_.emplace(light, count);
        if (odd) odd_.emplace(nullptr, count);
    }
    SceneView const& scene() const { return on_.scene; }
    /// Begins to draw, which takes its time.
    void launch(SceneView const& scene) {
        device_select(on_.gpu);
        on_.launch(scene, bands_, to_, counts_);
    }
    void launch_paths(int done, int samples) {
        SceneView part = on_.scene;
        part.samples = samples;
        part.first_sample += done;
        part.before += done;
        part.sums = {light_->get(), odd_ ? odd_->get() : nullptr, nullptr, {}};
        launch(part);
    }
    void wait() {
        device_select(on_.gpu);
        device_synchronize();
    }
    /// Rays are pixels that meet the volume, however many passes there are.
    void settle_rays(bool first_pass) {
        device_select(on_.gpu);
        if (first_pass)
            copy_to_host(&met_, counts_, sizeof met_);
        else
            copy_to_device(counts_, &met_, sizeof met_);
    }
    void copy_sums(double* light, double* odd) {
        device_select(on_.gpu);
        for_bands([&](std::size_t first, std::size_t count) {
            if (light != nullptr) light_->copy(first, count, light);
            if (odd != nullptr) odd_->copy(first, count, odd);
        });
    }
    void copy_pixels(Image& image, Counters& total) {
        device_select(on_.gpu);
        for_bands([&](std::size_t first, std::size_t count) {
            copy_to_host(image.pixels.data() + first, to_ + first, count * sizeof(float));
        });
        auto const* const found = reinterpret_cast<std::uint64_t const*>(totals_.read(Space::host));
        total.rays += static_cast<std::int64_t>(found[0]);
        total.segments += static_cast<std::int64_t>(found[1]);
        total.samples += static_cast<std::int64_t>(found[2]);
        total.capped += static_cast<std::int64_t>(found[3]);
    }

private:
    template <class F> void for_bands(F const& f) const {
        if (bands_.step == 1) // all rows are one piece
            return f(static_cast<std::size_t>(bands_.part.y0) * row_,
                     static_cast<std::size_t>(bands_.part.y1 - bands_.part.y0) * row_);
        for (int band = 0; band < bands_.count(); ++band) {
            int const begin = bands_.row(band), end = std::min(begin + Bands::rows_of_band, bands_.part.y1);
            f(static_cast<std::size_t>(begin) * row_, static_cast<std::size_t>(end - begin) * row_);
        }
    }

    DrawingGpu const& on_;
    Bands bands_;
    std::size_t row_; ///< numbers of a row
    Buffer pixels_, totals_{4 * sizeof(std::uint64_t)};
    float* to_ = nullptr;
    std::uint64_t* counts_ = nullptr;
    std::optional<DeviceSums> light_, odd_;
    std::uint64_t met_ = 0;
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
void launch_drawing(SceneView const&, LatticeView const&, Integrator, Bands const&, float*, std::uint64_t*) {
    throw_without_cuda();
}
void launch_drawing(SceneView const&, TreeView const&, Integrator, Bands const&, float*, std::uint64_t*) {
    throw_without_cuda();
}
#endif

Quality draw_on_gpus(Drawing const& drawing, std::vector<DrawingGpu> const& gpus, Integrator integrator, bool estimates,
                     Image& image, Counters& total, double& seconds) {
    std::deque<PartOnGpu> parts;
    // Bands in turn: dense and empty parts of a picture are shared alike.
    auto const count_of_gpus = static_cast<int>(gpus.size());
    for (int i = 0; i < count_of_gpus; ++i)
        parts.emplace_back(gpus[static_cast<std::size_t>(i)],
                           Bands{{0, 0, image.width, image.height}, i, count_of_gpus}, image);
    Quality quality;
    auto const draw = [&](auto const& launch) {
        auto const start = std::chrono::steady_clock::now();
        for (PartOnGpu& part : parts) launch(part);
        for (PartOnGpu& part : parts) part.wait();
        seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    };
    if (integrator == Integrator::scatter) {
        SceneView const& scene = gpus.front().scene;
        Watch const& watch = drawing.watch;
        std::size_t const count = image.pixels.size();
        estimates = estimates && scene.before == 0;
        for (PartOnGpu& part : parts) part.begin_sums(scene.before > 0 ? scene.sums.light : nullptr, count, estimates);
        int done = 0;
        while (done < scene.samples) {
            int const samples = std::min(paths_at_once, scene.samples - done);
            draw([&](PartOnGpu& part) { part.launch_paths(done, samples); });
            for (PartOnGpu& part : parts) part.settle_rays(done == 0);
            done += samples;
            if (watch.progress) watch.progress({static_cast<double>(done) / scene.samples, -1, 0});
            if (watch.stop && done < scene.samples && watch.stop()) {
                quality.stopped = true;
                break;
            }
        }
        bool const stopped = quality.stopped;
        std::vector<double> light(estimates ? count : 0), odd(estimates ? count : 0);
        if (estimates) {
            for (PartOnGpu& part : parts) part.copy_sums(light.data(), odd.data());
            quality = quality_of_paths(drawing, image.width, done, light, odd);
        }
        if (scene.sums.light != nullptr)
            for (PartOnGpu& part : parts) part.copy_sums(scene.sums.light, nullptr);
        quality.stopped = stopped;
        quality.rays = scene.before + done;
    } else {
        draw([](PartOnGpu& part) { part.launch(part.scene()); });
    }
    for (PartOnGpu& part : parts) part.copy_pixels(image, total);
    return quality;
}

} // namespace vkt::render
