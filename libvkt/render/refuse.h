// The error of what a picture cannot be made of.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/error.h"

#include <string>

namespace vkt::render {

[[noreturn]] inline void refuse(std::string const& message, std::string const& hint = {}) {
    throw Error(ErrorKind::usage, message, hint);
}

} // namespace vkt::render
