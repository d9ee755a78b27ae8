// The last complaint of libtiff, a thread's own.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/tiff/complaint.h"

#include "libvkt/core/text.h"

#include <cstdio>

namespace vkt::tiff {

std::string& complaint() {
    thread_local std::string words; // the handler has no other place for it
    return words;
}

void complain(char const* module, char const* format, va_list arguments) {
    char line[300];
    std::vsnprintf(line, sizeof line, format, arguments);
    complaint() = text(module != nullptr ? text(module, ": ") : "", line);
}

} // namespace vkt::tiff
