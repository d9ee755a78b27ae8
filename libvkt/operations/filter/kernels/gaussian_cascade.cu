// Gaussian by way of a coarser lattice, GPU: all of a region axis by axis, as CPUs do its rows.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/gaussian_cascade.h"

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"

#include <array>
#include <memory>
#include <type_traits>
#include <vector>

namespace vkt::VKT_BACKEND {
namespace {

/// Values in device memory, as a box of voxels or nodes has them.
template <class V> struct Lattice {
    V* data = nullptr;
    Index3 lower, upper;
    std::int64_t row = 0, slice = 0;

    template <int Axis> __device__ __forceinline__ std::int64_t stride() const {
        return Axis == 0 ? 1 : Axis == 1 ? row : slice;
    }
    __device__ __forceinline__ V* at(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return data + (x - lower.x) + (y - lower.y) * row + (z - lower.z) * slice;
    }
};
template <int Axis> __device__ __forceinline__ std::int64_t along(Index3 const& i) {
    return Axis == 0 ? i.x : Axis == 1 ? i.y : i.z;
}

/// A dense lattice and its memory.
template <class C> class Stage {
public:
    explicit Stage(Box const& box) : box_(box), memory_(static_cast<std::size_t>(box.voxels()) * sizeof(C)) {}
    Box const& box() const { return box_; }
    Lattice<C> lattice() const { return as<C>(); }
    Lattice<C const> values() const { return as<C const>(); }

private:
    template <class V> Lattice<V> as() const {
        Index3 const n = box_.dims();
        return {reinterpret_cast<V*>(memory_.get()), box_.lower, box_.upper, n.x, n.x * n.y};
    }

    Box box_;
    driver::DeviceScratch memory_;
};

/// Voxels become a quarter of themselves (see gaussian_scale), values stay.
template <class C, bool Voxels, class V> __device__ __forceinline__ C value_of(V v) {
    return Voxels ? C(gaussian_scale) * static_cast<C>(v) : static_cast<C>(v);
}

/// Nested averages (see GaussianTaps) along an axis around every step-th value.
template <int Axis, class V, class C, bool Voxels> struct Thinned {
    Lattice<V const> from;
    Lattice<C> to;
    std::int64_t step, n; ///< n: voxels of the volume along the axis
    Boundary boundary;
    C border;
    int radius;
    C const* shares;

    /// One by one, for radii that shared memory has no room for.
    __device__ __forceinline__ void operator()(std::int64_t i, std::int64_t j, std::int64_t k,
                                               driver::LossCounts&) const {
        Index3 at{to.lower.x + i, to.lower.y + j, to.lower.z + k};
        C* const result = to.at(at.x, at.y, at.z);
        std::int64_t const middle = along<Axis>(at) * step, stride = from.template stride<Axis>();
        (Axis == 0 ? at.x : Axis == 1 ? at.y : at.z) = along<Axis>(from.lower);
        V const* const line = from.at(at.x, at.y, at.z);
        C sum = value(line, middle - radius, stride) + value(line, middle + radius, stride);
        for (int d = radius - 1; d >= 0; --d) {
            C const pair = value(line, middle - d, stride) + value(line, middle + d, stride);
            sum = madd(shares[d], pair - sum, sum);
        }
        *result = C(0.5) * sum;
    }
    /// Where a value of a line lies, -1 for the border value.
    __device__ __forceinline__ std::int64_t place(std::int64_t index) const {
        std::int64_t const first = along<Axis>(from.lower);
        if (index >= first && index < along<Axis>(from.upper)) return index - first;
        std::int64_t const source = fold(index, n, boundary);
        return source < 0 ? -1 : source - first;
    }
    __device__ __forceinline__ C value(V const* line, std::int64_t index, std::int64_t stride) const {
        std::int64_t const at = place(index);
        return at < 0 ? border : value_of<C, Voxels>(line[at * stride]);
    }
};

/// Shared memory is read and written by blocks of 64 by 4 threads, each of which has to do with four lines at once:
/// what they have in common is computed once, and four loads are on their way.
constexpr int tile_width = 64, tile_height = 4, at_once = 4, made = tile_height * at_once;
constexpr std::int64_t usual_tile = 48 << 10, largest_tile = 200 << 10; ///< bytes of shared memory

/// Nested averages (see GaussianTaps) of four lines, from outside: after begin(k), pair(u, below, above) sets the
/// values k - u before and after each line's middle. Some follow one begin(), so that their places are known from its.
template <class C, class Begin, class Pair>
__device__ __forceinline__ void nested_averages(int radius, C const* shares, Begin const& begin, Pair const& pair,
                                                C (&sum)[at_once]) {
    constexpr int together = 4;
    C below[at_once], above[at_once];
    begin(radius);
    pair(0, below, above);
#pragma unroll
    for (int j = 0; j < at_once; ++j) sum[j] = below[j] + above[j];
    auto const next = [&](int k, int u) {
        pair(u, below, above);
        C const share = shares[k - u];
#pragma unroll
        for (int j = 0; j < at_once; ++j) sum[j] = madd(share, below[j] + above[j] - sum[j], sum[j]);
    };
    int k = radius - 1;
    for (; k >= together - 1; k -= together) {
        begin(k);
#pragma unroll
        for (int u = 0; u < together; ++u) next(k, u);
    }
    for (; k >= 0; --k) {
        begin(k);
        next(k, 0);
    }
#pragma unroll
    for (int j = 0; j < at_once; ++j) sum[j] *= C(0.5);
}

/// Along y or z: a block makes some values of each of its columns, of what it has read once.
template <int Axis, class V, class C, bool Voxels>
__global__ void __launch_bounds__(tile_width* tile_height)
    thin_columns(__grid_constant__ Thinned<Axis, V, C, Voxels> const f, driver::Blocks blocks) {
    extern __shared__ unsigned char shared[];
    int const lane = threadIdx.x, row = threadIdx.y, r = f.radius, step = static_cast<int>(f.step);
    C* const tile = reinterpret_cast<C*>(shared);
    C* const shares = tile + ((made - 1) * step + 2 * r + 1) * tile_width;
    for (int k = row * tile_width + lane; k < r; k += tile_width * tile_height) shares[k] = f.shares[k];
    std::int64_t const first = along<Axis>(f.to.lower) +
                               static_cast<std::int64_t>(blockIdx.x / blocks.across % blocks.along) * made,
                       end = min(first + made, along<Axis>(f.to.upper));
    Index3 at = f.from.lower;
    at.x =
        min(f.to.lower.x + static_cast<std::int64_t>(blockIdx.x % blocks.across) * tile_width + lane, f.to.upper.x - 1);
    (Axis == 1 ? at.z : at.y) = (Axis == 1 ? f.to.lower.z : f.to.lower.y) + blockIdx.x / blocks.across / blocks.along;
    V const* const line = f.from.at(at.x, at.y, at.z);
    std::int64_t const stride = f.from.template stride<Axis>(), begin = first * step - r;
    int const needed = static_cast<int>(end - 1 - first) * step + 2 * r + 1;
    if (begin >= along<Axis>(f.from.lower) && begin + needed <= along<Axis>(f.from.upper)) {
        V const* source = line + (begin - along<Axis>(f.from.lower) + row) * stride;
        int i = row;
        for (; i + (at_once - 1) * tile_height < needed; i += at_once * tile_height) {
            V voxels[at_once];
#pragma unroll
            for (int k = 0; k < at_once; ++k, source += tile_height * stride) voxels[k] = *source;
#pragma unroll
            for (int k = 0; k < at_once; ++k)
                tile[(i + k * tile_height) * tile_width + lane] = value_of<C, Voxels>(voxels[k]);
        }
        for (; i < needed; i += tile_height, source += tile_height * stride)
            tile[i * tile_width + lane] = value_of<C, Voxels>(*source);
    } else {
        for (int i = row; i < needed; i += tile_height) tile[i * tile_width + lane] = f.value(line, begin + i, stride);
    }
    __syncthreads();
    (Axis == 1 ? at.y : at.z) = first;
    C* const to = f.to.at(at.x, at.y, at.z);
    int const apart = tile_height * step * tile_width, count = static_cast<int>(end - first);
    // Values beyond the last one are made of what happens to be there, and not stored.
    C const* const middle = tile + (row * step + r) * tile_width + lane;
    C const *low[at_once], *high[at_once];
    C sum[at_once];
    nested_averages(
        r, shares,
        [&](int k) {
#pragma unroll
            for (int j = 0; j < at_once; ++j) {
                low[j] = middle + j * apart - k * tile_width;
                high[j] = middle + j * apart + k * tile_width;
            }
        },
        [&](int u, C(&below)[at_once], C(&above)[at_once]) {
#pragma unroll
            for (int j = 0; j < at_once; ++j) below[j] = low[j][u * tile_width], above[j] = high[j][-u * tile_width];
        },
        sum);
#pragma unroll
    for (int j = 0; j < at_once; ++j)
        if (row + j * tile_height < count) to[(row + j * tile_height) * f.to.template stride<Axis>()] = sum[j];
}

/// Values of a phase that lie side by side, for rows of so many.
VKT_HD int phase_pitch(int wide, std::int64_t step) {
    int const pitch = (wide + static_cast<int>(step) - 1) / static_cast<int>(step);
    // Of four phases stored at once, as of most, none meets another's banks.
    return (pitch + 31 - 8) / 32 * 32 + 8;
}

/// Along x: rows lie in shared memory phase by phase, so that neighbours of neighbouring results are neighbours.
template <class V, class C, bool Voxels>
__global__ void __launch_bounds__(tile_width* tile_height)
    thin_rows(__grid_constant__ Thinned<0, V, C, Voxels> const f, driver::Blocks blocks) {
    extern __shared__ unsigned char shared[];
    int const lane = threadIdx.x, row = threadIdx.y * at_once, r = f.radius;
    auto const step = static_cast<unsigned>(f.step);
    int const pitch = phase_pitch((tile_width - 1) * static_cast<int>(step) + 2 * r + 1, f.step),
              size = pitch * static_cast<int>(step);
    C* const tile = reinterpret_cast<C*>(shared) + row * size; // the first of this thread's rows
    C* const shares = reinterpret_cast<C*>(shared) + tile_height * at_once * size;
    for (int k = threadIdx.y * tile_width + lane; k < r; k += tile_width * tile_height) shares[k] = f.shares[k];
    std::int64_t const first = f.to.lower.x + static_cast<std::int64_t>(blockIdx.x % blocks.across) * tile_width,
                       end = min(first + tile_width, f.to.upper.x), begin = first * f.step - r,
                       y = f.to.lower.y + static_cast<std::int64_t>(blockIdx.x / blocks.across % blocks.along) * made +
                           row,
                       z = f.to.lower.z + blockIdx.x / blocks.across / blocks.along;
    V const* line[at_once];
#pragma unroll
    for (int j = 0; j < at_once; ++j) line[j] = f.from.at(f.from.lower.x, min(y + j, f.to.upper.y - 1), z);
    int const needed = static_cast<int>(end - 1 - first) * static_cast<int>(step) + 2 * r + 1;
    for (int i = lane; i < needed; i += tile_width) {
        unsigned const slot = static_cast<unsigned>(i) / step, phase = static_cast<unsigned>(i) - slot * step;
        std::int64_t const from = f.place(begin + i);
        V voxels[at_once];
#pragma unroll
        for (int j = 0; j < at_once; ++j) voxels[j] = line[j][max(from, std::int64_t{0})];
        C* const to = tile + phase * pitch + slot;
#pragma unroll
        for (int j = 0; j < at_once; ++j) to[j * size] = from < 0 ? f.border : value_of<C, Voxels>(voxels[j]);
    }
    __syncthreads();
    if (first + lane >= end) return;
    // Of the pair that comes next: where it lies below and above the middle.
    unsigned low = 0, low_phase = 0, high = 2 * static_cast<unsigned>(r) / step,
             high_phase = 2 * static_cast<unsigned>(r) - high * step;
    C sum[at_once];
    nested_averages(
        r, shares, [](int) {},
        [&](int, C(&below)[at_once], C(&above)[at_once]) {
            C const *a = tile + low_phase * pitch + low + lane, *b = tile + high_phase * pitch + high + lane;
#pragma unroll
            for (int j = 0; j < at_once; ++j, a += size, b += size) below[j] = *a, above[j] = *b;
            if (++low_phase == step) low_phase = 0, ++low;
            if (high_phase-- == 0) high_phase = step - 1, --high;
        },
        sum);
#pragma unroll
    for (int j = 0; j < at_once; ++j)
        if (y + j < f.to.upper.y) *f.to.at(first + lane, y + j, z) = sum[j];
}

/// Splines read off at voxels along an axis, from as many nodes as the degree asks for.
template <int Taps, class T, class C> struct Spline {
    C const* shares; ///< of each phase
    C factor;

    /// Those of one phase, in registers.
    struct Phase {
        C share[Taps > 1 ? Taps - 1 : 1];
    };
    __device__ __forceinline__ Phase phase(std::int64_t which) const {
        Phase result;
#pragma unroll
        for (int t = 0; t + 1 < Taps; ++t) result.share[t] = shares[which * (Taps - 1) + t];
        return result;
    }
    __device__ __forceinline__ T at(C const* nodes, Phase const& own) const {
        C sum = nodes[0];
#pragma unroll
        for (int t = 1; t < Taps; ++t) {
            int const tap = t % 2 == 0 ? t / 2 : Taps - 1 - t / 2; // CascadeAxis::tap()
            sum = madd(own.share[t - 1], nodes[tap] - sum, sum);
        }
        if constexpr (std::is_same_v<T, C>)
            return factor * sum;
        else
            return round_to<T>(factor * sum);
    }
};

/// A thread reads off the voxels of one place along x, in some rows: their phase is the same.
template <int Taps, class T, class C> struct RefinedRows {
    static constexpr int rows = 4, blocks_at_once = 4;

    Lattice<C const> from;
    Lattice<T> to;
    std::int64_t step, left;
    std::int64_t first; ///< node, at or before the first voxel
    Spline<Taps, T, C> spline;

    Index3 items() const {
        Index3 const n = to.upper - to.lower;
        return {n.x, (n.y + rows - 1) / rows, n.z};
    }
    __device__ __forceinline__ void operator()(std::int64_t i, std::int64_t j, std::int64_t k,
                                               driver::LossCounts&) const {
        std::int64_t const x = to.lower.x + i, y = to.lower.y + j * rows, z = to.lower.z + k;
        std::int64_t const node = first + driver::quotient_of(x - first * step, step);
        auto const phase = spline.phase(x - node * step);
        C const* source = from.at(node - left, y, z);
        T* result = to.at(x, y, z);
        C nodes[rows][Taps];
#pragma unroll
        for (int r = 0; r < rows; ++r) {
#pragma unroll
            for (int t = 0; t < Taps; ++t) nodes[r][t] = source[t];
            if (y + r + 1 < to.upper.y) source += from.row; // there are no more
        }
#pragma unroll
        for (int r = 0; r < rows; ++r, result += to.row)
            if (y + r < to.upper.y) *result = spline.at(nodes[r], phase);
    }
};

/// Along y and z a thread reads off the voxels from some nodes to the next ones, phase by phase.
template <int Axis, int Taps, class T, class C> struct RefinedColumns {
    static constexpr int at_once = 8; ///< nodes

    Lattice<C const> from;
    Lattice<T> to;
    std::int64_t step, left;
    std::int64_t first; ///< node, at or before the first voxel
    Spline<Taps, T, C> spline;

    /// What there is to do, one after the other along the axis.
    Index3 items() const {
        Index3 n = to.upper - to.lower;
        n[Axis] = ((to.upper[Axis] - 1 - first * step) / step + at_once) / at_once;
        return n;
    }
    __device__ __forceinline__ void operator()(std::int64_t i, std::int64_t j, std::int64_t k,
                                               driver::LossCounts&) const {
        Index3 at{to.lower.x + i, to.lower.y + j, to.lower.z + k};
        std::int64_t const node = first + (Axis == 1 ? j : k) * at_once, last = along<Axis>(from.upper) - 1;
        (Axis == 1 ? at.y : at.z) = node - left;
        C const* const source = from.at(at.x, at.y, at.z);
        std::int64_t const there = last - (node - left), stride = from.template stride<Axis>();
        C nodes[at_once + Taps - 1];
#pragma unroll
        for (int t = 0; t < at_once + Taps - 1; ++t)
            nodes[t] = source[min(static_cast<std::int64_t>(t), there) * stride];
        (Axis == 1 ? at.y : at.z) = along<Axis>(to.lower);
        T* const line = to.at(at.x, at.y, at.z); // its first voxel
        std::int64_t const begin = along<Axis>(to.lower), size = along<Axis>(to.upper) - begin,
                           along_line = to.template stride<Axis>(), apart = step * along_line;
        for (std::int64_t p = 0; p < step; ++p) {
            auto const phase = spline.phase(p);
            std::int64_t voxel = node * step + p - begin;
            T* result = line + voxel * along_line;
#pragma unroll
            for (int n = 0; n < at_once; ++n, voxel += step, result += apart)
                if (static_cast<std::uint64_t>(voxel) < static_cast<std::uint64_t>(size)) // and not below 0
                    *result = spline.at(nodes + n, phase);
        }
    }
};

/// One run: stages follow one another, and each is freed, in the order of the stream, when the next one is made.
template <class T, class C> class Cascade {
public:
    Cascade(CascadePasses const& passes, ConstView in, AnyView out)
        : passes_(passes), in_(in), out_(out), shares_(passes.cascade->axes), list_(shares_.values) {}

    void run() {
        Box const input = cascade_input(passes_, out_.box);
        ConstView const part = in_.part(input);
        Lattice<T const> const voxels{reinterpret_cast<T const*>(part.data), input.lower, input.upper, part.row,
                                      part.slice};
        Made stage = thinned<1, T, true>(voxels, input, axis(1).step, axis(1).before, shares_.before[1], wide(1));
        stage = thinned<0>(*stage, axis(0).step, axis(0).before, shares_.before[0], wide(0));
        stage = thinned<2>(*stage, axis(2).step, axis(2).before, shares_.before[2], wide(2));
        if (axis(1).coarse.radius > 0) stage = thinned<1>(*stage, 1, axis(1).coarse, shares_.coarse[1], nodes(1));
        if (axis(0).coarse.radius > 0) stage = thinned<0>(*stage, 1, axis(0).coarse, shares_.coarse[0], nodes(0));
        if (axis(2).coarse.radius > 0) stage = thinned<2>(*stage, 1, axis(2).coarse, shares_.coarse[2], nodes(2));
        if (axis(2).step > 1) stage = refined<2>(*stage);
        if (axis(0).step > 1) stage = refined<0>(*stage);
        Lattice<T> const result{reinterpret_cast<T*>(out_.data), out_.box.lower, out_.box.upper, out_.row, out_.slice};
        refine<1>(stage->values(), result, C(4));
    }

private:
    using Made = std::unique_ptr<Stage<C>>;

    /// The shares of all axes, one list after the other.
    struct Shares {
        explicit Shares(std::array<CascadeAxis, 3> const& axes) {
            for (std::size_t i = 0; i < 3; ++i) {
                before[i] = add(axes[i].before.shares, axes[i].before.single_shares);
                coarse[i] = add(axes[i].coarse.shares, axes[i].coarse.single_shares);
                refining[i] = add(axes[i].shares, axes[i].single_shares);
            }
        }
        std::size_t add(std::vector<double> const& wide, std::vector<float> const& single) {
            std::size_t const first = values.size();
            if constexpr (std::is_same_v<C, float>)
                values.insert(values.end(), single.begin(), single.end());
            else
                values.insert(values.end(), wide.begin(), wide.end());
            return first;
        }
        std::vector<C> values;
        std::array<std::size_t, 3> before{}, coarse{}, refining{};
    };

    CascadeAxis const& axis(int i) const { return passes_.cascade->axes[static_cast<std::size_t>(i)]; }
    Span span(int i) const { return {out_.box.lower[i], out_.box.upper[i]}; }
    Span wide(int i) const { return wide_nodes_under(axis(i), span(i)); }
    Span nodes(int i) const { return nodes_under(axis(i), span(i)); }

    template <int Axis, class V, bool Voxels>
    Made thinned(Lattice<V const> const& from, Box box, std::int64_t step, GaussianTaps const& taps, std::size_t shares,
                 Span const& span) const {
        box.lower[Axis] = span.lower;
        box.upper[Axis] = span.upper;
        auto made = std::make_unique<Stage<C>>(box);
        GaussianPasses const& direct = *passes_.direct;
        Thinned<Axis, V, C, Voxels> const f{from,
                                            made->lattice(),
                                            step,
                                            direct.dims[Axis],
                                            direct.boundary,
                                            C(gaussian_scale) * static_cast<C>(direct.border_value),
                                            static_cast<int>(taps.radius),
                                            list_.get() + shares};
        thin(box.dims(), f);
        return made;
    }
    template <int Axis, class V, bool Voxels> static void thin(Index3 n, Thinned<Axis, V, C, Voxels> const& f) {
        if (n.x <= 0 || n.y <= 0 || n.z <= 0) return;
        std::int64_t const window = 2 * static_cast<std::int64_t>(f.radius) + 1;
        auto const launch = [&](auto* kernel, std::int64_t values, driver::Blocks blocks) {
            std::int64_t const bytes = (values + f.radius) * static_cast<std::int64_t>(sizeof(C));
            if (bytes > usual_tile)
                (void)cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize,
                                           static_cast<int>(bytes));
            kernel<<<blocks.all, dim3(tile_width, tile_height), static_cast<std::size_t>(bytes)>>>(f, blocks);
            check_launch("gaussian, thinned");
        };
        std::int64_t const largest = largest_tile / static_cast<std::int64_t>(sizeof(C));
        if constexpr (Axis == 0) {
            std::int64_t const wide = (tile_width - 1) * f.step + window,
                               values = wide < largest ? made * f.step * phase_pitch(static_cast<int>(wide), f.step)
                                                       : largest;
            if (values + f.radius < largest)
                return launch(&thin_rows<V, C, Voxels>, values,
                              driver::blocks_of<driver::BlockShape<tile_width, made, 1, 1>>(n));
        } else {
            std::int64_t const values = ((made - 1) * f.step + window) * tile_width;
            if (values + f.radius < largest) {
                Index3 blocks{n.x, n.y, n.z};
                if (Axis == 2) std::swap(blocks.y, blocks.z);
                return launch(&thin_columns<Axis, V, C, Voxels>, values,
                              driver::blocks_of<driver::BlockShape<tile_width, made, 1, 1>>(blocks));
            }
        }
        driver::for_each_voxel(n, f, nullptr, "gaussian, thinned");
    }
    template <int Axis>
    Made thinned(Stage<C> const& from, std::int64_t step, GaussianTaps const& taps, std::size_t shares,
                 Span const& span) const {
        return thinned<Axis, C, false>(from.values(), from.box(), step, taps, shares, span);
    }

