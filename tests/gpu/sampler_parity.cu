// Point sampling of hierarchical volumes on a GPU against the CPU: values and gradients, inside levels, where they
// meet, on corners and in holes; then samples a second of each.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/make_amr.h"
#include "libvkt/amr/sampler.h"
#include "libvkt/amr/tree.h"
#include "libvkt/core/device.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <random>
#include <string_view>
#include <vector>

namespace {

using namespace vkt;

constexpr int skipped = 77; ///< exit code by which CTest knows

struct Point {
    double x, y, z;
};

__global__ void sample_points(SamplerView<float> view, Point const* points, int n, TreeGradientSample* samples) {
    int const i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
    if (i < n) samples[i] = sample_gradient(view, points[i].x, points[i].y, points[i].z);
}

/// A copy of host memory on the device.
template <class T> class OnDevice {
public:
    OnDevice(T const* host, std::size_t count) : data_(reinterpret_cast<T*>(device_allocate(count * sizeof(T)))) {
        copy_to_device(data_, host, count * sizeof(T));
    }
    explicit OnDevice(std::vector<T> const& host) : OnDevice(host.data(), host.size()) {}
    ~OnDevice() { device_free(reinterpret_cast<std::byte*>(data_)); }
    OnDevice(OnDevice const&) = delete;
    OnDevice& operator=(OnDevice const&) = delete;
    T* get() const { return data_; }

private:
    T* data_;
};

/// Anywhere, on faces and corners of bricks, and on centres of cells.
std::vector<Point> points_in(Volume const& volume, int count) {
    Index3 const dims = volume.header().dims;
    std::mt19937_64 random(7);
    auto const uniform = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
    std::vector<Point> points;
    points.reserve(static_cast<std::size_t>(count));
    while (points.size() < static_cast<std::size_t>(count)) {
        Brick const& b = volume.bricks()[random() % volume.bricks().size()];
        Index3 const w = cell_width(dims, b.level);
        auto const along = [&](int a) {
            auto const cells = static_cast<double>(b.dims[a]);
            double const cell = points.size() % 4 == 0   ? std::floor(uniform() * (cells + 1)) // faces and corners
                                : points.size() % 4 == 1 ? std::floor(uniform() * cells) + 0.5 // centres
                                                         : uniform() * (cells + 2) - 1;        // and across the faces
            return static_cast<double>(b.lower[a]) + cell * static_cast<double>(w[a]);
        };
        points.push_back({along(0), along(1), along(2)});
    }
    return points;
}

double seconds_since(std::chrono::steady_clock::time_point begin) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// Largest differences relative to the range of the values, and of gradients times a cell.
bool compare(char const* name, Volume const& volume, int count) {
    TreeSampler const sampler(volume);
    SamplerView<float> const host = sampler.view<float>();
    BrickIndex const index(volume.header().dims, volume.bricks());
    OnDevice<IndexNode> const nodes(host.nodes, index.nodes().size());
    OnDevice<std::int32_t> const order(host.order, index.order().size());
    OnDevice<SampledBrick> const bricks(host.bricks, volume.bricks().size());
    OnDevice<float> const cells(host.cells, static_cast<std::size_t>(volume.header().cell_count));
    SamplerView<float> const device{nodes.get(), order.get(), bricks.get(), cells.get()};

    std::vector<Point> const points = points_in(volume, count);
    std::vector<TreeGradientSample> expected(points.size()), got(points.size());
    OnDevice<Point> const points_there(points);
    OnDevice<TreeGradientSample> const samples(got);
    unsigned const blocks = static_cast<unsigned>((points.size() + 127) / 128);
    auto const launch = [&] {
        sample_points<<<blocks, 128>>>(device, points_there.get(), count, samples.get());
        check_launch("sample_points");
        device_synchronize();
    };
    launch();
    auto begin = std::chrono::steady_clock::now();
    launch();
    double const gpu = seconds_since(begin);
    copy_to_host(got.data(), samples.get(), got.size() * sizeof(TreeGradientSample));
    begin = std::chrono::steady_clock::now();
#pragma omp parallel for schedule(static)
    for (int i = 0; i < count; ++i) {
        Point const& p = points[static_cast<std::size_t>(i)];
        expected[static_cast<std::size_t>(i)] = sample_gradient(host, p.x, p.y, p.z);
    }
    double const cpu = seconds_since(begin);

    double range = 0, value = 0, weight = 0, gradient = 0;
    int holes = 0;
    for (auto const& e : expected) range = std::max(range, static_cast<double>(std::abs(e.value)));
    for (std::size_t i = 0; i < expected.size(); ++i) {
        TreeGradientSample const &e = expected[i], &g = got[i];
        holes += e.weight == 0 ? 1 : 0;
        if ((e.weight == 0) != (g.weight == 0)) value = 1e30;
        value = std::max(value, std::abs(static_cast<double>(e.value) - g.value) / range);
        weight = std::max(weight, std::abs(static_cast<double>(e.weight) - g.weight));
        for (int a = 0; a < 3; ++a)
            gradient = std::max(gradient, std::abs(static_cast<double>(e.gradient[a]) - g.gradient[a]) / range);
    }
    bool const ok = value <= 1e-5 && weight <= 1e-5 && gradient <= 1e-5;
    std::printf("%s %-28s %8.2g value %8.2g weight %8.2g gradient, %d of %d in holes; %.0f M samples/s, CPU %.0f\n",
                ok ? "ok    " : "FAILED", name, value, weight, gradient, holes, count, count / gpu * 1e-6,
                count / cpu * 1e-6);
    return ok;
}

} // namespace

int main() {
    if (device_count() == 0) {
        std::puts("skipped: no CUDA device");
        return skipped;
    }
    Execution const execution = default_execution();
    AmrRecipe small;
    small.roots = {2, 3, 1};
    small.finest = 5;
    small.blocks = 400;
    AmrRecipe uneven;
    uneven.block = {4, 6, 10};
    uneven.finest = 4;
    uneven.blocks = 200;
    bool ok = compare("small tree", make_amr(small, execution), 1000000);
    ok = compare("blocks of 4 x 6 x 10", make_amr(uneven, execution), 1000000) && ok;
    ok = compare("SILCC-like, far from zero", make_amr(silcc_like(), execution), 10000000) && ok;
    return ok ? 0 : 1;
}
