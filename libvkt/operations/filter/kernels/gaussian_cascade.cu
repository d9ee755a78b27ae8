// Gaussian by way of a coarser lattice, GPU: all of a region axis by axis, as CPUs do its rows.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/gaussian_cascade.h"

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"

#include <array>
#include <memory>
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

    static constexpr int blocks_at_once = 5; ///< of a multiprocessor: loads are what it waits for

    __device__ __forceinline__ void operator()(std::int64_t i, std::int64_t j, std::int64_t k,
                                               driver::LossCounts&) const {
        Index3 at{to.lower.x + i, to.lower.y + j, to.lower.z + k};
        C* const result = to.at(at.x, at.y, at.z);
        std::int64_t const middle = along<Axis>(at) * step, first = along<Axis>(from.lower);
        (Axis == 0 ? at.x : Axis == 1 ? at.y : at.z) = first;
        V const* const line = from.at(at.x, at.y, at.z);
        std::int64_t const stride = from.template stride<Axis>();
        if (middle - radius >= first && middle + radius < along<Axis>(from.upper))
            *result = average(line + (middle - first) * stride, stride);
        else
            *result = average_at_end(line, middle, stride);
    }

private:
    /// Of values that all are there.
    __device__ __forceinline__ C average(V const* centre, std::int64_t stride) const {
        if (radius == 0) return value_of<C, Voxels>(*centre);
        V const *below = centre - radius * stride, *above = centre + radius * stride;
        C sum = value_of<C, Voxels>(*below) + value_of<C, Voxels>(*above);
#pragma unroll 4
        for (int k = radius - 1; k >= 0; --k) {
            below += stride;
            above -= stride;
            C const pair = value_of<C, Voxels>(*below) + value_of<C, Voxels>(*above);
            sum = madd(shares[k], pair - sum, sum);
        }
        return C(0.5) * sum;
    }
    /// Where some are beyond the ends of a line. Apart, lest it takes registers from what nearly all threads do.
    __device__ __noinline__ C average_at_end(V const* line, std::int64_t middle, std::int64_t stride) const {
        std::int64_t const first = along<Axis>(from.lower);
        auto const value = [&](std::int64_t o) {
            std::int64_t const index = middle + o;
            bool const there = index >= first && index < along<Axis>(from.upper);
            std::int64_t const source = there ? index : fold(index, n, boundary);
            return source < 0 && !there ? border : value_of<C, Voxels>(line[(source - first) * stride]);
        };
        if (radius == 0) return value(0);
        C sum = value(-radius) + value(radius);
        for (int k = radius - 1; k >= 0; --k) {
            C const pair = value(-k) + value(k);
            sum = madd(shares[k], pair - sum, sum);
        }
        return C(0.5) * sum;
    }
};

/// Splines read off at voxels along an axis, from as many nodes as the degree asks for.
template <int Taps, class T, class C> struct Spline {
    C const* shares; ///< of each phase
    C factor;

    __device__ __forceinline__ T at(C const (&nodes)[Taps], std::int64_t phase) const {
        C const* const own = shares + phase * (Taps - 1);
        C sum = nodes[0];
#pragma unroll
        for (int t = 1; t < Taps; ++t) {
            int const tap = t % 2 == 0 ? t / 2 : Taps - 1 - t / 2; // CascadeAxis::tap()
            sum = madd(own[t - 1], nodes[tap] - sum, sum);
        }
        if constexpr (std::is_same_v<T, C>)
            return factor * sum;
        else
            return round_to<T>(factor * sum);
    }
};

/// Along x a thread reads off one voxel; along y and z those from one node to the next, of which all read the same
/// nodes.
template <int Axis, int Taps, class T, class C> struct Refined {
    Lattice<C const> from;
    Lattice<T> to;
    std::int64_t step, left;
    std::int64_t first; ///< node, at or before the first voxel
    Spline<Taps, T, C> spline;

    /// What there is to do, one after the other along the axis.
    Index3 items() const {
        Index3 n = to.upper - to.lower;
        if (Axis != 0) n[Axis] = (to.upper[Axis] - 1 - first * step) / step + 1;
        return n;
    }
    __device__ __forceinline__ void operator()(std::int64_t i, std::int64_t j, std::int64_t k,
                                               driver::LossCounts&) const {
        Index3 at{to.lower.x + i, to.lower.y + j, to.lower.z + k};
        std::int64_t const node =
            Axis == 0 ? first + driver::quotient_of(at.x - first * step, step) : first + (Axis == 1 ? j : k);
        std::int64_t const begin = Axis == 0 ? at.x : max(node * step, along<Axis>(to.lower)),
                           end = Axis == 0 ? at.x + 1 : min((node + 1) * step, along<Axis>(to.upper));
        (Axis == 0 ? at.x : Axis == 1 ? at.y : at.z) = begin;
        T* result = to.at(at.x, at.y, at.z);
        (Axis == 0 ? at.x : Axis == 1 ? at.y : at.z) = node - left;
        C const* const source = from.at(at.x, at.y, at.z);
        C nodes[Taps];
#pragma unroll
        for (int t = 0; t < Taps; ++t) nodes[t] = source[t * from.template stride<Axis>()];
        for (std::int64_t voxel = begin; voxel < end; ++voxel, result += to.template stride<Axis>())
            *result = spline.at(nodes, voxel - node * step);
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
        driver::for_each_voxel(box.dims(), f, nullptr, "gaussian, thinned");
        return made;
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
        Refined<Axis, Taps, V, C> const f{from,
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
