// What of a box lies beside another.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"

namespace vkt {

/// Calls f(Box) for at most six boxes that make up what of `whole` is not in `inside`: whole slices first, then rows,
/// then parts of rows. `inside` lies in `whole` or is empty.
template <class F> void for_each_beside(Box const& whole, Box const& inside, F const& f) {
    if (whole.empty()) return;
    if (inside.empty()) return f(whole);
    Box rest = whole;
    for (int axis = 2; axis >= 0; --axis) {
        Box below = rest, above = rest;
        below.upper[axis] = rest.lower[axis] = inside.lower[axis];
        above.lower[axis] = rest.upper[axis] = inside.upper[axis];
        if (!below.empty()) f(below);
        if (!above.empty()) f(above);
    }
}

} // namespace vkt
