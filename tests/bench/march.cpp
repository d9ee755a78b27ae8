// Frames of ray marching with the volume loaded: processor seconds, samples, and how far they are from all rays and
// steps.
// SPDX-License-Identifier: MIT
//
//   vkt_march_bench FILE N uint8|float32 fog|dense|VALUE SHADE STEP THREADS RUNS   raw voxels, N^3; the scene is
//   march.py's, or the surface of a value, as a share of the type's range
#include "libvkt/core/text.h"
#include "libvkt/render/colormap.h"
#include "libvkt/render/render.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>

namespace {

using namespace vkt;
using namespace vkt::render;

constexpr int size = 512;

Volume read_volume(char const* path, std::int64_t n, DataType type) {
    Header header;
    header.dims = {n, n, n};
    header.dtype = type;
    Volume volume(header);
    std::ifstream file(path, std::ios::binary);
    file.read(reinterpret_cast<char*>(volume.mutable_view().data), static_cast<std::streamsize>(header.bytes()));
    if (!file) throw Error(ErrorKind::io, text("cannot read ", path));
    return volume;
}

RenderSettings settings_of(std::int64_t n, DataType type, bool dense, double shade, double step) {
    double const top = type == DataType::uint8 ? 255 : 1, extent = static_cast<double>(n), middle = (extent - 1) / 2;
    RenderSettings s;
    s.width = s.height = size;
    s.step = step;
    s.shade = shade;
    TransferFunction transfer;
    transfer.unit = 1;
    for (int i = 0; i < 256; ++i) {
        double const x = i / 255.0, fog = 5.12 / extent * x, solid = x < 0.3 ? 0 : 0.5 * (x - 0.3) / 0.7;
        Color const color = dense ? Color{0.2 + 0.8 * x, std::abs(2 * x - 1), 1 - 0.7 * x} : Color{1, 1, 1};
        transfer.points.push_back({x * top, color, -std::expm1(-(dense ? solid : fog))});
    }
    s.transfer = transfer;
    s.camera.eye = Vec3{1.1 * extent + middle, -2 * extent + middle, 0.8 * extent + middle};
    s.camera.target = Vec3{middle, middle, middle};
    s.camera.up = Vec3{0, 0, 1};
    s.background.color = {0, 0, 0};
    return s;
}

double greatest_difference(Image const& a, Image const& b) {
    auto const level = [](float v) { return 255 * linear_to_srgb(std::min(1.0, static_cast<double>(v))); };
    double greatest = 0;
    for (std::size_t i = 0; i < a.pixels.size(); ++i)
        if (i % 4 < 3) greatest = std::max(greatest, std::abs(level(a.pixels[i]) - level(b.pixels[i])));
    return greatest;
}

} // namespace

int main(int count, char** words) {
    if (count != 9) return 2;
    std::int64_t const n = std::atoll(words[2]);
    DataType const type = std::string(words[3]) == "uint8" ? DataType::uint8 : DataType::float32;
    Execution execution = default_execution();
    execution.threads = std::atoi(words[7]);
    Renderer const renderer(read_volume(words[1], n, type), execution);
    RenderSettings s = settings_of(n, type, std::string(words[4]) == "dense", std::atof(words[5]), std::atof(words[6]));
    if (std::atof(words[4]) > 0) {
        s.algorithm = Algorithm::implicit_iso;
        s.isos = {std::atof(words[4]) * (type == DataType::uint8 ? 255 : 1)};
        s.transfer.reset();
    }
    struct Result {
        Image image;
        RenderReport report;
        double seconds = 1e9, processor = 1e9;
    };
    auto const draw = [&](double shortcut) {
        Result result;
        s.shortcut = shortcut;
        for (int run = 0; run <= std::atoi(words[8]); ++run) {
            auto const begin = std::chrono::steady_clock::now();
            std::clock_t const clock = std::clock();
            result.image = renderer.render(s, &result.report);
            double const processor = static_cast<double>(std::clock() - clock) / CLOCKS_PER_SEC;
            double const seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
            if (run == 0) continue; // it warms
            result.seconds = std::min(result.seconds, seconds);
            result.processor = std::min(result.processor, processor);
        }
        return result;
    };
    Result const all = draw(0), few = draw(0.5);
    s.skip = false;
    Image const plain = renderer.render(s);
    std::printf("%.4f %.4f %.1f %.4f %.4f %.1f %.3f %.3f\n", all.processor, all.seconds,
                1e-6 * static_cast<double>(all.report.samples), few.processor, few.seconds,
                1e-6 * static_cast<double>(few.report.samples), greatest_difference(few.image, all.image),
                greatest_difference(all.image, plain));
}