    template <int Axis, class V> void refine(Lattice<C const> const& from, Lattice<V> const& to, C factor) const {
        if (to.upper.x <= to.lower.x || to.upper.y <= to.lower.y || to.upper.z <= to.lower.z) return;
        switch (axis(Axis).taps) {
        case 1:
            return refine_by<Axis, 1>(from, to, factor);
        case 4:
            return refine_by<Axis, 4>(from, to, factor);
        case 6:
            return refine_by<Axis, 6>(from, to, factor);
        default:
            throw Error(ErrorKind::failure, "a cascade has splines of a degree other than 3 and 5");
        }
    }
    template <int Axis, int Taps, class V>
    void refine_by(Lattice<C const> const& from, Lattice<V> const& to, C factor) const {
        CascadeAxis const& along = axis(Axis);
        using Read = std::conditional_t<Axis == 0, RefinedRows<Taps, V, C>, RefinedColumns<Axis, Taps, V, C>>;
        Read const f{from,
                     to,
                     along.step,
                     along.left,
                     floor_div(to.lower[Axis], along.step),
                     {list_.get() + shares_.refining[Axis], factor}};
        driver::for_each_voxel(f.items(), f, nullptr, "gaussian, refined");
    }
    template <int Axis> Made refined(Stage<C> const& from) const {
        Box box = from.box();
        box.lower[Axis] = span(Axis).lower;
        box.upper[Axis] = span(Axis).upper;
        auto made = std::make_unique<Stage<C>>(box);
        refine<Axis>(from.values(), made->lattice(), C(1));
        return made;
    }

    CascadePasses const& passes_;
    ConstView in_;
    AnyView out_;
    Shares shares_;
    driver::DeviceList<C> list_;
};

template <class T, class C> void run(CascadePasses const& passes, ConstView in, AnyView out) {
    Cascade<T, C>(passes, in, out).run();
}

} // namespace

void gaussian_cascade_run(CascadePasses const& passes, CascadePlanes& planes, ConstView in, AnyView out, Losses&,
                          Execution const&) {
    planes.held = false;
    if (out.box.empty()) return;
    with_type(out.type, [&]<class T>(T) {
        if constexpr (std::is_same_v<compute_t<T>, double>)
            run<T, double>(passes, in, out);
        else if (passes.direct->wide)
            run<T, double>(passes, in, out);
        else
            run<T, float>(passes, in, out);
    });
}

} // namespace vkt::VKT_BACKEND
