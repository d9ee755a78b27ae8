// Sums along z of Fourier transforms of slices, weighted by those of a kernel's slices.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/backend.h"

#include <complex>
#include <cstdint>

namespace vkt {

/// Points of a group: what is summed up together in registers.
inline constexpr std::int64_t spectra_lanes = 16;

/// Transforms of `slots` slices of `area` points, a multiple of spectra_lanes: group by group, and of each group all
/// slices one after another, their real parts before the imaginary ones. So what a sum is made of lies together.
struct SpectraLayout {
    std::int64_t area, slots;
    std::int64_t at(std::int64_t group, std::int64_t slot) const { return (group * slots + slot) * 2 * spectra_lanes; }
    std::int64_t doubles() const { return 2 * area * slots; }
};

/// Sum o is that of transform (first + o + k) % slots times weight k over all k < weights' slots, for o < count; sums
/// lie one after another. In the order of k, whatever is summed up together.
struct SpectraSums {
    SpectraLayout layout;
    double const* transforms;
    SpectraLayout weight_layout;
    double const* weights;
    std::int64_t first, count;
    std::complex<double>* sums;
};

VKT_CPU_KERNEL(sum_spectra, (SpectraSums const& s, Execution const& execution), (s, execution))

/// Puts a transform into its slot.
VKT_CPU_KERNEL(store_spectrum,
               (std::complex<double> const* from, SpectraLayout const& layout, std::int64_t slot, double* to,
                Execution const& execution),
               (from, layout, slot, to, execution))

} // namespace vkt
