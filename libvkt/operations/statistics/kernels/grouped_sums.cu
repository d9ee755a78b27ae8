// Sums of groups of voxels on GPUs: each block of rows is sorted by group, and a thread sums a group of one.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/grouped_sums.h"

#include "libvkt/kernel/cuda_sums.h"
#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/statistics/kernels/device_groups.h"

#include <algorithm>

namespace vkt {

namespace VKT_BACKEND {
namespace {

constexpr int block = 256;
constexpr int summing = 64; ///< threads of a block that sum: there are few, and each takes long
constexpr std::int64_t sorted_at_once = std::int64_t{1} << 26; ///< voxels, for which there are 8 bytes each

/// A slab's groups, and the blocks that they are summed by.
struct BlockGroups : Groups {
    RowBlocks blocks;
};

/// A block of rows, whose voxels are numbered in x-fastest order.
struct RowBlock {
    BlockGroups const& groups;
    std::int64_t z, y, width;
    unsigned voxels;

    __device__ RowBlock(BlockGroups const& groups, std::int64_t number)
        : groups(groups), z(groups.blocks.z(number)), y(groups.blocks.first_row(number)), width(groups.blocks.dims.x),
          voxels(static_cast<unsigned>(groups.blocks.rows_of(number) * width)) {}
    __device__ std::int64_t row(unsigned voxel) const { return driver::quotient_of(voxel, width); }
    __device__ bool counts(unsigned voxel) const {
        std::int64_t const r = row(voxel);
        return groups.counts(voxel - r * width, y + r, z);
    }
    __device__ std::int64_t key(unsigned voxel) const {
        std::int64_t const r = row(voxel);
        return groups.key(voxel - r * width, y + r, z);
    }
};

/// Of a block: voxels that count, groups, and which of the two lists the voxels are in; the other one says where in it
/// groups begin.
struct SortedBlock {
    unsigned voxels, groups;
    bool in_spare;
};

/// Two lists, of `each` numbers a block.
struct Lists {
    unsigned *order, *spare;
    std::int64_t each;

