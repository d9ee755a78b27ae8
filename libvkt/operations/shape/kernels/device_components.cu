// Components on GPUs: runs of bits are joined by union-find, a thread a word of 32 voxels; the smaller root wins.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/kernels/device_components.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/shape/kernels/device_joins.h"
#include "libvkt/operations/shape/kernels/device_objects.h"
#include "libvkt/operations/shape/kernels/value_runs.h"

#include <algorithm>
#include <limits>
#include <type_traits>

namespace vkt {

namespace VKT_BACKEND {
namespace {

using namespace components;

// Bits.

/// A warp makes so many words.
constexpr int words_of_warp = 4;

template <class T>
__global__ void __launch_bounds__(block) bits_kernel(View<T const> in, Index3 n, IsObject<T> is_object, unsigned* to,
                                                     Rows rows, std::int64_t row0, unsigned long long* totals) {
    auto const lane = static_cast<int>(threadIdx.x % 32);
    std::int64_t const parts = (rows.words + words_of_warp - 1) / words_of_warp,
                       item = (static_cast<std::int64_t>(blockIdx.x) * block + threadIdx.x) / 32,
                       r = driver::quotient_of(item, parts), w0 = (item - r * parts) * words_of_warp;
    unsigned nan = 0;
    if (r < n.y * n.z) {
        std::int64_t const z = driver::quotient_of(r, n.y), y = r - z * n.y;
        T const* const from = in.data + y * in.row + z * in.slice;
        T v[words_of_warp];
#pragma unroll
        for (int k = 0; k < words_of_warp; ++k) {
            std::int64_t const x = (w0 + k) * 32 + lane;
            v[k] = x < n.x ? from[x] : T{};
        }
#pragma unroll
        for (int k = 0; k < words_of_warp; ++k) {
            bool const valid = (w0 + k) * 32 + lane < n.x;
            auto const value = static_cast<typename IsObject<T>::C>(v[k]);
            unsigned const bits = __ballot_sync(~0u, valid && is_object(value));
            if constexpr (!std::is_integral_v<T>) nan += __popc(__ballot_sync(~0u, valid && value != value));
            if (lane == 0 && w0 + k < rows.words) to[(row0 + z * rows.ny + y) * rows.words + w0 + k] = bits;
        }
    }
    if (nan != 0 && lane == 0) atomicAdd(totals, static_cast<unsigned long long>(nan));
}

template <class T>
void pack(DeviceComponents& components, ConstView in, std::optional<double> zero, unsigned long long* totals) {
    Rows const rows = rows_of(components);
    Index3 const n = in.dims();
    std::int64_t const parts = (rows.words + words_of_warp - 1) / words_of_warp;
    IsObject<T> const is_object(zero, components.holes);
    bits_kernel<T><<<blocks_for(parts * n.y * n.z * 32), block>>>(in.as<T>(), n, is_object, rows.bits, rows,
                                                                  in.box.lower.z * rows.ny + in.box.lower.y, totals);
    check_launch("label");
}

// Joining by value.

template <class T>
__global__ void __launch_bounds__(block) changed_kernel(View<T const> in, Index3 n, Rows rows, std::int64_t first) {
    using C = typename IsObject<T>::C;
    std::int64_t const i = this_thread() / 32, r = driver::quotient_of(i, rows.words), w = i - r * rows.words;
    if (r >= n.y * n.z) return;
    std::int64_t const z = driver::quotient_of(r, n.y), y = r - z * n.y, x = w * 32 + threadIdx.x % 32;
    T const* const from = in.data + y * in.row + z * in.slice;
    bool const differs = x < n.x && (x == 0 || static_cast<C>(from[x]) != static_cast<C>(from[x - 1]));
    unsigned const word = __ballot_sync(~0u, differs);
    if (threadIdx.x % 32 == 0) rows.changed[first + i] = word;
}

/// Such that equal values have equal keys: -0 is 0.
template <class T> __device__ unsigned long long key_of(T v) {
    if constexpr (std::is_integral_v<T>)
        return static_cast<unsigned long long>(v);
    else
        return static_cast<unsigned long long>(__double_as_longlong(v == T(0) ? 0.0 : static_cast<double>(v)));
}

/// The values of the runs that start in `words` words from the first one on.
template <class T>
__global__ void __launch_bounds__(block) run_values_kernel(View<T const> in, Index3 n, Rows rows, std::int64_t first,
                                                           unsigned const* before, unsigned long long* values) {
    using C = typename IsObject<T>::C;
    std::int64_t const i = this_thread(), r = driver::quotient_of(i, rows.words), w = i - r * rows.words;
    if (r >= n.y * n.z) return;
    std::int64_t const z = driver::quotient_of(r, n.y), y = r - z * n.y;
    T const* const from = in.data + y * in.row + z * in.slice;
    Place const p = place_of(rows, first + i);
    unsigned run = before[i];
    for (unsigned e = rows.starts(p.y, p.z, p.w); e != 0; e &= e - 1, ++run)
        values[run] = key_of<C>(static_cast<C>(from[w * 32 + __ffs(static_cast<int>(e)) - 1]));
}

/// What comes next: where values change, and those of the runs.
template <class T> void add_values(DeviceComponents& components, ConstView in) {
    Rows const rows = rows_of(components);
    Index3 const n = in.dims();
    std::int64_t const words = rows.words * n.y * n.z, first = (in.box.lower.z * rows.ny + in.box.lower.y) * rows.words;
    changed_kernel<T><<<blocks_for(words * 32), block>>>(in.as<T>(), n, rows, first);
    check_launch("label");
    driver::DeviceScratch const memory(static_cast<std::size_t>(words) * 4);
    auto* const before = reinterpret_cast<unsigned*>(memory.get());
    std::uint64_t const runs = sums_before(words, CountStarts{rows, first}, before);
    if (runs == 0) return;
    Buffer values(static_cast<std::size_t>(runs) * 8);
    run_values_kernel<T><<<blocks_for(words), block>>>(
        in.as<T>(), n, rows, first, before, reinterpret_cast<unsigned long long*>(values.write(Space::device)));
    check_launch("label");
    components.run_values.push_back(std::move(values));
    components.runs.push_back(static_cast<std::int64_t>(runs));
}

/// The values of all runs, in their order.
void gather_values(DeviceComponents& components, unsigned long long* to) {
    for (std::size_t i = 0; i < components.runs.size(); ++i) {
        copy_on_device(to, components.run_values[i].read(Space::device),
                       static_cast<std::size_t>(components.runs[i]) * 8);
        to += components.runs[i];
    }
    components.run_values.clear();
    components.runs.clear();
}

struct CountSetBits {
    __device__ int operator()(unsigned word) const { return __popc(word); }
};

__device__ ValueRuns value_runs(Rows const& rows, std::int64_t y, std::int64_t z, std::int64_t w) {
    bool const next = (rows.row(y, z, w + 1) & 1) != 0, next_starts = next && (rows.starts(y, z, w + 1) & 1) != 0;
    return {rows.row(y, z, w), rows.starts(y, z, w), rows.row(y, z, w - 1) >> 31 != 0, next && !next_starts,
            next_starts};
}

__global__ void __launch_bounds__(block)
    join_values_kernel(Rows rows, int connectivity, Links links, unsigned const* before,
                       unsigned long long const* values, unsigned* parent) {
    std::int64_t const i = this_thread();
    if (i >= rows.words * rows.ny * rows.nz) return;
    Place const p = place_of(rows, i);
    if (rows.row(p.y, p.z, p.w) == 0) return;
    ValueRuns const own = value_runs(rows, p.y, p.z, p.w);
    CountSetBits const count;
    auto const join = [&](std::int64_t y, std::int64_t z, bool diagonally) {
        if (y < 0 || y >= rows.ny || z < 0) return;
        ValueRuns const other = value_runs(rows, y, z, p.w);
        unsigned const others = before[rows.word(y, z, p.w)];
        auto const unite_equal = [&](int b, unsigned run) {
            unsigned const mine = own.run_at(before[i], b, count);
            if (values[mine] == values[run]) unite(parent, mine, run);
        };
        for (unsigned e = own.facing(other); e != 0; e &= e - 1) {
            int const b = __ffs(static_cast<int>(e)) - 1;
            unite_equal(b, other.run_at(others, b, count));
        }
        if (!diagonally) return;
        for (unsigned e = own.touching_left(other); e != 0; e &= e - 1) {
            int const b = __ffs(static_cast<int>(e)) - 1;
            unite_equal(b, other.run_left_of(others, b, count));
        }
        for (unsigned e = own.touching_right(other); e != 0; e &= e - 1) {
            int const b = __ffs(static_cast<int>(e)) - 1;
            unite_equal(b, other.run_right_of(others, b, count));
        }
    };
    if (links == Links::above) join(p.y - 1, p.z, connectivity >= 18);
    if (links == Links::before) join(p.y, p.z - 1, connectivity >= 18);
    if (links != Links::across) return;
    join(p.y - 1, p.z - 1, connectivity == 26);
    join(p.y + 1, p.z - 1, connectivity == 26);
}

// Numbering.

/// The first voxels of the components whose runs are of several rows.
__global__ void __launch_bounds__(block)
    first_kernel(Rows rows, unsigned const* before, unsigned* parent, unsigned long long* first) {
    std::int64_t const i = this_thread();
    if (i >= rows.words * rows.run_ny * rows.run_nz) return;
    Place const p = place_of(rows, i);
    unsigned const all = rows.all(p.y, p.z, p.w), starts = rows.starts(p.y, p.z, p.w);
    for (unsigned rest = all; rest != 0;) {
        unsigned const begin = rest & -rest, run = rest & ~(rest + begin);
        rest &= ~run;
        int const b = __ffs(static_cast<int>(begin)) - 1;
        unsigned const root = root_of(parent, before[i] + static_cast<unsigned>(__popc(starts & up_to(b))) - 1);
        unsigned long long voxel = ~0ull;
        for (int k = 3; k >= 0; --k) {
            std::int64_t const y = 2 * p.y + k % 2, z = 2 * p.z + k / 2;
            unsigned const here = rows.row(y, z, p.w) & run;
            if (here != 0)
                voxel = static_cast<unsigned long long>((z * rows.ny + y) * rows.words * 32 + p.w * 32 +
                                                        __ffs(static_cast<int>(here)) - 1);
        }
        if (voxel < *static_cast<unsigned long long volatile*>(first + root)) atomicMin(first + root, voxel);
    }
}

/// Calls f(run, voxel) for the runs of a word that are roots, with the first voxel of the component, as bits count.
template <class F>
__device__ void for_each_root(Rows const& rows, std::int64_t i, unsigned const* before, unsigned const* parent,
                              unsigned long long const* first, F const& f) {
    Place const p = place_of(rows, i);
    unsigned run = before[i];
    for (unsigned e = rows.starts(p.y, p.z, p.w); e != 0; e &= e - 1, ++run)
        if (parent[run] == run)
            f(run,
              first != nullptr ? first[run] : static_cast<unsigned long long>(i * 32 + __ffs(static_cast<int>(e)) - 1));
}

__global__ void __launch_bounds__(block) roots_kernel(Rows rows, unsigned const* before, unsigned const* parent,
                                                      unsigned long long const* first, unsigned* marks) {
    std::int64_t const i = this_thread();
    if (i >= rows.words * rows.run_ny * rows.run_nz) return;
    for_each_root(rows, i, before, parent, first,
                  [&](unsigned, unsigned long long voxel) { atomicOr(marks + voxel / 32, 1u << voxel % 32); });
}

__global__ void __launch_bounds__(block)
    ranks_kernel(Rows rows, unsigned const* before, unsigned const* parent, unsigned long long const* first,
                 unsigned const* marks, unsigned const* marks_before, unsigned* rank, unsigned long long* voxels) {
    std::int64_t const i = this_thread();
    if (i >= rows.words * rows.run_ny * rows.run_nz) return;
    for_each_root(rows, i, before, parent, first, [&](unsigned run, unsigned long long voxel) {
        unsigned const mine = marks_before[voxel / 32] +
                              static_cast<unsigned>(__popc(marks[voxel / 32] & below(static_cast<int>(voxel % 32))));
        rank[run] = mine;
        voxels[mine] = voxel;
    });
}

/// Runs that are no roots get the rank of theirs.
__global__ void __launch_bounds__(block) spread_kernel(unsigned* parent, unsigned* rank, std::int64_t n) {
    std::int64_t const i = this_thread();
    if (i >= n) return;
    unsigned const root = root_of(parent, static_cast<unsigned>(i));
    if (root != i) rank[i] = rank[root];
}

// Results.

struct Runs {
    Rows rows;
    unsigned const *before, *component;

