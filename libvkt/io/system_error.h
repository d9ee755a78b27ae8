// The last failure of a system call as an Error that says what was tried and why it did not work.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/error.h"

#include <cerrno>
#include <string>
#include <system_error>

namespace vkt {

/// "what: reason" with the reason of `code` in lower case. Memory and descriptor limits are resources, the rest is io.
inline Error system_error(std::string const& what, int code = errno, std::string hint = {}) {
    std::string reason = std::generic_category().message(code);
    if (!reason.empty() && reason[0] >= 'A' && reason[0] <= 'Z' && code != EIO)
        reason[0] = static_cast<char>(reason[0] + 32);
    bool const limit = code == ENOMEM || code == EMFILE || code == ENFILE;
    return Error(limit ? ErrorKind::resources : ErrorKind::io, what + ": " + reason, std::move(hint));
}

/// Whether the system had no room for what the standard library wanted, most often a thread.
inline bool is_shortage(std::system_error const& error) {
    return error.code() == std::errc::resource_unavailable_try_again || error.code() == std::errc::not_enough_memory;
}

} // namespace vkt
