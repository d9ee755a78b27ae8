// What libtiff complains of: it tells a function, and what failed tells the user.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstdarg>
#include <string>

namespace vkt::tiff {

/// What libtiff complained of last, in this thread.
std::string& complaint();
/// Makes it so: the handler for TIFFSetErrorHandler().
void complain(char const* module, char const* format, va_list arguments);

} // namespace vkt::tiff
