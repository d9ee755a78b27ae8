// Separable analytic fields with exact averages, and the features that synthetic trees refine towards.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/make_amr.h"

#include <vector>

namespace vkt::analytic {

/// One factor of a separable term along one axis; positions in finest cells.
struct Factor {
    enum class Shape : std::uint8_t { one, linear, sech_squared, gaussian, wave } shape = Shape::one;
    double centre = 0, scale = 1; ///< value at p: shape((p - centre) / scale)

    double value(double p) const;
    double average(double low, double high) const;
};

struct Term {
    double amplitude = 1;
    Factor factor[3];
};

/// The field is the sum of these.
std::vector<Term> terms_of(AmrField field, Index3 logical_dims);

/// Distance of a box from the nearest feature that refines to `levels_to_finest` steps before the finest level, in
/// units of the domain's x extent; `extent` is the domain in these units.
double feature_distance(Vec3 lower, Vec3 upper, Vec3 extent, int levels_to_finest);

} // namespace vkt::analytic
