// What an operation source includes: back-end pattern, arithmetic, and the drivers of the back end being compiled.
// SPDX-License-Identifier: MIT
#pragma once

// Drivers: the same names and meaning in every back end, so that a kernel is one functor. Views have any data type; C,
// float, double or Int128, is what the functor is given; what it returns is rounded half to even and saturated. What
// that lost is added to a Losses. Functors are structs whose operator() is VKT_HD.
//
//   map<C>(execution, out, losses, f, in...)              out = f(in...)           inputs have out's coordinates
//   map_at<C>(execution, out, losses, f, in...)           out = f(x, y, z, in...)  coordinates as double
//   stencil<C>(execution, out, losses, radius, f, in)     out = f(window)          window(dx, dy, dz) is a neighbour's
//                                                         value; `in` covers out.box grown by the radius
//                                                         (C an integer: keys, see order.h)
//   column_stencil<C>(…)                                  the same in two steps: f.column(window, C made[F::columns])
//                                                         makes something of the neighbours with dx = 0, once a
//                                                         column, and f.combine(columns) of columns(dx, which)
//   reduce<C>(execution, in, zero)                        an R made of all voxels by add_row(values, n) on the CPU,
//                                                         add(value) on the GPU, and merge(other): exact, so that no
//                                                         order matters
//   fill(execution, box, out, value)                      out = value
//   copy_box(execution, from, to, mirror)                 permuting copy between boxes of equal dims
//
// out.box is what is computed. In and out may be the same memory in map and map_at. A functor that also has
// undefined(in...) has the voxels counted for which that is true, unless its may_be_undefined() is false; one that has
// row(n, results, in...), or row_at(n, x, y, z, results, in...) in map_at, is given pieces of rows on CPUs; one of one
// input that has is_identity is not called there.
//
//     template <class C> struct Inside {
//         C low, high;
//         VKT_HD C operator()(C v) const { return v >= low && v <= high ? C(1) : C(0); }
//     };
//     void threshold(ConstView in, AnyView out, double low, double high, Losses& losses, Execution const& execution) {
//         with_compute_type(in.type, [&]<class C>(C) { map<C>(execution, out, losses, Inside<C>{C(low), C(high)}, in);
//         });
//     }

#include "libvkt/kernel/backend.h"
#include "libvkt/kernel/numeric.h"

#ifdef __CUDACC__
#include "libvkt/kernel/cuda_map.h"
#include "libvkt/kernel/cuda_reduce.h"
#else
#include "libvkt/kernel/cpu_drivers.h"
#endif
