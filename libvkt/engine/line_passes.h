// Operations that are three passes over lines, each in the place of the one before it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/view.h"

#include <cstdint>

namespace vkt {

/// Beside Operation, for those whose plan wants the whole volume: where that is beyond the budget, the engine keeps the
/// output in a file and works on it part by part, along x as the input comes, then along y and along z, with the same
/// result as run(). Input and output are of the same size.
class LinePasses {
public:
    virtual ~LinePasses() = default;

    /// After begin(): the region whose lines they are. What lies outside of it is settled by the first pass.
    virtual Box lines() const = 0;
    /// Neighbours along x are worked on together, in groups of so many counted from the first of the region.
    virtual std::int64_t lines_together() const = 0;
    /// Whole rows of the output; `in` is what they have of the region, and empty if that is nothing. Every row once.
    virtual void pass_x(ConstView in, AnyView out, Execution const& execution) = 0;
    /// Lines of the region along y or z, from end to end, in place.
    virtual void pass(Axis axis, AnyView lines, Execution const& execution) = 0;
};

} // namespace vkt
