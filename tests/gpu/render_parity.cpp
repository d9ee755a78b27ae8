// Pictures of grids, trees and labels drawn on a GPU against the CPU's, for all integrators and types that rays sample;
// then frames of 1024 x 1024.
// SPDX-License-Identifier: MIT
#include "libvkt/core/device.h"
#include "libvkt/core/volume.h"
#include "libvkt/render/render.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

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

/// Waves in a ball within [-1, 1]^3, from 0 to 1.
double wave(double u, double v, double w) {
    double const r = std::sqrt(u * u + v * v + w * w);
    return std::max(0.0, (1 - r) * (0.7 + 0.3 * std::cos(20 * r) * std::sin(9 * u)));
}
double along(double place, std::int64_t extent) { return 2 * place / static_cast<double>(extent) - 1; }
template <class T> T stored(double value) { return static_cast<T>(value * (sizeof(T) == 1 ? 250 : 30000)); }

/// Over the range of the type, and NaN in a corner of floats.
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
                auto const middle = [](std::int64_t i) { return static_cast<double>(i) + 0.5; };
                bool const missing = std::is_floating_point_v<T> && x + y + z < 12;
                view(x, y, z) =
                    missing ? static_cast<T>(NAN)
                            : stored<T>(wave(along(middle(x), n.x), along(middle(y), n.y), along(middle(z), n.z)));
            }
    return volume;
}

enum class Holes : std::uint8_t { none, some };

/// The same in cubes of `edge` cells of one of three levels: fine in a shell, and, with holes, not everywhere.
template <class T> Volume tree_of_waves(DataType type, Index3 n, std::int64_t edge, Holes holes) {
    Header header;
    header.kind = Kind::hierarchical;
    header.dims = n;
    header.dtype = type;
    header.geometry.spacing = {1, 1.2, 0.9};
    std::vector<Brick> bricks;
    auto const add = [&](auto const& self, Index3 lower, int level) -> void {
        std::int64_t const size = edge << level;
        bool outside = false;
        double from = 0; // of the middle from that of the ball
        for (int a = 0; a < 3; ++a) {
            outside = outside || lower[a] >= n[a];
            double const place = along(static_cast<double>(lower[a]) + 0.5 * static_cast<double>(size), n[a]);
            from += place * place;
        }
        if (outside) return;
        double const near = std::abs(std::sqrt(from) - 0.6);
        if (level > 0 && near < (level == 2 ? 0.45 : 0.15)) {
            for (int i = 0; i < 8; ++i) {
                Index3 child = lower;
                for (int a = 0; a < 3; ++a) child[a] += (i >> a & 1) * (size / 2);
                self(self, child, level - 1);
            }
            return;
        }
        bool const left_out = holes == Holes::some && (lower.x + 2 * lower.y + 3 * lower.z) / edge % 7 == 4;
        if (!left_out) bricks.push_back({lower, {edge, edge, edge}, level});
    };
    for (std::int64_t z = 0; z < n.z; z += 4 * edge)
        for (std::int64_t y = 0; y < n.y; y += 4 * edge)
            for (std::int64_t x = 0; x < n.x; x += 4 * edge) add(add, {x, y, z}, 2);
    Volume volume(header, std::move(bricks));
    auto* const cells = reinterpret_cast<T*>(volume.buffer().write(Space::host));
    auto const count = static_cast<std::int64_t>(volume.bricks().size());
#pragma omp parallel for
    for (std::int64_t b = 0; b < count; ++b) {
        Brick const& brick = volume.bricks()[static_cast<std::size_t>(b)];
        T* cell = cells + volume.brick_offset(static_cast<std::size_t>(b));
        auto const width = static_cast<double>(std::int64_t{1} << brick.level);
        auto const place = [&](std::int64_t i, int a) {
            return along(static_cast<double>(brick.lower[a]) + (static_cast<double>(i) + 0.5) * width, n[a]);
        };
        for (std::int64_t z = 0; z < brick.dims.z; ++z)
            for (std::int64_t y = 0; y < brick.dims.y; ++y)
                for (std::int64_t x = 0; x < brick.dims.x; ++x) {
                    bool const missing = std::is_floating_point_v<T> && b % 50 == 7 && x + y + z < 6;
                    *cell++ = missing ? static_cast<T>(NAN) : stored<T>(wave(place(x, 0), place(y, 1), place(z, 2)));
                }
    }
    return volume;
}

