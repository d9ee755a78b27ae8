// What the module kissfft hands to the library: one transform, which many threads may call at once.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/io/module.h"

#include <complex>
#include <cstddef>

namespace vkt {

struct FftFunctions {
    /// The discrete Fourier transform of edge x edge values, unscaled and transposed; `scratch` has room for as many.
    void (*transform)(std::size_t edge, bool inverse, std::complex<double>* values, std::complex<double>* scratch);
};

} // namespace vkt
