// Pictures drawn on a GPU against the CPU's, for all integrators and types that rays sample; then frames of 1024 x
// 1024. SPDX-License-Identifier: MIT
#include "libvkt/core/device.h"
#include "libvkt/core/volume.h"
#include "libvkt/render/render.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string_view>

namespace {

using namespace vkt;
using render::Algorithm;

constexpr int skipped = 77; ///< exit code by which CTest knows
int failures = 0;

Execution on(Device device) {
    Execution execution = default_execution();
    execution.device = device;
    execution.only_gpu = device == Device::gpu;
    return execution;
}

/// Waves in a ball, over the range of the type, and NaN in a corner of floats.
template <class T> Volume waves(DataType type, Index3 n) {
    Header header;
    header.dims = n;
    header.dtype = type;
    header.geometry.spacing = {1, 1.2, 0.9};
    Volume volume(header);
    View<T> const view = volume.mutable_view().as<T>();
#pragma omp parallel for
    for (std::int64_t z = 0; z < n.z; ++z)
        for (std::int64_t y = 0; y < n.y; ++y)
            for (std::int64_t x = 0; x < n.x; ++x) {
                auto const along = [](std::int64_t i, std::int64_t of) {
                    return 2 * (static_cast<double>(i) + 0.5) / static_cast<double>(of) - 1;
                };
                double const u = along(x, n.x), v = along(y, n.y), w = along(z, n.z);
                double const r = std::sqrt(u * u + v * v + w * w);
                double const value = std::max(0.0, (1 - r) * (0.7 + 0.3 * std::cos(20 * r) * std::sin(9 * u)));
                bool const missing = std::is_floating_point_v<T> && x + y + z < 12;
                view(x, y, z) = missing ? static_cast<T>(NAN) : static_cast<T>(value * (sizeof(T) == 1 ? 250 : 30000));
            }
    return volume;
}

double largest_difference(render::Image const& a, render::Image const& b, double& share) {
    double most = 0;
    std::size_t apart = 0;
    for (std::size_t i = 0; i < a.pixels.size(); ++i) {
        double const d = std::abs(static_cast<double>(a.pixels[i]) - static_cast<double>(b.pixels[i]));
        most = std::max(most, d);
        apart += d > 1e-3 ? 1 : 0;
    }
    share = static_cast<double>(apart) / static_cast<double>(a.pixels.size());
    return most;
}

struct Case {
    char const* name;
    render::RenderSettings settings;
};
std::vector<Case> cases() {
    std::vector<Case> all;
    auto const add = [&](char const* name, Algorithm algorithm) -> render::RenderSettings& {
        all.push_back({name, {}});
        render::RenderSettings& s = all.back().settings;
        s.width = 211;
        s.height = 160;
        s.algorithm = algorithm;
        return s;
    };
    add("march", Algorithm::ray_marching);
    add("march, without skipping", Algorithm::ray_marching).skip = false;
    auto& flat = add("march, whole steps without shading", Algorithm::ray_marching);
    flat.step = 1, flat.shade = 0;
    add("march, lit by a lamp", Algorithm::ray_marching).light_direction = Vec3{1, -1, 1};
    add("march, exact", Algorithm::ray_marching).exact = true;
    add("iso", Algorithm::implicit_iso);
    auto& layers = add("iso, transparent layers", Algorithm::implicit_iso);
    layers.isos = {60, 90, 120};
    layers.iso_opacities = {0.4, 0.5, 1};
    add("maximum", Algorithm::maximum);
    add("minimum", Algorithm::minimum);
    add("mean", Algorithm::mean);
    add("scattering", Algorithm::multi_scattering).samples = 20;
    return all;
}

template <class T> void compare(DataType type) {
    Volume const volume = waves<T>(type, {61, 53, 47});
    render::Renderer const cpu(volume, on(Device::cpu)), gpu(volume, on(Device::gpu));
    for (Case const& c : cases()) {
        render::RenderReport there, here;
        render::Image const a = cpu.render(c.settings, &here), b = gpu.render(c.settings, &there);
        double share = 0;
        double const most = largest_difference(a, b, share);
        // Logarithms of free paths may differ in the last bit, and with them whole paths.
        bool const paths = c.settings.algorithm == Algorithm::multi_scattering;
        bool const ok = paths ? share < 0.02 : most < 2e-4;
        bool const rays = here.segments == there.segments && (paths || here.rays == there.rays) &&
                          there.gpu_seconds > 0 && here.gpu_seconds == 0;
        std::printf("%s %s, %s: largest difference %.2g, %.2g of the pixels by more than 0.001\n",
                    ok && rays ? "ok" : "FAILED", c.name, std::string(name_of(type)).c_str(), most, share);
        failures += ok && rays ? 0 : 1;
    }
}

template <class T> void time_frames(char const* name, DataType type, std::int64_t n) {
    Volume const volume = waves<T>(type, {n, n, n});
    for (Device const device : {Device::gpu, Device::cpu}) {
        render::Renderer const renderer(volume, on(device));
        for (Case c : cases()) {
            c.settings.width = c.settings.height = 1024;
            c.settings.samples = 8;
            double best = 1e9, drawing = 1e9;
            for (int run = 0; run < (device == Device::gpu ? 6 : 2); ++run) {
                render::RenderReport report;
                auto const begin = std::chrono::steady_clock::now();
                (void)renderer.render(c.settings, &report);
                best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
                drawing = std::min(drawing, report.gpu_seconds);
            }
            std::printf("%s %lld^3, %s, %s: %.2f ms", name, static_cast<long long>(n), c.name,
                        device == Device::gpu ? "GPU" : "CPU", best * 1e3);
            if (device == Device::gpu) std::printf(", %.2f of them drawing", drawing * 1e3);
            std::puts("");
        }
    }
}

} // namespace

int main(int argc, char** argv) {
    if (!built_with_cuda() || gpu_count() == 0) {
        std::puts("skipped: no CUDA device");
        return skipped;
    }
    compare<std::uint8_t>(DataType::uint8);
    compare<std::uint16_t>(DataType::uint16);
    compare<std::int16_t>(DataType::int16);
    compare<float>(DataType::float32);
    std::printf("%d failed\n", failures);
    bool const timed = argc < 2 || std::string_view(argv[1]) != "--no-timing";
    if (timed) time_frames<std::uint8_t>("uint8", DataType::uint8, 512);
    if (timed) time_frames<float>("float32", DataType::float32, 512);
    return failures == 0 ? 0 : 1;
}