/// Shells of seven labels around each other.
Volume shells(Index3 n) {
    Volume const some = waves<std::uint8_t>(DataType::uint8, n);
    Volume labels(some.header());
    View<std::uint8_t const> const from = some.view().as<std::uint8_t>();
    View<std::uint8_t> const to = labels.mutable_view().as<std::uint8_t>();
    for (std::int64_t z = 0; z < n.z; ++z)
        for (std::int64_t y = 0; y < n.y; ++y)
            for (std::int64_t x = 0; x < n.x; ++x)
                to(x, y, z) = static_cast<std::uint8_t>(x > n.x / 2 && y > n.y / 2 ? 0 : from(x, y, z) / 32);
    return labels;
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
        s.edge_rays = 1;
        return s;
    };
    add("march", Algorithm::ray_marching);
    add("march, without skipping", Algorithm::ray_marching).skip = false;
    auto& flat = add("march, whole steps without shading", Algorithm::ray_marching);
    flat.step = 1, flat.shade = 0;
    add("march, lit by a lamp", Algorithm::ray_marching).light_direction = Vec3{1, -1, 1};
    auto& shadowed = add("march, in shadows", Algorithm::ray_marching);
    shadowed.light_direction = Vec3{1, -1, 1}, shadowed.shadows = true, shadowed.ambient_occlusion = 6;
    add("march, exact", Algorithm::ray_marching).exact = true;
    add("iso", Algorithm::implicit_iso);
    auto& layers = add("iso, transparent layers", Algorithm::implicit_iso);
    layers.isos = {60, 90, 120};
    layers.iso_opacities = {0.4, 0.5, 1};
    auto& lit = add("iso, in shadows", Algorithm::implicit_iso);
    lit.light_direction = Vec3{1, -1, 1}, lit.shadows = true;
    add("iso, smooth edges", Algorithm::implicit_iso).edge_rays = 4;
    add("maximum", Algorithm::maximum);
    add("minimum", Algorithm::minimum);
    add("mean", Algorithm::mean);
    add("scattering", Algorithm::multi_scattering).samples = 20;
    return all;
}

void say(bool ok, char const* what, std::string const& of, double most, double share) {
    std::printf("%s %s, %s: largest difference %.2g, %.2g of the pixels by more than 0.001\n", ok ? "ok" : "FAILED",
                what, of.c_str(), most, share);
    failures += ok ? 0 : 1;
}

void compare(Volume const& volume, render::TreeDrawing tree, std::string const& of) {
    render::Renderer const cpu(volume, on(Device::cpu), tree), gpu(volume, on(Device::gpu), tree);
    bool const bricks = volume.header().kind == Kind::hierarchical;
    for (Case c : cases()) {
        c.settings.tree = tree;
        render::RenderReport there, here;
        render::Image const a = cpu.render(c.settings, &here), b = gpu.render(c.settings, &there);
        double share = 0;
        double const most = largest_difference(a, b, share);
        bool const paths = c.settings.algorithm == Algorithm::multi_scattering;
        bool const surfaces = c.settings.algorithm == Algorithm::implicit_iso,
                   smooth = surfaces && c.settings.edge_rays > 1;
        // Logarithms of free paths may differ in the last bit, and with them whole paths. Places where a ray through a
        // tree bends are worked out in two ways: rays along the rim of a surface may meet it or pass it. What is nearly
        // an edge may be one on one side only.
        bool const ok = paths ? share < 0.02 : surfaces && (bricks || smooth) ? share < 5e-4 : most < 2e-4;
        // Of trees those behind what is opaque are counted by batches.
        bool const segments =
            bricks ? there.segments <= here.segments + here.segments / 1000 && 2 * there.segments >= here.segments
                   : here.segments == there.segments;
        bool const rays =
            (paths || smooth || here.rays == there.rays) && there.gpu_seconds > 0 && here.gpu_seconds == 0;
        say(ok && (segments || smooth) && rays, c.name, of, most, share);
        if (!segments || !rays)
            std::printf("    segments %lld and %lld, rays %lld and %lld\n", static_cast<long long>(here.segments),
                        static_cast<long long>(there.segments), static_cast<long long>(here.rays),
                        static_cast<long long>(there.rays));
    }
}

