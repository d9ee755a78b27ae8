// Counting pairs of voxels on GPUs: in shared memory where there are few bins, beside the others where not.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/joint_counts.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/statistics/kernels/device_counts.h"
#include "libvkt/operations/statistics/kernels/physical_values.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace vkt {

namespace VKT_BACKEND {
namespace {

constexpr int pair_threads = 256, pair_warps = pair_threads / 32;
constexpr std::int64_t pair_piece = 1024; ///< voxels of a row that a warp looks at before it looks for others
constexpr std::int64_t most_pair_blocks = 2048;

struct Side {
    driver::DeviceRows rows;
    bool mapped;
    double slope, intercept;

    __device__ __forceinline__ double value(std::int64_t x, std::int64_t y, std::int64_t z) const {
        double const stored = driver::load_value<double>(rows.type, rows.at(x, y, z));
        return mapped ? physical_value(stored, slope, intercept) : stored;
    }
};

/// Pieces of rows, each warp's in turn.
struct Pairs {
    Side a, b;
    Index3 n;
    std::int64_t pieces_a_row, pieces;

    /// Calls f(a, b) for a lane's pairs of finite values.
    template <class F> __device__ __forceinline__ void for_each(F const& f) const {
        std::int64_t const warps = static_cast<std::int64_t>(gridDim.x) * pair_warps;
        for (std::int64_t p = static_cast<std::int64_t>(blockIdx.x) * pair_warps + threadIdx.x / 32; p < pieces;
             p += warps) {
            std::int64_t const row = driver::quotient_of(p, pieces_a_row), z = driver::quotient_of(row, n.y),
                               y = row - z * n.y, first = (p - row * pieces_a_row) * pair_piece,
                               end = first + pair_piece < n.x ? first + pair_piece : n.x;
            for (std::int64_t x = first + threadIdx.x % 32; x < end; x += 32) {
                double const va = a.value(x, y, z), vb = b.value(x, y, z);
                if (va - va == 0 && vb - vb == 0) f(va, vb);
            }
        }
    }
};

Pairs pairs_of(SlabPair const& pair) {
    auto const side = [](ConstView const& view, ValueMap const& map) {
        bool const mapped = !(map.slope == 1 && map.intercept == 0);
        return Side{driver::device_rows(view, view.box), mapped, map.slope, map.intercept};
    };
    Index3 const n = pair.a.dims();
    std::int64_t const pieces = (n.x + pair_piece - 1) / pair_piece;
    return {side(pair.a, pair.map_a), side(pair.b, pair.map_b), n, pieces, pieces * n.y * n.z};
}

unsigned blocks_for(Pairs const& pairs) {
    return static_cast<unsigned>(std::min(most_pair_blocks, (pairs.pieces + pair_warps - 1) / pair_warps));
}

/// A warp's range each.
__global__ void __launch_bounds__(pair_threads) range_kernel(__grid_constant__ Pairs const pairs, PairRange* out) {
    PairRange r{{HUGE_VAL, HUGE_VAL}, {-HUGE_VAL, -HUGE_VAL}};
    pairs.for_each([&](double a, double b) {
        r.low[0] = a < r.low[0] ? a : r.low[0];
        r.high[0] = a > r.high[0] ? a : r.high[0];
        r.low[1] = b < r.low[1] ? b : r.low[1];
        r.high[1] = b > r.high[1] ? b : r.high[1];
    });
    for (int half = 16; half > 0; half /= 2)
        for (int i = 0; i < 2; ++i) {
            double const low = __shfl_down_sync(0xffffffffu, r.low[i], half),
                         high = __shfl_down_sync(0xffffffffu, r.high[i], half);
            r.low[i] = low < r.low[i] ? low : r.low[i];
            r.high[i] = high > r.high[i] ? high : r.high[i];
        }
    if (threadIdx.x % 32 == 0) out[static_cast<std::int64_t>(blockIdx.x) * pair_warps + threadIdx.x / 32] = r;
}

/// `shared_slots`: that many counters in shared memory, or 0: those in global memory are used at once.
__global__ void __launch_bounds__(pair_threads)
    count_kernel_of_pairs(__grid_constant__ Pairs const pairs, __grid_constant__ EqualBins const bins_a,
                          __grid_constant__ EqualBins const bins_b, unsigned shared_slots,
                          unsigned long long* counters) {
    extern __shared__ unsigned counted[];
    for (unsigned i = threadIdx.x; i < shared_slots; i += pair_threads) counted[i] = 0;
    __syncthreads();
    auto const add = [&](int slot, std::uint64_t sum) {
        if (shared_slots > 0)
            atomicAdd(counted + slot, static_cast<unsigned>(sum));
        else
            atomicAdd(counters + slot, static_cast<unsigned long long>(sum));
    };
    driver::CountRun<decltype(add)> run{add};
    pairs.for_each([&](double a, double b) { run.take(bin_in(bins_a, a) * bins_b.count + bin_in(bins_b, b), 1); });
    run.flush();
    __syncthreads();
    for (unsigned i = threadIdx.x; i < shared_slots; i += pair_threads)
        if (counted[i] != 0) atomicAdd(counters + i, static_cast<unsigned long long>(counted[i]));
}

} // namespace

void range_of_pairs(SlabPair const& pair, PairRange& range, Execution const&) {
    Pairs const pairs = pairs_of(pair);
    unsigned const blocks = blocks_for(pairs);
    std::vector<PairRange> found(static_cast<std::size_t>(blocks) * pair_warps);
    driver::DeviceScratch const memory(found.size() * sizeof(PairRange));
    range_kernel<<<blocks, pair_threads>>>(pairs, reinterpret_cast<PairRange*>(memory.get()));
    check_launch("range of pairs");
    copy_to_host(found.data(), memory.get(), found.size() * sizeof(PairRange));
    for (PairRange const& r : found)
        for (int i = 0; i < 2; ++i) {
            range.low[i] = std::min(range.low[i], r.low[i]);
            range.high[i] = std::max(range.high[i], r.high[i]);
        }
}

void count_pairs(SlabPair const& pair, EqualBins const& bins_a, EqualBins const& bins_b, std::uint64_t* counts,
                 Execution const&) {
    auto const edges_of = [](EqualBins const& bins) {
        return std::vector<double>(bins.edges, bins.edges + bins.count + 1);
    };
    driver::DeviceList<double> const edges_a(edges_of(bins_a)), edges_b(edges_of(bins_b));
    Pairs const pairs = pairs_of(pair);
    auto const slots = static_cast<unsigned>(bins_a.count) * static_cast<unsigned>(bins_b.count);
    driver::DeviceCounters const counters(slots);
    unsigned const shared_slots = slots <= driver::most_shared_counters ? slots : 0; // a block sees fewer than 2^32
    count_kernel_of_pairs<<<blocks_for(pairs), pair_threads, shared_slots * sizeof(unsigned)>>>(
        pairs, {edges_a.get(), bins_a.count, bins_a.scale}, {edges_b.get(), bins_b.count, bins_b.scale}, shared_slots,
        counters.get());
    check_launch("counts of pairs");
    std::vector<std::uint64_t> const found = counters.on_host();
    for (std::size_t i = 0; i < found.size(); ++i) counts[i] += found[i];
}

} // namespace VKT_BACKEND

} // namespace vkt
