// Widening and narrowing of rows, once per back end.
// SPDX-License-Identifier: MIT
#ifndef __CUDACC__
#include "libvkt/operations/rows.h"

namespace vkt::VKT_BACKEND {
namespace {

template <class T, class C>
void load(T const* from, C* to, std::int64_t n) {
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) to[i] = static_cast<C>(from[i]);
}

template <class T, class C>
Tally store(C const* from, T* to, std::int64_t n) {
    return driver::round_segment(n, to, [=](std::int32_t i) { return from[i]; });
}

} // namespace

template <class C>
void load_row(DataType type, std::byte const* from, C* to, std::int64_t n) {
    for_each_type(type, [&]<class T>(T) { load(reinterpret_cast<T const*>(from), to, n); });
}

template <class C>
Tally store_row(DataType type, C const* from, std::byte* to, std::int64_t n) {
    Tally tally;
    for_each_type(type, [&]<class T>(T) { tally = store(from, reinterpret_cast<T*>(to), n); });
    return tally;
}

template void load_row(DataType, std::byte const*, float*, std::int64_t);
template void load_row(DataType, std::byte const*, double*, std::int64_t);
template Tally store_row(DataType, float const*, std::byte*, std::int64_t);
template Tally store_row(DataType, double const*, std::byte*, std::int64_t);

} // namespace vkt::VKT_BACKEND
#endif
