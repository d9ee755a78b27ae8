// A source's slabs where they are looked at: in place if they lie there, or copied.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/engine/source.h"
#include "libvkt/engine/window.h"

namespace vkt {

/// Of the current volume of a source, for those who look at boxes of it without changing any.
class Slabs {
public:
    /// `boundary` continues the volume where a box reaches outside of it.
    Slabs(Source& source, Execution const& on, Boundary boundary = Boundary::clamp) : source_(source), on_(on) {
        window_.reset({.volume_dims = source.header().dims, .type = source.header().dtype, .boundary = boundary});
    }
    /// Valid until the next call.
    ConstView at(Box const& box) {
        if (box_of(source_.header().dims).contains(box))
            if (auto const lent = source_.borrow(box); lent && lent->space == on_.space()) return *lent;
        return window_.fetch(source_, box, on_);
    }

private:
    Source& source_;
    Execution on_;
    Window window_;
};

} // namespace vkt
