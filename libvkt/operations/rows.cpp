// Widening and narrowing of rows, once per back end.
// SPDX-License-Identifier: MIT
#ifndef __CUDACC__
#include "libvkt/operations/rows.h"

namespace vkt::VKT_BACKEND {
namespace {

template <class T>
void load(T const* from, double* to, std::int64_t n) {
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) to[i] = static_cast<double>(from[i]);
}

template <class T>
Tally store(double const* from, T* to, std::int64_t n, double scale, double offset) {
    if (scale == 1 && offset == 0) return driver::round_segment(n, to, [=](std::int32_t i) { return from[i]; });
    return driver::round_segment(n, to, [=](std::int32_t i) { return from[i] * scale + offset; });
}

} // namespace

void load_row(DataType type, std::byte const* from, double* to, std::int64_t n) {
    for_each_type(type, [&]<class T>(T) { load(reinterpret_cast<T const*>(from), to, n); });
}

Tally store_row(DataType type, double const* from, std::byte* to, std::int64_t n, double scale, double offset) {
    Tally tally;
    for_each_type(type, [&]<class T>(T) { tally = store(from, reinterpret_cast<T*>(to), n, scale, offset); });
    return tally;
}

} // namespace vkt::VKT_BACKEND
#endif
