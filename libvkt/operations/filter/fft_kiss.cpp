// Fourier transforms of squares by KISS FFT, a header of templates.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/fft_module.h"

#include <kissfft/kissfft.hh>

namespace vkt {
namespace {

void transform(std::size_t edge, bool inverse, std::complex<double>* values, std::complex<double>* scratch) {
    kissfft<double> const line(edge, inverse);
    for (std::size_t y = 0; y < edge; ++y) line.transform(values + y * edge, scratch + y * edge);
    // Columns become rows and stay so: two transforms bring everything back to its place.
    for (std::size_t x = 0; x < edge; ++x) {
        for (std::size_t y = 0; y < edge; ++y) values[x * edge + y] = scratch[y * edge + x];
    }
    for (std::size_t x = 0; x < edge; ++x) line.transform(values + x * edge, scratch + x * edge);
    for (std::size_t i = 0; i < edge * edge; ++i) values[i] = scratch[i];
}

FftFunctions const functions{transform};

} // namespace
} // namespace vkt

extern "C" {
__attribute__((visibility("default"))) extern vkt::ModuleExport const vkt_module_kissfft;
vkt::ModuleExport const vkt_module_kissfft{VKT_VERSION, &vkt::functions, nullptr};
}
