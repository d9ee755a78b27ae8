// Headers of volumes named by --like.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/reference_volume.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/format.h"

namespace vkt {

Header const& ReferenceVolume::header() const {
    if (!header_) take(*open_volume(open_bytes(file), {}));
    return *header_;
}

void ReferenceVolume::take(Source& opened) const {
    if (!opened.next_volume()) throw Error(ErrorKind::data, text("--like: ", file, " holds no volume"));
    header_ = opened.header();
}

} // namespace vkt
