// Arithmetic that settles what would round twice, on GPUs: a thread settles its own voxels.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/arithmetic_settled.h"

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/voxels/kernels/settled.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// A volume or a number.
struct Side {
    driver::DeviceRows rows;
    bool voxels;
    double number;
    ExactNumber exact_number;
    double inexact_from;

    template <class C> __device__ __forceinline__ C value(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return voxels ? driver::load_value<C>(rows.type, rows.at(x, y, z)) : static_cast<C>(number);
    }
    __device__ __forceinline__ ExactNumber exact(std::int64_t x, std::int64_t y, std::int64_t z) const {
        ExactNumber result = exact_number;
        if (!voxels) return result;
        with_type(rows.type, [&]<class T>(T) { result = exact_voxel(*reinterpret_cast<T const*>(rows.at(x, y, z))); });
        return result;
    }
    template <class C> __device__ __forceinline__ bool is_inexact(C v) const {
        return (v < C(0) ? -v : v) >= static_cast<C>(inexact_from);
    }
};

template <class C> struct Settled {
    ArithmeticOp op;
    Side a, b;
    driver::DeviceRows out;

    __device__ __forceinline__ bool is_settled_by(C u, C v, C result, bool may_be_off) const {
        bool const picks = op == ArithmeticOp::min || op == ArithmeticOp::max;
        if (a.is_inexact(u) || b.is_inexact(v)) return false;
        return picks || is_comparison(op) || !may_be_off || is_exact(op, u, v, result);
    }
    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts& counts) const {
        C const u = a.template value<C>(x, y, z), v = b.template value<C>(x, y, z), result = combined_of(op, u, v);
        with_type(out.type, [&]<class T>(T) {
            T* const to = reinterpret_cast<T*>(out.at(x, y, z));
            if (is_settled_by(u, v, result, may_round_twice<T>(result))) {
                counts.clipped += is_clipped<T>(result) ? 1 : 0;
                counts.nan += is_lost_nan<T>(result) ? 1 : 0;
                *to = round_to<T>(result);
            } else {
                *to = settle<T>(op, out.type, static_cast<double>(u), static_cast<double>(v), a.exact(x, y, z),
                                b.exact(x, y, z), counts);
            }
        });
    }
};

Side side_of(ExactOperand const& operand, Box const& box) {
    bool const voxels = operand.view != nullptr;
    return {voxels ? driver::device_rows(*operand.view, box) : driver::DeviceRows{}, voxels, operand.number,
            operand.exact_number, operand.inexact_from};
}

} // namespace

void arithmetic_settled(ArithmeticOp op, bool in_float, ExactOperand const& a, ExactOperand const& b, AnyView out,
                        Losses& losses, Execution const&) {
    Box const box = out.box;
    Side const u = side_of(a, box), v = side_of(b, box);
    driver::DeviceRows const to = driver::device_rows(out, box);
    driver::DeviceLosses const counts;
    if (in_float)
        driver::for_each_voxel(box.dims(), Settled<float>{op, u, v, to}, counts.get(), "settled arithmetic");
    else
        driver::for_each_voxel(box.dims(), Settled<double>{op, u, v, to}, counts.get(), "settled arithmetic");
    counts.add_to(losses);
}

} // namespace VKT_BACKEND

} // namespace vkt
