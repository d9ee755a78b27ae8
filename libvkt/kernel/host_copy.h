// Voxels of a view as the host can read them: as they are, or a copy of those that lie on a GPU.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/kernel/border.h"

namespace vkt {

/// For what looks at few voxels, or at all of them in a way that no GPU can.
class HostCopy {
public:
    /// Valid until the next call.
    ConstView of(ConstView view) {
        if (view.space == Space::host || view.box.empty()) return view;
        memory_.reserve(view.bytes());
        AnyView const copy = dense_view(memory_.write(Space::host), view.type, view.box);
        copy_region(view, copy, {});
        return copy;
    }

private:
    Buffer memory_;
};

} // namespace vkt
