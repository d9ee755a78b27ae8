// What several GPUs of a host gain on voxels that lie in their memory already: a Gaussian of 2048^3 uint16 and paths of
// light, by one of them and by all.
// SPDX-License-Identifier: MIT
#include "libvkt/core/buffer.h"
#include "libvkt/core/device.h"
#include "libvkt/core/parameters.h"
#include "libvkt/core/volume.h"
#include "libvkt/engine/registry.h"
#include "libvkt/render/render.h"

#include <algorithm>
#include <barrier>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <thread>
#include <vector>

namespace {

using namespace vkt;
using Clock = std::chrono::steady_clock;

constexpr std::int64_t slab = 64; ///< slices that are computed at once

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

/// Slices begin…end of the result, from those of the input that they are made of, both in the memory of one GPU.
class PartOfGaussian {
public:
    PartOfGaussian(Header const& header, int gpu, std::int64_t begin, std::int64_t end)
        : operation_(make_operation("filter gaussian")), header_(header), execution_(default_execution()) {
        device_select(gpu);
        execution_.device = Device::gpu;
        execution_.gpu = gpu;
        Parameters parameters;
        operation_->parameters(parameters);
        read_words({"--sigma", "2"}, {&parameters});
        (void)begun(*operation_, {&header_, 1});
        result_ = {{0, 0, begin}, {header.dims.x, header.dims.y, end}};
        from_ = operation_->footprint(result_, 0);
        in_.reserve(bytes_of(from_));
        out_.reserve(bytes_of(result_));
        fill();
        (void)out_.write(Space::device);
    }
    void run() {
        ConstView const in = dense_view(in_.read(Space::device), header_.dtype, from_, Space::device);
        AnyView const out = dense_view(out_.update(Space::device), header_.dtype, result_, Space::device);
        for (std::int64_t z = result_.lower.z; z < result_.upper.z; z += slab) {
            Box box = result_;
            box.lower.z = z;
            box.upper.z = std::min(z + slab, result_.upper.z);
            ConstView const part = in.part(operation_->footprint(box, 0));
            operation_->run({&part, 1}, out.part(box), execution_);
        }
        device_synchronize();
    }

private:
    std::size_t bytes_of(Box const& box) const {
        return static_cast<std::size_t>(box.voxels()) * size_of(header_.dtype);
    }
    /// One slice of noise again and again: what the values are makes no difference.
    void fill() {
        std::vector<std::uint16_t> slice(static_cast<std::size_t>(header_.dims.x * header_.dims.y));
        std::minstd_rand random;
        for (auto& value : slice) value = static_cast<std::uint16_t>(random());
        std::byte* const to = in_.write(Space::device);
        for (std::int64_t z = 0; z < from_.dims().z; ++z)
            copy_to_device(to + static_cast<std::size_t>(z) * 2 * slice.size(), slice.data(), 2 * slice.size());
    }

    std::unique_ptr<Operation> operation_;
    Header header_;
    Execution execution_;
    Box result_, from_;
    Buffer in_, out_;
};

/// Milliseconds that so many GPUs take, the least of some repeats.
double gaussian(std::int64_t edge, int gpus) {
    Header header;
    header.dims = {edge, edge, edge};
    header.dtype = DataType::uint16;
    constexpr int repeats = 4;
    std::vector<Clock::time_point> begins(repeats);
    double best = 1e9;
    std::barrier together(gpus);
    std::vector<std::thread> threads;
    std::vector<std::vector<double>> took(static_cast<std::size_t>(gpus));
    for (int gpu = 0; gpu < gpus; ++gpu)
        threads.emplace_back([&, gpu] {
            PartOfGaussian part(header, gpu, edge * gpu / gpus, edge * (gpu + 1) / gpus);
            for (int i = 0; i < repeats; ++i) {
                together.arrive_and_wait();
                auto const begin = Clock::now();
                part.run();
                together.arrive_and_wait();
                took[static_cast<std::size_t>(gpu)].push_back(seconds_since(begin));
            }
        });
    for (auto& thread : threads) thread.join();
    for (int i = 1; i < repeats; ++i) { // the first fills the pools
        double last = 0;
        for (auto const& of_gpu : took) last = std::max(last, of_gpu[static_cast<std::size_t>(i)]);
        best = std::min(best, last);
    }
    return best * 1e3;
}

Volume cloud() {
    Header header;
    header.dims = {256, 256, 256};
    header.dtype = DataType::uint8;
    Volume volume(header);
    View<std::uint8_t> const view = volume.mutable_view().as<std::uint8_t>();
    for (std::int64_t z = 0; z < 256; ++z)
        for (std::int64_t y = 0; y < 256; ++y)
            for (std::int64_t x = 0; x < 256; ++x) {
                auto const along = [](std::int64_t i) { return static_cast<double>(i - 128) / 128; };
                double const r = std::sqrt(along(x) * along(x) + along(y) * along(y) + along(z) * along(z));
                double const value = (1 - r) * (0.7 + 0.3 * std::cos(20 * r) * std::sin(9 * along(x)));
                view(x, y, z) = static_cast<std::uint8_t>(250 * std::clamp(value, 0.0, 1.0));
            }
    return volume;
}

double paths(Volume const& volume, int gpus) {
    Execution execution = default_execution();
    execution.device = Device::gpu;
    execution.gpus = gpus;
    render::Renderer const renderer(volume, execution);
    render::RenderSettings settings;
    settings.algorithm = render::Algorithm::multi_scattering;
    settings.width = settings.height = 1024;
    settings.samples = 64;
    double best = 1e9;
    for (int i = 0; i < 3; ++i) {
        render::RenderReport report;
        (void)renderer.render(settings, &report);
        best = std::min(best, report.gpu_seconds);
    }
    return best * 1e3;
}

void say(char const* what, double one, double all, int gpus) {
    std::printf("%s: %.1f ms on one GPU, %.1f on %d, %.2f times as fast\n", what, one, all, gpus, one / all);
}

} // namespace

int main(int argc, char** argv) {
    int const gpus = built_with_cuda() ? gpu_count() : 0;
    if (gpus < 2) {
        std::printf("skipped: several GPUs: there are %d\n", gpus);
        return 77;
    }
    std::int64_t const edge = argc > 1 ? std::atoll(argv[1]) : 2048;
    say("a Gaussian of sigma 2", gaussian(edge, 1), gaussian(edge, gpus), gpus);
    Volume const volume = cloud();
    say("64 paths in each of 1024 x 1024 pixels", paths(volume, 1), paths(volume, gpus), gpus);
    return 0;
}
