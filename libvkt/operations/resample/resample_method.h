// Ways to resample, by their names.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/parameters.h"
#include "libvkt/operations/resample/kernels/affine.h"
#include "libvkt/operations/resample/resample_weights.h"

#include <array>

namespace vkt {

enum class ResampleMethod : std::uint8_t {
    automatic,
    nearest,
    linear,
    area,
    cubic,
    bspline3,
    bspline5,
    lanczos3,
    basis,
    average,
};
template <> struct EnumNames<ResampleMethod> {
    static std::vector<std::pair<ResampleMethod, char const*>> all() {
        return {{ResampleMethod::automatic, "auto"},    {ResampleMethod::nearest, "nearest"},
                {ResampleMethod::linear, "linear"},     {ResampleMethod::area, "area"},
                {ResampleMethod::cubic, "cubic"},       {ResampleMethod::bspline3, "bspline3"},
                {ResampleMethod::bspline5, "bspline5"}, {ResampleMethod::lanczos3, "lanczos3"},
                {ResampleMethod::basis, "basis"},       {ResampleMethod::average, "average"}};
    }
};

/// What a method does at one position, and along an axis on its own.
struct InterpolantOf {
    ResampleMethod method;
    Interpolant interpolant;
    ResampleKernel kernel;
    bool has_lobes; ///< negative weights: results can leave the range of the input
};
inline constexpr std::array<InterpolantOf, 6> interpolants{
    {{ResampleMethod::nearest, Interpolant::nearest, ResampleKernel::nearest, false},
     {ResampleMethod::linear, Interpolant::linear, ResampleKernel::linear, false},
     {ResampleMethod::cubic, Interpolant::cubic, ResampleKernel::cubic, true},
     {ResampleMethod::bspline3, Interpolant::bspline3, ResampleKernel::bspline3, true},
     {ResampleMethod::bspline5, Interpolant::bspline5, ResampleKernel::bspline5, true},
     {ResampleMethod::lanczos3, Interpolant::lanczos3, ResampleKernel::lanczos3, true}}};

/// nullptr for the methods that are none, and sample linearly.
constexpr InterpolantOf const* interpolant_of(ResampleMethod method) {
    for (InterpolantOf const& entry : interpolants)
        if (entry.method == method) return &entry;
    return nullptr;
}
constexpr bool has_lobes(ResampleMethod method) {
    auto const* const found = interpolant_of(method);
    return found != nullptr && found->has_lobes;
}
/// How one axis is resampled, whose voxels become `width` input voxels wide.
constexpr ResampleKernel kernel_for(ResampleMethod method, double width) {
    if (auto const* const found = interpolant_of(method)) return found->kernel;
    return method == ResampleMethod::area || width > 1 ? ResampleKernel::area : ResampleKernel::linear;
}

} // namespace vkt
