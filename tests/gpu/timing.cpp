// Times on a GPU: cubes of 256^3 to 1024^3 voxels, the best of some runs.
// SPDX-License-Identifier: MIT
#include "tests/gpu/timing.h"

#include "libvkt/core/buffer.h"
#include "libvkt/core/text.h"
#include "libvkt/kernel/border.h"
#include "libvkt/operations/filter/gaussian.h"
#include "libvkt/operations/resample/resample.h"
#include "libvkt/operations/statistics/grouped_statistics.h"
#include "libvkt/operations/statistics/histogram.h"
#include "libvkt/operations/statistics/statistics.h"
#include "libvkt/operations/voxels/crop.h"
#include "libvkt/operations/voxels/fill.h"
#include "libvkt/operations/voxels/flip.h"
#include "tests/gpu/twins.h"

#include <chrono>
#include <cstdio>
#include <cstring>
#include <functional>
#include <random>

namespace vkt::gpu_test {
namespace {

double milliseconds(std::function<void()> const& run) {
    device_synchronize();
    auto const begin = std::chrono::steady_clock::now();
    run();
    device_synchronize();
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

/// The best of some: what is planned before the voxels are asked for, once for all of a volume, stands by itself.
struct Milliseconds {
    double planned = 1e30, run = 1e30;
};
Milliseconds best_ms(std::function<void()> const& plan, std::function<void()> const& run) {
    Milliseconds best;
    for (int i = 0; i < 8; ++i) {
        double const planned = milliseconds(plan), ran = milliseconds(run);
        if (i > 0) best = {std::min(best.planned, planned), std::min(best.run, ran)};
    }
    return best;
}

/// An operation as on the command line, on a cube of zeros and what lies around it.
template <class Line> void time_words(std::vector<std::string> words, DataType type, std::int64_t n, Line const& line) {
    std::string what;
    for (std::string const& word : words) what += (what.empty() ? "" : " ") + word;
    if (!is_wanted(what)) return;
    auto const operation = operation_of(std::move(words));
    Header header;
    header.dims = {n, n, n};
    header.dtype = type;
    Header const output = begun(*operation, std::vector<Header>{header}).output;
    Box const box = box_of(output.dims), need = operation->footprint(box, 0);
    Execution const execution = gpu();
    Buffer in_memory(static_cast<std::size_t>(need.voxels()) * size_of(type)), out_memory(output.bytes());
    device_clear(in_memory.write(Space::device), in_memory.bytes());
    ConstView const in = dense_view(in_memory.read(Space::device), type, need, Space::device);
    AnyView const out = dense_view(out_memory.write(Space::device), output.dtype, box, Space::device);
    Milliseconds const ms = best_ms(
        [&] {
            (void)begun(*operation, std::vector<Header>{header}); // forgets what is kept
            operation->fit(output.dims, execution);
        },
        [&] {
            operation->run({&in, 1}, out, execution);
        });
    line(what, ms, static_cast<double>(in.bytes()) + static_cast<double>(out.bytes()));
}

/// A reduction of a cube of 200 values in no order, or of one.
template <class Line>
void time_scan(Operation& reduction, std::string const& what, DataType type, std::int64_t n, Line const& line) {
    if (!is_wanted(what)) return;
    Header header;
    header.dims = {n, n, n};
    header.dtype = type;
    Buffer memory(header.bytes());
    for (bool const constant : {false, true}) {
        std::vector<std::byte> part(std::size_t{1} << 22);
        std::mt19937 random(1);
        for (std::size_t at = 0; at < part.size(); at += size_of(type)) {
            VoxelBytes const voxel = voxel_bytes(type, constant ? 7.0 : 1.0 + static_cast<double>(random() % 200));
            std::memcpy(part.data() + at, voxel.data(), size_of(type));
        }
        std::byte* const to = memory.write(Space::device);
        for (std::size_t at = 0; at < header.bytes(); at += part.size())
            copy_to_device(to + at, part.data(), std::min(part.size(), header.bytes() - at));
        ConstView const in = dense_view(static_cast<std::byte const*>(to), type, box_of(header.dims), Space::device);
        Milliseconds const ms = best_ms([&] { (void)begun(reduction, std::vector<Header>{header}); },
                                        [&] {
                                            do {
                                                reduction.scan(in, gpu());
                                                reduction.scan_end();
                                            } while (reduction.scans_again());
                                        });
        line(what + (constant ? ", constant" : ""), ms, static_cast<double>(header.bytes()));
    }
}

/// Blobs: noise on a lattice, linear in between, above what leaves about this share.
void fill_blobs(std::vector<std::uint8_t>& voxels, std::int64_t n, std::int64_t cell, double level) {
    auto const at = [](std::int64_t x, std::int64_t y, std::int64_t z) {
        auto h = static_cast<std::uint64_t>(x * 73856093 ^ y * 19349663 ^ z * 83492791);
        h = (h ^ h >> 31) * 0x9e3779b97f4a7c15u;
        return static_cast<double>(h >> 40) * 0x1p-24;
    };
#pragma omp parallel for
    for (std::int64_t z = 0; z < n; ++z)
        for (std::int64_t y = 0; y < n; ++y)
            for (std::int64_t x = 0; x < n; ++x) {
                std::int64_t const i = x / cell, j = y / cell, k = z / cell;
                auto const of = [cell](std::int64_t a, std::int64_t b) {
                    return static_cast<double>(a - b * cell) / static_cast<double>(cell);
                };
                double const u = of(x, i), v = of(y, j), w = of(z, k);
                double sum = 0;
                for (int c = 0; c < 8; ++c)
                    sum += at(i + c % 2, j + c / 2 % 2, k + c / 4) * (c % 2 != 0 ? u : 1 - u) *
                           (c / 2 % 2 != 0 ? v : 1 - v) * (c / 4 != 0 ? w : 1 - w);
                voxels[static_cast<std::size_t>((z * n + y) * n + x)] = sum > level ? 1 : 0;
            }
}

/// What takes as long as its input is shaped.
template <class Line> void time_shapes(std::int64_t n, Line const& line) {
    Header header;
    header.dims = {n, n, n};
    header.dtype = DataType::uint8;
    std::vector<std::uint8_t> voxels(header.bytes());
    Buffer in_memory(header.bytes()), out_memory(4 * header.bytes());
    auto const fill = [&](std::string const& what) {
        auto const set = [&](auto const& inside) {
#pragma omp parallel for
            for (std::int64_t i = 0; i < n * n * n; ++i) {
                auto h = static_cast<std::uint64_t>(i) * 0x9e3779b97f4a7c15u;
                h = (h ^ h >> 29) * 0xbf58476d1ce4e5b9u;
                double const random = static_cast<double>((h ^ h >> 32) >> 11) * 0x1p-53;
                voxels[static_cast<std::size_t>(i)] = inside(i % n, i / n % n, i / n / n, random) ? 1 : 0;
            }
        };
        using I = std::int64_t;
        if (what == "blobs") fill_blobs(voxels, n, 12, 0.6);
        if (what == "many blobs") fill_blobs(voxels, n, 6, 0.5);
        if (what == "30 % noise") set([](I, I, I, double r) { return r < 0.3; });
        if (what == "50 % noise") set([](I, I, I, double r) { return r < 0.5; });
        if (what == "checkerboard") set([](I x, I y, I z, double) { return (x + y + z) % 2 == 0; });
        if (what == "comb") set([n](I x, I y, I z, double) { return x % 2 == 0 || (y == n - 1 && z == n - 1); });
        if (what == "all but one") set([](I x, I y, I z, double) { return x + y + z > 0; });
        if (what == "all but the middle")
            set([n](I x, I y, I z, double) { return x != n / 2 || y != n / 2 || z != n / 2; });
        if (what == "ball")
            set([n](I x, I y, I z, double) {
                I const h = n / 2;
                return (x - h) * (x - h) + (y - h) * (y - h) + (z - h) * (z - h) < h * h;
            });
        if (what == "20 sites") set([n](I, I, I, double r) { return r > 20.0 / static_cast<double>(n * n * n); });
        copy_to_device(in_memory.write(Space::device), voxels.data(), voxels.size());
    };
    auto const time = [&](std::string const& words, std::string const& what) {
        if (!is_wanted(words)) return;
        auto const operation = operation_of(words_of(words));
        Header const output = begun(*operation, std::vector<Header>{header}).output;
        ConstView const in =
            dense_view(in_memory.read(Space::device), header.dtype, box_of(header.dims), Space::device);
        AnyView const out =
            dense_view(out_memory.write(Space::device), output.dtype, box_of(output.dims), Space::device);
        bool scans = false;
        Milliseconds const ms = best_ms([&] { scans = begun(*operation, std::vector<Header>{header}).scans; },
                                        [&] {
                                            if (scans) scan(*operation, in, 0, gpu());
                                            operation->run({&in, 1}, out, gpu());
                                        });
        line(words + ", " + what, ms, static_cast<double>(in.bytes() + out.bytes()));
    };
    for (char const* const what : {"blobs", "many blobs", "30 % noise", "50 % noise", "checkerboard", "comb",
                                   "all but one", "all but the middle", "ball", "20 sites"}) {
        fill(what);
        if (std::strstr(what, "all") == nullptr && std::strcmp(what, "20 sites") != 0)
            for (char const* const words : {"label", "label --connectivity 18", "label --connectivity 26",
                                            "label --by-value", "label --by-value --connectivity 26"})
                time(words, what);
        time("distance", what);
    }
    time("distance --signed", "20 sites");
}

/// What is timed at 256^3, of noise.
template <class Line> void time_small(DataType type, Line const& line) {
    Header header;
    header.dims = {256, 256, 256};
    header.dtype = type;
    Twin noise(type, box_of(header.dims), 0);
    Buffer out_memory(header.bytes());
    bool filled = false;
    for (char const* const words : {"clahe", "filter nlmeans --strength 9 --search 3"}) {
        if (!is_wanted(words)) continue;
        if (!filled) randomise(noise, 5);
        filled = true;
        auto const operation = operation_of(words_of(words));
        Header const output = begun(*operation, std::vector<Header>{header}).output;
        Box const box = box_of(output.dims), need = operation->footprint(box, 0);
        Twin around(type, need, 0);
        fill_border(around.view(Space::device), box_of(header.dims), header.dims, Boundary::clamp, 0, gpu());
        ConstView const in = ConstView(noise.view(Space::device));
        ConstView const grown = need == box_of(header.dims) ? in : ConstView(around.view(Space::device));
        AnyView const out = dense_view(out_memory.write(Space::device), output.dtype, box, Space::device);
        bool scans = false;
        Milliseconds const ms = best_ms([&] { scans = begun(*operation, std::vector<Header>{header}).scans; },
                                        [&] {
                                            if (scans) scan(*operation, in, 0, gpu());
                                            operation->fit(output.dims, gpu());
                                            operation->run({&grown, 1}, out, gpu());
                                        });
        line(std::string(words) + " 256^3", ms, static_cast<double>(in.bytes() + out.bytes()));
    }
}

} // namespace

void time_all() {
    if (std::FILE* const cube = std::fopen("cube.txt", "w")) {
        std::fputs("3 3 3", cube);
        for (int i = 0; i < 27; ++i) std::fprintf(cube, " %d", i * i % 11);
        std::fclose(cube);
    }
    std::printf("\n%-44s %8s %10s %10s %8s %8s\n", "operation", "type", "planned", "ms", "TB/s", "of copy");
    for (DataType const type : {DataType::uint8, DataType::float32})
        time_small(type, [type](std::string const& what, Milliseconds const& ms, double moved) {
            std::printf("%-44s %8s %10.3f %10.3f %8.2f\n", what.c_str(), std::string(name_of(type)).c_str(), ms.planned,
                        ms.run, moved / ms.run * 1e-9);
        });
    for (std::int64_t n : {512, 1024})
        for (DataType type : {DataType::float32, DataType::uint16, DataType::uint8}) {
            Header header;
            header.dims = {n, n, n};
            header.dtype = type;
            std::size_t const bytes = header.bytes();
            std::byte* const from = device_allocate(bytes);
            std::byte* const to = device_allocate(bytes);
            device_clear(from, bytes);
            Milliseconds const copied = best_ms([] {}, [&] { copy_on_device(to, from, bytes); });
            auto line = [&](std::string const& what, Milliseconds const& ms, double moved) {
                std::printf("%-44s %8s %10.3f %10.3f %8.2f %8.2f\n", (what + " " + to_text(n) + "^3").c_str(),
                            std::string(name_of(type)).c_str(), ms.planned, ms.run, moved / ms.run * 1e-9,
                            moved / ms.run / (2 * static_cast<double>(bytes) / copied.run));
            };
            line("copy", copied, 2 * static_cast<double>(bytes));
            auto time = [&](Operation& operation, std::string const& what) {
                if (!is_wanted(what)) return;
                Header const output = begun(operation, std::vector<Header>{header}).output;
                Box const box = box_of(output.dims), need = operation.footprint(box, 0);
                ConstView const in = ConstView(dense_view(from, type, box_of(header.dims), Space::device)).part(need);
                AnyView const out = dense_view(to, output.dtype, box, Space::device);
                Execution const execution = gpu();
                Milliseconds const ms = best_ms(
                    [&] {
                        (void)begun(operation, std::vector<Header>{header}); // forgets kept planes
                        operation.fit(output.dims, execution);
                    },
                    [&] {
                        operation.run({&in, 1}, out, execution);
                    });
                double const read = what == "fill" ? 0 : static_cast<double>(in.bytes());
                line(what, ms, read + static_cast<double>(out.bytes()));
            };
            Fill fill(1);
            time(fill, "fill");
            Flip x(Axis::x), y(Axis::y), z(Axis::z);
            time(x, "flip x");
            time(y, "flip y");
            time(z, "flip z");
            Crop crop(Roi{"1:-2,1:,1:"});
            time(crop, "crop, off alignment");
            Crop half(Roi{"25%:75%,25%:75%,25%:75%"});
            time(half, "crop to the middle");
            Gaussian gaussian({2, 2, 2});
            time(gaussian, "gaussian sigma 2");
            Resample resample;
            resample.dims = Index3{n / 2, n / 2, n / 2};
            time(resample, "resample to half");
            for (std::vector<std::string> words :
                 {words_of("permute zyx"), words_of("permute yxz"), words_of("permute xzy"),
                  words_of("pad --by 8:8,8:8,8:8 --boundary mirror"), words_of("rotate --axis z --angle 20"),
                  words_of("rotate --axis 1,2,3 --angle 20"), words_of("rotate --axis 1,2,3 --angle 20 --method cubic"),
                  words_of("filter kernel cube.txt"), words_of("filter sobel"), words_of("filter box --radius 2"),
                  words_of("filter box --radius 32"), words_of("filter median --radius 1"),
                  words_of("filter gaussian --sigma 8"), words_of("morphology erode --radius 2 --shape box"),
                  words_of("morphology erode --radius 32 --shape box"), words_of("threshold --above 1"),
                  words_of("arith add - 3"), words_of("convert --dtype uint8")})
                time_words(std::move(words), type, n, line);
            Statistics statistics;
            time_scan(statistics, "stats", type, n, line);
            for (GroupedBy const by : {GroupedBy::x, GroupedBy::y, GroupedBy::z}) {
                GroupedStatistics slices;
                slices.by = by;
                char const* const names[] = {"x", "y", "z"};
                time_scan(slices,
                          std::string("stats --per ") + names[static_cast<int>(by) - static_cast<int>(GroupedBy::x)],
                          type, n, line);
            }
            Histogram histogram;
            time_scan(histogram, "histogram", type, n, line);
            auto const known = operation_of(words_of("histogram --range 0:256"));
            time_scan(*known, "histogram --range 0:256", type, n, line);
            for (char const* const words :
                 {"project max --axis z", "project max --axis y", "project max --axis x", "project mean --axis z",
                  "project mean --axis x", "project std --axis z", "project std --axis x"}) {
                auto const project = operation_of(words_of(words));
                time_scan(*project, words, type, n, line);
            }
            for (char const* const words : {"project median --axis z", "project median --axis x", "scan"})
                time_words(words_of(words), type, n, line);
            auto const percentiles = operation_of(words_of("histogram --range p1:p99"));
            time_scan(*percentiles, "histogram --range p1:p99", type, n, line);
            if (n == 512 && type == DataType::uint8) time_shapes(n, line);
            device_free(from);
            device_free(to);
        }
}

} // namespace vkt::gpu_test
