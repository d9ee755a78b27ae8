// The instructions that compilers do not find by themselves, where a file is compiled for them.
// SPDX-License-Identifier: MIT
#pragma once

#if defined(__AVX2__) && !defined(__CUDACC__)
#if !defined(__clang__)
// GCC 12 takes its own "undefined" operands of masked instructions for mistakes.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif
#include <immintrin.h>
#if !defined(__clang__)
#pragma GCC diagnostic pop
#endif
#endif
