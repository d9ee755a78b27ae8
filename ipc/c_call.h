// Calls of the C API that write to a descriptor: a reader that went away is an error of the call and no signal.
// SPDX-License-Identifier: MIT
#pragma once

#include "ipc/descriptor.h"
#include "libvkt/c/call.h"
#include "libvkt/core/error.h"

namespace vkt::ipc {

/// c::guarded(), which knows nothing of pipes, for bodies that may throw BrokenPipe.
template <class F> vkt_status guarded(F const& body) noexcept {
    return c::guarded([&](c::Call& call) {
        try {
            body(call);
        } catch (BrokenPipe const&) {
            throw Error(ErrorKind::io, "the reader of the stream is gone");
        }
    });
}

} // namespace vkt::ipc
