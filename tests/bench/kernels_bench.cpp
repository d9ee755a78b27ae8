// Kernels as ratios to memcpy measured in the same run, at the same number of threads: the counter "of_copy" is
// (bytes read + written per second) / (the same of memcpy), "of_read" bytes read per second / (those of a plain sum);
// "Mvox" is million voxels per second.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/registry.h"
#include "libvkt/operations/filter/gaussian.h"
#include "libvkt/operations/statistics/statistics.h"
#include "libvkt/operations/voxels/crop.h"
#include "libvkt/operations/voxels/fill.h"
#include "libvkt/operations/voxels/flip.h"

#include <benchmark/benchmark.h>

#include <chrono>
#include <cstring>

namespace {

using namespace vkt;

Execution execution_for(benchmark::State const& state) {
    Execution execution = default_execution();
    execution.device = Device::cpu;
    execution.threads = static_cast<int>(state.range(1));
    execution.memory = std::size_t{8} << 30;
    return execution;
}

Volume volume_of(std::int64_t n, DataType type) {
    Header header;
    header.dims = {n, n, n};
    header.dtype = type;
    Volume volume(header);
    AnyView const view = volume.mutable_view();
    if (type == DataType::float32) { // bytes of any kind would be denormals, too
        auto* const values = reinterpret_cast<float*>(view.data);
        for (std::int64_t i = 0; i < view.box.voxels(); ++i) values[i] = static_cast<float>(i * 2654435761 >> 27 & 63);
        return volume;
    }
    for (std::size_t i = 0; i < view.bytes(); ++i) view.data[i] = static_cast<std::byte>(i * 2654435761u >> 27 & 63);
    return volume;
}

/// Seconds of the fastest of five copies by `threads` threads, in equal parts.
double copy_seconds(std::byte const* from, std::byte* to, std::size_t bytes, int threads) {
    double best = 1e30;
    for (int i = 0; i < 5; ++i) {
        auto const begin = std::chrono::steady_clock::now();
#pragma omp parallel for num_threads(threads) schedule(static)
        for (int part = 0; part < threads; ++part) {
            std::size_t const share = bytes / static_cast<std::size_t>(threads),
                              at = share * static_cast<std::size_t>(part);
            std::memcpy(to + at, from + at, part + 1 == threads ? bytes - at : share);
        }
        best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    }
    return best;
}

/// Seconds of the fastest of five sums of all words.
double read_seconds(std::byte const* from, std::size_t bytes, int threads) {
    auto const* const words = reinterpret_cast<std::uint64_t const*>(from);
    auto const count = static_cast<std::int64_t>(bytes / sizeof(std::uint64_t));
    double best = 1e30;
    for (int i = 0; i < 5; ++i) {
        auto const begin = std::chrono::steady_clock::now();
        std::uint64_t sum = 0;
#pragma omp parallel for simd num_threads(threads) schedule(static) reduction(+ : sum)
        for (std::int64_t w = 0; w < count; ++w) sum += words[w];
        benchmark::DoNotOptimize(sum);
        best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    }
    return best;
}

/// Whole volumes in warm memory, without the engine: the kernel itself.
void run(benchmark::State& state, Operation& operation, DataType type, bool reads = true) {
    Volume const in = volume_of(state.range(0), type);
    Header const planned = begun(operation, std::vector<Header>{in.header()}).output;
    Volume out(planned);
    AnyView const to = out.mutable_view();
    std::memset(to.data, 0, to.bytes());
    Execution const execution = execution_for(state);
    ConstView const window = in.view().part(operation.footprint(to.box, 0));
    double const bytes = (reads ? static_cast<double>(window.bytes()) : 0) + static_cast<double>(to.bytes());
    std::size_t const part = std::min(in.view().bytes(), to.bytes());
    double const copied =
        2 * static_cast<double>(part) / copy_seconds(in.view().data, to.data, part, execution.threads);
    double best = 1e30;
    for (auto _ : state) {
        (void)begun(operation, std::vector<Header>{in.header()}); // forgets what an earlier run left behind
        operation.fit(to.box.dims(), execution);
        auto const begin = std::chrono::steady_clock::now();
        operation.run({&window, 1}, to, execution);
        double const seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
        state.SetIterationTime(seconds);
        best = std::min(best, seconds);
        benchmark::DoNotOptimize(to.data);
    }
    state.counters["of_copy"] = bytes / best / copied;
    state.counters["Mvox"] = static_cast<double>(to.box.voxels()) / best * 1e-6;
}

void flip(benchmark::State& state, Axis axis, DataType type) {
    Flip operation(axis);
    run(state, operation, type);
}
void fill(benchmark::State& state, DataType type) {
    Fill operation(1);
    run(state, operation, type, false);
}
void crop(benchmark::State& state, DataType type) {
    Crop operation(Roi{"25%:75%,25%:75%,25%:75%"});
    run(state, operation, type);
}
/// An operation as a command line names it, without its inputs.
void pointwise(benchmark::State& state, std::string const& name, std::vector<std::string> words, DataType type) {
    std::unique_ptr<Operation> const operation = make_operation(name);
    Parameters parameters;
    operation->parameters(parameters);
    read_words(words, {&parameters});
    operation->check();
    run(state, *operation, type);
}
void statistics(benchmark::State& state, DataType type) {
    Volume const in = volume_of(state.range(0), type);
    Execution const execution = execution_for(state);
    double const read = read_seconds(in.view().data, in.view().bytes(), execution.threads);
    double best = 1e30;
    for (auto _ : state) {
        Statistics operation;
        auto const source = volume_source({in});
        source->next_volume();
        auto const begin = std::chrono::steady_clock::now();
        reduce(*source, operation, execution, {});
        double const seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
        state.SetIterationTime(seconds);
        best = std::min(best, seconds);
    }
    state.counters["of_read"] = read / best;
    state.counters["Mvox"] = static_cast<double>(in.view().box.voxels()) / best * 1e-6;
}
void gaussian(benchmark::State& state, double sigma, DataType type) {
    Gaussian operation({sigma, sigma, sigma});
    run(state, operation, type);
}
/// Through the engine, slab by slab, into fresh memory.
void gaussian_applied(benchmark::State& state, double sigma, DataType type) {
    Gaussian operation({sigma, sigma, sigma});
    Volume const in = volume_of(state.range(0), type);
    for (auto _ : state) {
        auto const begin = std::chrono::steady_clock::now();
        Volume const out = apply(operation, {in}, execution_for(state));
        state.SetIterationTime(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
        benchmark::DoNotOptimize(out.view().data);
    }
}

/// Extent and threads: in the L3 cache and beyond it, one thread and two.
void sizes(benchmark::internal::Benchmark* b) {
    for (int threads : {1, 2})
        for (int n : {128, 256, 512}) b->Args({n, threads});
    b->UseManualTime()->Unit(benchmark::kMillisecond)->MinTime(0.2);
}

BENCHMARK_CAPTURE(fill, float32, DataType::float32)->Apply(sizes);
BENCHMARK_CAPTURE(fill, uint8, DataType::uint8)->Apply(sizes);
BENCHMARK_CAPTURE(flip, x_float32, Axis::x, DataType::float32)->Apply(sizes);
BENCHMARK_CAPTURE(flip, x_uint16, Axis::x, DataType::uint16)->Apply(sizes);
BENCHMARK_CAPTURE(flip, x_uint8, Axis::x, DataType::uint8)->Apply(sizes);
BENCHMARK_CAPTURE(flip, y_float32, Axis::y, DataType::float32)->Apply(sizes);
BENCHMARK_CAPTURE(flip, z_float32, Axis::z, DataType::float32)->Apply(sizes);
BENCHMARK_CAPTURE(crop, float32, DataType::float32)->Apply(sizes);
BENCHMARK_CAPTURE(pointwise, convert_float32, "convert", {"--dtype", "float32"}, DataType::float32)->Apply(sizes);
BENCHMARK_CAPTURE(pointwise, convert_float32_uint8, "convert", {"--dtype", "uint8"}, DataType::float32)->Apply(sizes);
BENCHMARK_CAPTURE(pointwise, convert_uint8_float32, "convert", {"--dtype", "float32"}, DataType::uint8)->Apply(sizes);
BENCHMARK_CAPTURE(pointwise, arith_float32, "arith", {"mul", "-", "2"}, DataType::float32)->Apply(sizes);
BENCHMARK_CAPTURE(pointwise, arith_uint16, "arith", {"add", "-", "2"}, DataType::uint16)->Apply(sizes);
BENCHMARK_CAPTURE(pointwise, arith_uint8, "arith", {"add", "-", "2"}, DataType::uint8)->Apply(sizes);
BENCHMARK_CAPTURE(pointwise, threshold_float32, "threshold", {"--above", "3"}, DataType::float32)->Apply(sizes);
BENCHMARK_CAPTURE(pointwise, threshold_uint16, "threshold", {"--above", "3"}, DataType::uint16)->Apply(sizes);
BENCHMARK_CAPTURE(pointwise, threshold_uint8, "threshold", {"--above", "3"}, DataType::uint8)->Apply(sizes);
BENCHMARK_CAPTURE(statistics, float32, DataType::float32)->Apply(sizes);
BENCHMARK_CAPTURE(statistics, uint16, DataType::uint16)->Apply(sizes);
BENCHMARK_CAPTURE(statistics, uint8, DataType::uint8)->Apply(sizes);
BENCHMARK_CAPTURE(gaussian, sigma2_float32, 2.0, DataType::float32)->Apply(sizes);
BENCHMARK_CAPTURE(gaussian, sigma2_uint16, 2.0, DataType::uint16)->Apply(sizes);
BENCHMARK_CAPTURE(gaussian, sigma2_uint8, 2.0, DataType::uint8)->Apply(sizes);
BENCHMARK_CAPTURE(gaussian, sigma8_float32, 8.0, DataType::float32)->Apply(sizes);
BENCHMARK_CAPTURE(gaussian_applied, sigma2_float32, 2.0, DataType::float32)->Apply(sizes);

} // namespace