    __device__ unsigned* voxels(std::int64_t i, SortedBlock const& sorted) const {
        return (sorted.in_spare ? spare : order) + i * each;
    }
    __device__ unsigned* begins(std::int64_t i, SortedBlock const& sorted) const {
        return (sorted.in_spare ? order : spare) + i * each;
    }
};

/// What a thread has of n items, the next thread those that follow.
struct Share {
    unsigned begin, end;
    __device__ explicit Share(unsigned n) {
        unsigned const each = n / block + (n % block != 0 ? 1 : 0);
        begin = min(n, threadIdx.x * each);
        end = min(n, begin + each);
    }
};

/// The voxels of each block that count, sorted by group; those of a group in the order they had.
__global__ void __launch_bounds__(block)
    sort_kernel(__grid_constant__ BlockGroups const groups, std::int64_t first, Lists lists, SortedBlock* sorted) {
    constexpr int digits = 16, bits_of_digit = 4;
    __shared__ unsigned counts[digits * block]; // by digit, then by thread
    __shared__ unsigned long long differing;
    RowBlock const rows(groups, first + blockIdx.x);
    unsigned *from = lists.order + blockIdx.x * lists.each, *to = lists.spare + blockIdx.x * lists.each;
    unsigned mine = 0, n = 0;
    Share share(rows.voxels);
    for (unsigned v = share.begin; v < share.end; ++v) mine += rows.counts(v) ? 1 : 0;
    unsigned place = driver::sum_before<block>(mine, n);
    for (unsigned v = share.begin; v < share.end; ++v)
        if (rows.counts(v)) from[place++] = v;
    if (threadIdx.x == 0) differing = 0;
    __syncthreads();
    share = Share(n);
    // Digits in which no keys differ are passed over.
    if (share.begin < share.end) {
        std::int64_t const some = rows.key(from[0]);
        unsigned long long others = 0;
        for (unsigned i = share.begin; i < share.end; ++i)
            others |= static_cast<unsigned long long>(rows.key(from[i]) ^ some);
        if (others != 0) atomicOr(&differing, others);
    }
    __syncthreads();
    unsigned long long const all_differing = differing;
    bool in_spare = false;
    for (int shift = 0; shift < 64; shift += bits_of_digit) {
        if ((all_differing >> shift & (digits - 1)) == 0) continue;
        auto const digit = [&](unsigned voxel) {
            return static_cast<unsigned>(static_cast<unsigned long long>(rows.key(voxel)) >> shift & (digits - 1));
        };
        for (int d = 0; d < digits; ++d) counts[d * block + threadIdx.x] = 0;
        for (unsigned i = share.begin; i < share.end; ++i) ++counts[digit(from[i]) * block + threadIdx.x];
        __syncthreads();
        unsigned* const some = counts + digits * threadIdx.x; // so many that follow each other
        unsigned sum = 0, all = 0;
        for (int k = 0; k < digits; ++k) sum += some[k];
        unsigned before = driver::sum_before<block>(sum, all);
        for (int k = 0; k < digits; ++k) {
            unsigned const count = some[k];
            some[k] = before;
            before += count;
        }
        __syncthreads();
        for (unsigned i = share.begin; i < share.end; ++i) to[counts[digit(from[i]) * block + threadIdx.x]++] = from[i];
        __syncthreads();
        unsigned* const was = from;
        from = to;
        to = was;
        in_spare = !in_spare;
    }
    auto const begins = [&](unsigned i) { return i == 0 || rows.key(from[i]) != rows.key(from[i - 1]); };
    mine = 0;
    for (unsigned i = share.begin; i < share.end; ++i) mine += begins(i) ? 1 : 0;
    unsigned found = 0;
    place = driver::sum_before<block>(mine, found);
    for (unsigned i = share.begin; i < share.end; ++i)
        if (begins(i)) to[place++] = i;
    if (threadIdx.x == 0) sorted[blockIdx.x] = {n, found, in_spare};
}

struct Factors {
    ValueMap map;
    bool mapped;
};

/// Groups of sorted blocks; `before`: groups before each block and, at last, in all.
template <class T>
__global__ void __launch_bounds__(summing)
    sorted_kernel(__grid_constant__ BlockGroups const groups, View<T const> in, Factors factors, Lists lists,
                  SortedBlock const* sorted, std::int64_t first, unsigned const* before, std::int64_t count,
                  std::int64_t first_sorted, GroupInBlock* out) {
    std::int64_t const group = static_cast<std::int64_t>(blockIdx.x) * summing + threadIdx.x;
    if (group >= before[count]) return;
    std::int64_t low = 0, high = count; // the last block that has no more before it
    while (high - low > 1) {
        std::int64_t const middle = (low + high) / 2;
        (before[middle] <= group ? low : high) = middle;
    }
    std::int64_t const i = first_sorted + low;
    SortedBlock const block_sorted = sorted[i];
    unsigned const *voxels = lists.voxels(i, block_sorted), *begins = lists.begins(i, block_sorted);
    auto const own = static_cast<unsigned>(group - before[low]);
    unsigned const begin = begins[own], end = own + 1 < block_sorted.groups ? begins[own + 1] : block_sorted.voxels;
    RowBlock const rows(groups, first + low);
    T const* const from = in.data + rows.y * in.row + rows.z * in.slice;
    RunningSums<T, DeviceNumbers> sums;
    for (unsigned k = begin; k < end; ++k) {
        unsigned const v = voxels[k];
        std::int64_t const r = rows.row(v);
        sums.add(from[v - r * rows.width + r * in.row], v, factors.map, factors.mapped);
    }
    out[group] = {rows.key(voxels[begin]), first + low, sums.sums()};
}

/// Blocks that are one group each; of none if no voxel counts.
template <class T>
__global__ void __launch_bounds__(summing)
    whole_kernel(__grid_constant__ BlockGroups const groups, View<T const> in, Factors factors, std::int64_t first,
                 std::int64_t count, GroupInBlock* out) {
    std::int64_t const i = static_cast<std::int64_t>(blockIdx.x) * summing + threadIdx.x;
    if (i >= count) return;
    std::int64_t const z = groups.blocks.z(first + i), y0 = groups.blocks.first_row(first + i),
                       rows = groups.blocks.rows_of(first + i), width = groups.blocks.dims.x;
    RunningSums<T, DeviceNumbers> sums;
    for (std::int64_t r = 0; r < rows; ++r) {
        T const* const row = in.data + (y0 + r) * in.row + z * in.slice;
        for (std::int64_t x = 0; x < width; ++x)
            if (groups.counts(x, y0 + r, z)) sums.add(row[x], r * width + x, factors.map, factors.mapped);
    }
    out[i] = {groups.key(0, y0, z), first + i, sums.sums()};
}

unsigned blocks_for(std::int64_t threads, int of) { return static_cast<unsigned>((threads + of - 1) / of); }

using Visit = std::function<void(std::vector<GroupInBlock> const&)>;

void tell(GroupInBlock const* on_device, std::int64_t count, Visit const& visit) {
    std::vector<GroupInBlock> groups(static_cast<std::size_t>(count));
    copy_to_host(groups.data(), on_device, groups.size() * sizeof(GroupInBlock));
    std::erase_if(groups, [](GroupInBlock const& group) {
        auto const& sums = group.sums;
        return sums.finite + sums.nan + sums.above + sums.below == 0;
    });
    visit(groups);
}

template <class T>
void sum_whole(BlockGroups const& groups, View<T const> in, Factors const& factors, std::int64_t most,
               Visit const& visit) {
    std::int64_t const together = std::min(groups.blocks.count, std::max<std::int64_t>(1, most));
    driver::DeviceScratch const memory(static_cast<std::size_t>(together) * sizeof(GroupInBlock));
    auto* const out = reinterpret_cast<GroupInBlock*>(memory.get());
    for (std::int64_t first = 0; first < groups.blocks.count; first += together) {
        std::int64_t const n = std::min(together, groups.blocks.count - first);
        whole_kernel<T><<<blocks_for(n, summing), summing>>>(groups, in, factors, first, n, out);
        check_launch("statistics of groups");
        tell(out, n, visit);
    }
}

template <class T>
void sum_sorted(BlockGroups const& groups, View<T const> in, Factors const& factors, std::int64_t most,
                Visit const& visit) {
    std::int64_t const each = groups.blocks.rows * groups.blocks.dims.x;
    if (each >> 32 != 0) throw Error(ErrorKind::resources, "rows are too long for a GPU", "use --device cpu");
    std::int64_t const together = std::clamp<std::int64_t>(sorted_at_once / each, 1, groups.blocks.count);
    auto const bytes = static_cast<std::size_t>(together * each) * sizeof(unsigned);
    driver::DeviceScratch const order(bytes), spare(bytes),
        sorted_memory(static_cast<std::size_t>(together) * sizeof(SortedBlock));
    Lists const lists{reinterpret_cast<unsigned*>(order.get()), reinterpret_cast<unsigned*>(spare.get()), each};
    auto* const sorted = reinterpret_cast<SortedBlock*>(sorted_memory.get());
    std::vector<SortedBlock> found(static_cast<std::size_t>(together));
    for (std::int64_t first = 0; first < groups.blocks.count; first += together) {
        std::int64_t const n = std::min(together, groups.blocks.count - first);
        sort_kernel<<<static_cast<unsigned>(n), block>>>(groups, first, lists, sorted);
        check_launch("sorting of groups");
        copy_to_host(found.data(), sorted, static_cast<std::size_t>(n) * sizeof(SortedBlock));
        for (std::int64_t begin = 0, end = 0; begin < n; begin = end) {
            std::vector<unsigned> before{0};
            for (; end < n; ++end) {
                std::int64_t const with = std::int64_t{before.back()} + found[static_cast<std::size_t>(end)].groups;
                if (end > begin && with > most) break;
                before.push_back(static_cast<unsigned>(with));
            }
            std::int64_t const count = before.back();
            if (count == 0) continue;
            driver::DeviceList<unsigned> const list(before);
            driver::DeviceScratch const memory(static_cast<std::size_t>(count) * sizeof(GroupInBlock));
            auto* const out = reinterpret_cast<GroupInBlock*>(memory.get());
            sorted_kernel<T><<<blocks_for(count, summing), summing>>>(groups, in, factors, lists, sorted, first + begin,
                                                                      list.get(), end - begin, begin, out);
            check_launch("statistics of groups");
            tell(out, count, visit);
        }
    }
}

} // namespace

void grouped_sums(GroupedSlab const& slab, std::int64_t rows, std::int64_t most, Visit const& visit, Execution const&) {
    BlockGroups const groups{Groups(slab), RowBlocks(slab.voxels.dims(), rows)};
    Factors const factors{slab.map, !(slab.map == ValueMap{})};
    bool const one_each = slab.by == GroupedBy::volume || slab.by == GroupedBy::z;
    with_type(slab.voxels.type, [&]<class T>(T) {
        View<T const> const in = slab.voxels.as<T>();
        if (one_each)
            sum_whole<T>(groups, in, factors, most, visit);
        else
            sum_sorted<T>(groups, in, factors, most, visit);
    });
}

} // namespace VKT_BACKEND

} // namespace vkt