    /// Of the run of which a voxel of row y, z is bit b of word w.
    __device__ unsigned component_of(std::int64_t y, std::int64_t z, std::int64_t w, int b) const {
        std::int64_t const run_y = rows.group == 1 ? y : y / 2, run_z = rows.group == 1 ? z : z / 2;
        unsigned const starts = rows.starts(run_y, run_z, w);
        return component[before[rows.word(run_y, run_z, w)] + static_cast<unsigned>(__popc(starts & up_to(b))) - 1];
    }
};
Runs runs_of(DeviceComponents& components) {
    return {rows_of(components), reinterpret_cast<unsigned const*>(components.before.read(Space::device)),
            reinterpret_cast<unsigned const*>(components.component.read(Space::device))};
}

template <class T>
__global__ void __launch_bounds__(block)
    labels_kernel(Runs runs, unsigned const* names, View<T> out, Index3 lower, Index3 n) {
    auto const lane = static_cast<int>(threadIdx.x % 32);
    std::int64_t const item = this_thread() / 32, parts = (runs.rows.words + words_of_warp - 1) / words_of_warp,
                       r = driver::quotient_of(item, parts), w0 = (item - r * parts) * words_of_warp;
    if (r >= n.y * n.z) return;
    std::int64_t const dz = driver::quotient_of(r, n.y), dy = r - dz * n.y, y = lower.y + dy, z = lower.z + dz;
    T* const to = out.data + dy * out.row + dz * out.slice;
#pragma unroll
    for (int k = 0; k < words_of_warp; ++k) {
        std::int64_t const w = w0 + k, x = w * 32 + lane;
        if (x >= n.x) return;
        unsigned const bits = runs.rows.row(y, z, w);
        unsigned label = 0;
        if ((bits >> lane & 1) != 0) {
            unsigned const component = runs.component_of(y, z, w, lane);
            label = names != nullptr ? names[component] : component + 1;
        }
        to[x] = static_cast<T>(label);
    }
}

template <class T> void launch_labels(Runs const& runs, unsigned const* names, AnyView out) {
    Index3 const n = out.dims();
    std::int64_t const parts = (runs.rows.words + words_of_warp - 1) / words_of_warp;
    labels_kernel<T><<<blocks_for(parts * n.y * n.z * 32), block>>>(runs, names, out.as<T>(), out.box.lower, n);
    check_launch("label");
}

/// Voxels whose components have names get values.
template <class T>
__global__ void __launch_bounds__(block)
    paint_kernel(Runs runs, unsigned const* names, std::uint64_t const* values, View<T> out, Index3 lower, Index3 n) {
    std::int64_t const i = this_thread(), r = driver::quotient_of(i, n.x), x = i - r * n.x;
    if (r >= n.y * n.z) return;
    std::int64_t const dz = driver::quotient_of(r, n.y), dy = r - dz * n.y, y = lower.y + dy, z = lower.z + dz;
    if ((runs.rows.row(y, z, x / 32) >> x % 32 & 1) == 0) return;
    unsigned const component = runs.component_of(y, z, x / 32, static_cast<int>(x % 32));
    if (names[component] != 0) out.data[x + dy * out.row + dz * out.slice] = static_cast<T>(values[component]);
}
template <class T>
void launch_paint(Runs const& runs, unsigned const* names, std::uint64_t const* values, AnyView out) {
    paint_kernel<T>
        <<<blocks_for(out.box.voxels()), block>>>(runs, names, values, out.as<T>(), out.box.lower, out.dims());
    check_launch("fill-holes");
}

template <class T>
__global__ void __launch_bounds__(block) values_kernel(Rows rows, unsigned long long const* first, std::int64_t count,
                                                       View<T const> in, Box box, std::uint64_t* values) {
    std::int64_t const i = this_thread();
    if (i >= count) return;
    auto const bit = static_cast<std::int64_t>(first[i]);
    std::int64_t const r = bit / (rows.words * 32), x = bit - r * rows.words * 32;
    std::int64_t const voxel = r * rows.nx + x - 1; // in x-fastest order
    if (voxel < 0) return;
    std::int64_t const row = voxel / rows.nx, at_z = row / rows.ny, at_y = row - at_z * rows.ny,
                       at_x = voxel - row * rows.nx;
    if (at_z < box.lower.z || at_z >= box.upper.z || at_y < box.lower.y || at_y >= box.upper.y) return;
    values[i] = static_cast<std::uint64_t>(in(at_x, at_y, at_z));
}
template <class T> void launch_values(DeviceComponents& components, ConstView in) {
    values_kernel<T><<<blocks_for(components.count), block>>>(
        rows_of(components), reinterpret_cast<unsigned long long const*>(components.first.read(Space::device)),
        components.count, in.as<T>(), in.box,
        reinterpret_cast<std::uint64_t*>(components.values.update(Space::device)));
    check_launch("fill-holes");
}

__device__ void least(std::int32_t* to, std::int64_t v) {
    if (v < *static_cast<std::int32_t volatile*>(to)) atomicMin(to, static_cast<std::int32_t>(v));
}
__device__ void most(std::int32_t* to, std::int64_t v) {
    if (v > *static_cast<std::int32_t volatile*>(to)) atomicMax(to, static_cast<std::int32_t>(v));
}
__device__ void add(std::uint64_t* to, std::uint64_t v) {
    if (v != 0) atomicAdd(reinterpret_cast<unsigned long long*>(to), static_cast<unsigned long long>(v));
}

__global__ void __launch_bounds__(block) facts_kernel(Runs runs, ComponentFacts* facts) {
    Rows const& rows = runs.rows;
    std::int64_t const i = this_thread();
    if (i >= rows.words * rows.ny * rows.nz) return;
    std::int64_t const r = driver::quotient_of(i, rows.words), w = i - r * rows.words,
                       z = driver::quotient_of(r, rows.ny), y = r - z * rows.ny;
    for (unsigned rest = rows.row(y, z, w); rest != 0;) {
        unsigned const begin = rest & -rest;
        unsigned part = rest & ~(rest + begin);
        if (rows.changed != nullptr) { // up to where the next run starts
            unsigned const next = rows.changed[i] & part & ~begin;
            part &= (next & -next) - 1;
        }
        rest &= ~part;
        int const b = __ffs(static_cast<int>(begin)) - 1;
        ComponentFacts* const to = facts + runs.component_of(y, z, w, b);
        auto const n = static_cast<std::uint64_t>(__popc(part)), x = static_cast<std::uint64_t>(w * 32 + b);
        add(&to->size, n);
        add(&to->sum_x, n * x + n * (n - 1) / 2);
        add(&to->sum_y, n * static_cast<std::uint64_t>(y));
        add(&to->sum_z, n * static_cast<std::uint64_t>(z));
        least(&to->lower_x, static_cast<std::int64_t>(x));
        least(&to->lower_y, y);
        least(&to->lower_z, z);
        most(&to->upper_x, static_cast<std::int64_t>(x + n));
        most(&to->upper_y, y + 1);
        most(&to->upper_z, z + 1);
    }
}

} // namespace

void component_bits(DeviceComponents& components, ConstView rows, std::optional<double> zero, Execution const&) {
    if (rows.box.empty()) return;
    Index3 const n = components.dims;
    components.bits.reserve(static_cast<std::size_t>((n.x + 31) / 32 * n.y * n.z) * 4);
    driver::DeviceLosses const counts;
    if (components.by_value) components.changed.reserve(components.bits.bytes());
    with_type(rows.type, [&]<class T>(T) {
        pack<T>(components, rows, zero, counts.get());
        if (components.by_value) add_values<T>(components, rows);
    });
    if (is_integer(rows.type)) return;
    Losses found;
    counts.add_to(found);
    components.nan += found.clipped;
}

void component_numbers(DeviceComponents& components, Execution const&) {
    Rows const rows = rows_of(components);
    std::int64_t const words = rows.run_words(), bit_words = rows.words * rows.ny * rows.nz;
    components.before.reserve(static_cast<std::size_t>(words) * 4);
    auto* const before = reinterpret_cast<unsigned*>(components.before.write(Space::device));
    std::uint64_t const runs = sums_before(words, CountStarts{rows}, before);
    if (runs >> 32 != 0) throw Error(ErrorKind::resources, "there are 2^32 runs of voxels or more", "use --device cpu");
    components.component.reserve(std::max<std::size_t>(1, runs) * 4);
    auto* const rank = reinterpret_cast<unsigned*>(components.component.write(Space::device));
    driver::DeviceScratch const parents(std::max<std::size_t>(1, runs) * 4);
    auto* const parent = reinterpret_cast<unsigned*>(parents.get());
    auto const count = static_cast<std::int64_t>(runs);
    if (runs == 0) {
        components.count = 0;
        return;
    }
    singles_kernel<<<blocks_for(count), block>>>(parent, count);
    std::optional<driver::DeviceScratch> value_memory;
    unsigned long long* values = nullptr;
    if (components.by_value) {
        value_memory.emplace(runs * 8);
        values = reinterpret_cast<unsigned long long*>(value_memory->get());
        gather_values(components, values);
    }
    for (Links const links : {Links::above, Links::before, Links::across}) {
        if (links == Links::across && components.connectivity == 6) break;
        if (values != nullptr)
            join_values_kernel<<<blocks_for(words), block>>>(rows, components.connectivity, links, before, values,
                                                             parent);
        else
            join_kernel<<<blocks_for(words), block>>>(rows, components.connectivity, links, before, parent);
        flatten_kernel<<<blocks_for(count), block>>>(parent, count);
    }
    std::optional<driver::DeviceScratch> firsts;
    unsigned long long* first = nullptr;
    if (rows.group > 1) {
        firsts.emplace(runs * 8);
        first = reinterpret_cast<unsigned long long*>(firsts->get());
        cudaMemsetAsync(first, 0xff, runs * 8);
        first_kernel<<<blocks_for(words), block>>>(rows, before, parent, first);
    }
    driver::DeviceScratch const mark_memory(static_cast<std::size_t>(bit_words) * 4),
        mark_sums(static_cast<std::size_t>(bit_words) * 4);
    auto* const marks = reinterpret_cast<unsigned*>(mark_memory.get());
    auto* const marks_before = reinterpret_cast<unsigned*>(mark_sums.get());
    device_clear(marks, static_cast<std::size_t>(bit_words) * 4);
    roots_kernel<<<blocks_for(words), block>>>(rows, before, parent, first, marks);
    components.count = static_cast<std::int64_t>(sums_before(bit_words, CountBits{marks}, marks_before));
    components.first.reserve(static_cast<std::size_t>(components.count) * 8);
    ranks_kernel<<<blocks_for(words), block>>>(
        rows, before, parent, first, marks, marks_before, rank,
        reinterpret_cast<unsigned long long*>(components.first.write(Space::device)));
    spread_kernel<<<blocks_for(count), block>>>(parent, rank, count);
    check_launch("label");
}

void component_facts(DeviceComponents& components, std::vector<ComponentFacts>& facts, Execution const&) {
    ComponentFacts empty;
    empty.lower_x = empty.lower_y = empty.lower_z = std::numeric_limits<std::int32_t>::max();
    facts.assign(static_cast<std::size_t>(components.count), empty);
    if (facts.empty()) return;
    Runs const runs = runs_of(components);
    std::size_t const bytes = facts.size() * sizeof(ComponentFacts);
    driver::DeviceScratch const memory(bytes);
    copy_to_device(memory.get(), facts.data(), bytes);
    facts_kernel<<<blocks_for(runs.rows.words * runs.rows.ny * runs.rows.nz), block>>>(
        runs, reinterpret_cast<ComponentFacts*>(memory.get()));
    check_launch("label");
    copy_to_host(facts.data(), memory.get(), bytes);
}

void component_labels(DeviceComponents& components, AnyView out, Execution const&) {
    if (out.box.empty()) return;
    driver::DeviceList<std::uint32_t> const list(components.names);
    unsigned const* const names = components.names.empty() ? nullptr : list.get();
    Runs const runs = runs_of(components);
    for_each_size(size_of(out.type), [&]<class T>(T) { launch_labels<T>(runs, names, out); });
}

void component_values(DeviceComponents& components, ConstView rows, Execution const&) {
    if (rows.box.empty() || components.count == 0) return;
    std::size_t const bytes = static_cast<std::size_t>(components.count) * 8;
    components.values.reserve(bytes);
    if (!components.values.resident(Space::device)) device_clear(components.values.write(Space::device), bytes);
    for_each_size(size_of(rows.type), [&]<class T>(T) { launch_values<T>(components, rows); });
}

void component_paint(DeviceComponents& components, AnyView out, Execution const&) {
    if (out.box.empty() || components.names.empty()) return;
    driver::DeviceList<std::uint32_t> const names(components.names);
    auto const* const values = reinterpret_cast<std::uint64_t const*>(components.values.read(Space::device));
    Runs const runs = runs_of(components);
    for_each_size(size_of(out.type), [&]<class T>(T) { launch_paint<T>(runs, names.get(), values, out); });
}

} // namespace VKT_BACKEND
} // namespace vkt