template <class T> void compare(DataType type) {
    std::string const name(name_of(type));
    Index3 const n{64, 96, 32};
    compare(waves<T>(type, {61, 53, 47}), render::TreeDrawing::automatic, name);
    compare(tree_of_waves<T>(type, n, 8, Holes::none), render::TreeDrawing::blocks, name + ", tree by blocks");
    compare(tree_of_waves<T>(type, n, 8, Holes::none), render::TreeDrawing::bricks, name + ", tree by bricks");
    compare(tree_of_waves<T>(type, n, 4, Holes::some), render::TreeDrawing::bricks, name + ", tree with holes");
}

void compare_labels() {
    Volume const volume = shells({61, 53, 47});
    render::Renderer const cpu(volume, on(Device::cpu)), gpu(volume, on(Device::gpu));
    for (bool const lamp : {false, true}) {
        render::RenderSettings s;
        s.width = 211, s.height = 160;
        s.labels = render::LabelMode::always;
        s.ambient_occlusion = lamp ? 6 : 0;
        s.shadows = lamp;
        if (lamp) s.light_direction = Vec3{1, -1, 1};
        render::RenderReport there, here;
        render::Image const a = cpu.render(s, &here), b = gpu.render(s, &there);
        double share = 0;
        double const most = largest_difference(a, b, share);
        say(most < 2e-4 && here.samples == there.samples && there.gpu_seconds > 0, lamp ? "labels, lit" : "labels",
            "uint8", most, share);
    }
}

void time_frames(char const* name, Volume const& volume, render::TreeDrawing tree) {
    bool const bricks = volume.header().kind == Kind::hierarchical;
    for (Device const device : {Device::gpu, Device::cpu}) {
        render::Renderer const renderer(volume, on(device), tree);
        for (Case c : cases()) {
            // On CPUs trees take long; their marches tell how much faster a GPU is.
            if (bricks && device == Device::cpu &&
                (c.settings.algorithm != Algorithm::ray_marching || c.settings.exact))
                continue;
            c.settings.tree = tree;
            c.settings.width = c.settings.height = 1024;
            c.settings.samples = 8;
            double best = 1e9, drawing = 1e9;
            for (int run = 0; run < (device == Device::gpu ? 6 : 2); ++run) {
                render::RenderReport report;
                auto const begin = std::chrono::steady_clock::now();
                (void)renderer.render(c.settings, &report);
                double const took = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
                best = std::min(best, took);
                drawing = std::min(drawing, report.gpu_seconds);
                if (took > 3) break;
            }
            std::printf("%s, %s, %s: %.2f ms", name, c.name, device == Device::gpu ? "GPU" : "CPU", best * 1e3);
            if (device == Device::gpu) std::printf(", %.2f of them drawing", drawing * 1e3);
            std::puts("");
        }
    }
}

template <class T> void time_trees(std::string const& type, DataType of) {
    constexpr std::int64_t n = 512;
    Volume const tree = tree_of_waves<T>(of, {n, n, n}, 16, Holes::none);
    std::printf("%s tree of %lld cells in %zu bricks\n", type.c_str(), static_cast<long long>(tree.header().cell_count),
                tree.bricks().size());
    time_frames((type + " tree by blocks").c_str(), tree, render::TreeDrawing::blocks);
    time_frames((type + " tree by bricks").c_str(), tree, render::TreeDrawing::bricks);
}

} // namespace

int main(int argc, char** argv) {
    if (!built_with_cuda() || gpu_count() == 0) {
        std::puts("skipped: no CUDA device");
        return skipped;
    }
    std::string_view const asked = argc < 2 ? "" : argv[1];
    if (asked != "--trees") { // of which only frames are wanted
        compare<std::uint8_t>(DataType::uint8);
        compare<std::uint16_t>(DataType::uint16);
        compare<std::int16_t>(DataType::int16);
        compare<float>(DataType::float32);
        compare_labels();
        std::printf("%d failed\n", failures);
    }
    if (asked != "--no-timing" && asked != "--trees") {
        time_frames("uint8 512^3", waves<std::uint8_t>(DataType::uint8, {512, 512, 512}),
                    render::TreeDrawing::automatic);
        time_frames("float32 512^3", waves<float>(DataType::float32, {512, 512, 512}), render::TreeDrawing::automatic);
    }
    if (asked != "--no-timing") {
        time_trees<std::uint8_t>("uint8", DataType::uint8);
        time_trees<float>("float32", DataType::float32);
    }
    return failures == 0 ? 0 : 1;
}
