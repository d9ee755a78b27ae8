// Sums of transforms: products of complex numbers without the checks for infinities of std::complex.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/spectra.h"

#include "libvkt/kernel/kernel.h"

namespace vkt::VKT_BACKEND {

void sum_spectra(SpectraSums const& s, Execution const&) {
    constexpr std::int64_t lanes = spectra_lanes;
    for (std::int64_t group = 0; group < s.layout.area / lanes; ++group)
        for (std::int64_t o = 0; o < s.count; ++o) {
            double real[lanes] = {}, imaginary[lanes] = {};
            std::int64_t slot = (s.first + o) % s.layout.slots;
            for (std::int64_t k = 0; k < s.weight_layout.slots; ++k) {
                double const* const a = s.transforms + s.layout.at(group, slot);
                double const* const b = s.weights + s.weight_layout.at(group, k);
#pragma omp simd
                for (std::int64_t i = 0; i < lanes; ++i) {
                    real[i] += a[i] * b[i] - a[lanes + i] * b[lanes + i];
                    imaginary[i] += a[i] * b[lanes + i] + a[lanes + i] * b[i];
                }
                if (++slot == s.layout.slots) slot = 0;
            }
            std::complex<double>* const sum = s.sums + o * s.layout.area + group * lanes;
            for (std::int64_t i = 0; i < lanes; ++i) sum[i] = {real[i], imaginary[i]};
        }
}

void store_spectrum(std::complex<double> const* from, SpectraLayout const& layout, std::int64_t slot, double* to,
                    Execution const&) {
    constexpr std::int64_t lanes = spectra_lanes;
    for (std::int64_t group = 0; group < layout.area / lanes; ++group) {
        double* const out = to + layout.at(group, slot);
        for (std::int64_t i = 0; i < lanes; ++i) {
            out[i] = from[group * lanes + i].real();
            out[lanes + i] = from[group * lanes + i].imag();
        }
    }
}

} // namespace vkt::VKT_BACKEND
