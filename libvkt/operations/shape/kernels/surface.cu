// Surfaces on GPUs: a warp makes a word of bits, a thread does a row as CPUs do theirs.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/kernels/surface.h"

#include "libvkt/kernel/border.h"
#include "libvkt/kernel/cuda_rows.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/shape/kernels/surface_rows.h"

#include <cstring>
#include <memory>

namespace vkt {

namespace VKT_BACKEND {
namespace {

using namespace surface;

constexpr unsigned bit_threads = 256, row_threads = 64;

/// A copy of what lies on the host in device memory, for the time of one call.
template <class T> class OnDevice {
public:
    OnDevice(T const* from, std::int64_t count) : memory_(count > 0 ? bytes(count) : sizeof(T)) {
        if (from != nullptr && count > 0) copy_to_device(memory_.get(), from, bytes(count));
    }
    T* get() const { return reinterpret_cast<T*>(memory_.get()); }
    static std::size_t bytes(std::int64_t count) { return static_cast<std::size_t>(count) * sizeof(T); }

private:
    driver::DeviceScratch memory_;
};

/// A view's voxels in device memory: where they are, or a copy.
class DeviceVoxels {
public:
    explicit DeviceVoxels(ConstView const& view) : view_(view) {
        if (view.data == nullptr || view.space == Space::device) return;
        memory_ = std::make_unique<driver::DeviceScratch>(view.bytes());
        AnyView const copy = dense_view(memory_->get(), view.type, view.box, Space::device);
        copy_region(view, copy, Execution{});
        view_ = copy;
    }
    ConstView const& view() const { return view_; }

private:
    std::unique_ptr<driver::DeviceScratch> memory_;
    ConstView view_;
};

unsigned blocks_of_threads(std::int64_t threads, unsigned a_block) {
    return launch_blocks((threads + a_block - 1) / a_block);
}

/// Nobody is inside, or everybody.
struct Always {
    bool answer;
    template <class C> VKT_HD bool operator()(C) const { return answer; }
};

/// Words of the rows of a slab's voxels, bit 0 of a row standing for its first lattice point.
template <class T, class F> struct Bits {
    T const* voxels;
    std::int64_t row, slice;
    Index3 n; ///< voxels
    std::int64_t border, words, lattice_rows;
    F inside;
    Word* to; ///< of the first slice with voxels

    __device__ __forceinline__ bool at(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return x >= 0 && x < n.x && inside(static_cast<Comparable<T>>(voxels[x + y * row + z * slice]));
    }
};

template <class T, class F>
__global__ void __launch_bounds__(bit_threads) bits_kernel(__grid_constant__ Bits<T, F> const bits) {
    std::int64_t const which = (static_cast<std::int64_t>(blockIdx.x) * bit_threads + threadIdx.x) / 32;
    if (which >= bits.words * bits.n.y * bits.n.z) return; // the whole warp
    std::int64_t const r = driver::quotient_of(which, bits.words), w = which - r * bits.words,
                       z = driver::quotient_of(r, bits.n.y), y = r - z * bits.n.y;
    std::int64_t const x = 64 * w + threadIdx.x % 32 - bits.border;
    Word const low = __ballot_sync(0xffffffffu, bits.at(x, y, z)),
               high = __ballot_sync(0xffffffffu, bits.at(x + 32, y, z));
    if (threadIdx.x % 32 == 0) bits.to[(z * bits.lattice_rows + y + bits.border) * bits.words + w] = high << 32 | low;
}

template <class T, class F> void make_bits(SurfaceSlab const& slab, ConstView const& voxels, F const& f, Word* to) {
    Index3 const n = voxels.dims();
    Bits<T, F> const bits{reinterpret_cast<T const*>(voxels.data),
                          voxels.row,
                          voxels.slice,
                          n,
                          slab.border,
                          slab.words,
                          slab.lattice.y,
                          f,
                          to};
    bits_kernel<<<blocks_of_threads(32 * slab.words * n.y * n.z, bit_threads), bit_threads>>>(bits);
    check_launch("surface bits");
}

/// Rows of slices 1, 2, …
struct LatticeRow {
    std::int64_t y, s;
    bool there;
};
__device__ __forceinline__ LatticeRow lattice_row(Index3 lattice) {
    std::int64_t const r = static_cast<std::int64_t>(blockIdx.x) * row_threads + threadIdx.x;
    std::int64_t const s = driver::quotient_of(r, lattice.y);
    return {r - s * lattice.y, s + 1, s + 1 < lattice.z};
}

__global__ void __launch_bounds__(row_threads) count_rows(__grid_constant__ SurfaceSlab const slab) {
    LatticeRow const row = lattice_row(slab.lattice);
    if (row.there) count_row(slab, row.y, row.s);
}

template <class T> __global__ void __launch_bounds__(row_threads) emit_rows(__grid_constant__ Places<T> const places) {
    SurfaceSlab const& slab = places.slab;
    LatticeRow const row = lattice_row(slab.lattice);
    if (!row.there) return;
    emit_vertices(places, row.y, row.s);
    if (has_cells(slab, row.y, row.s)) emit_triangles(slab, row.y, row.s);
}

} // namespace

void surface_bits(SurfaceSlab const& slab, Inside const& inside, Execution const&) {
    if (slab.voxels.box.empty()) return;
    DeviceVoxels const voxels(slab.voxels);
    std::int64_t const slice = slab.lattice.y * slab.words, count = slice * slab.voxels.dims().z;
    OnDevice<Word> const bits(nullptr, count);
    device_clear(bits.get(), OnDevice<Word>::bytes(count));
    with_type(slab.voxels.type, [&]<class T>(T) {
        using C = Comparable<T>;
        using enum Inside::Rule;
        C at;
        std::memcpy(&at, inside.at.data(), sizeof at);
        auto const make = [&](auto const& f) { make_bits<T>(slab, voxels.view(), f, bits.get()); };
        switch (inside.rule) {
        case nobody:
            return make(Always{false});
        case everybody:
            return make(Always{true});
        case from:
            return make(Test<from, C>{at});
        case to:
            return make(Test<to, C>{at});
        case equal:
            return make(Test<equal, C>{at});
        }
    });
    copy_to_host(slab.bits + slab.voxels_from * slice, bits.get(), OnDevice<Word>::bytes(count));
}

void surface_count(SurfaceSlab const& slab, Execution const&) {
    std::int64_t const ny = slab.lattice.y, count = ny * slab.lattice.z;
    OnDevice<Word> const bits(slab.bits, count * slab.words);
    OnDevice<SurfaceRow> const rows(nullptr, count);
    OnDevice<SurfaceCases> const cases(slab.cases, 1);
    SurfaceSlab there = slab;
    there.bits = bits.get();
    there.rows = rows.get();
    there.cases = cases.get();
    count_rows<<<blocks_of_threads(count - ny, row_threads), row_threads>>>(there);
    check_launch("surface counts");
    copy_to_host(slab.rows + ny, rows.get() + ny, OnDevice<SurfaceRow>::bytes(count - ny));
}

void surface_emit(SurfaceSlab const& slab, Inside const& inside, Execution const&) {
    std::int64_t const ny = slab.lattice.y, count = ny * slab.lattice.z;
    OnDevice<Word> const bits(slab.bits, count * slab.words);
    OnDevice<SurfaceRow> const rows(slab.rows, count);
    OnDevice<SurfaceCases> const cases(slab.cases, 1);
    OnDevice<double> const vertices(nullptr, 3 * slab.vertex_count);
    OnDevice<std::uint32_t> const triangles(nullptr, 3 * slab.triangle_count);
    DeviceVoxels const last(slab.last), voxels(slab.voxels);
    SurfaceSlab there = slab;
    there.bits = bits.get();
    there.rows = rows.get();
    there.cases = cases.get();
    there.vertices = vertices.get() - 3 * slab.first_vertex;
    there.triangles = triangles.get();
    there.last = last.view();
    there.voxels = voxels.view();
    ConstView const& any = slab.voxels.data != nullptr ? slab.voxels : slab.last;
    with_type(any.type, [&]<class T>(T) {
        emit_rows<T><<<blocks_of_threads(count - ny, row_threads), row_threads>>>(Places<T>(there, inside));
        check_launch("surface");
    });
    if (slab.vertex_count > 0)
        copy_to_host(slab.vertices + 3 * slab.first_vertex, vertices.get(),
                     OnDevice<double>::bytes(3 * slab.vertex_count));
    if (slab.triangle_count > 0)
        copy_to_host(slab.triangles, triangles.get(), OnDevice<std::uint32_t>::bytes(3 * slab.triangle_count));
}

} // namespace VKT_BACKEND

} // namespace vkt
