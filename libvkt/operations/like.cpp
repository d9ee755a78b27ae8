// Headers of volumes named by --like.
// SPDX-License-Identifier: MIT
#if VKT_HOST
#include "libvkt/operations/like.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/format.h"

namespace vkt {

Header const& Like::header() const {
    if (!header_) header_ = header_like(*open_volume(open_bytes(file), {}), file);
    return *header_;
}

Header header_like(Source& source, std::string const& file) {
    if (!source.next_volume()) throw Error(ErrorKind::data, text("--like: ", file, " holds no volume"));
    return source.header();
}

} // namespace vkt
#endif
