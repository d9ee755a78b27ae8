// Headers of volumes named by --like.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/common/reference_volume.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/format.h"

namespace vkt {

namespace {

Header first_header(Source& opened, std::string const& file) {
    if (!opened.next_volume()) throw Error(ErrorKind::data, text("--like: ", file, " holds no volume"));
    return opened.header();
}

} // namespace

Header const& ReferenceVolume::header() const {
    return header_.of(file,
                      [](std::string const& path) { return first_header(*open_volume(open_bytes(path), {}), path); });
}

void ReferenceVolume::take(Source& opened) const {
    header_.of(file, [&](std::string const& path) { return first_header(opened, path); });
}

} // namespace vkt
