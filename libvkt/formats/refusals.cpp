// Refusals that formats share.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/refusals.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <utility>

namespace vkt {

void refuse_bricks(Header const& header, std::string_view what) {
    if (header.kind != Kind::structured)
        throw Error(ErrorKind::usage, text(what, " cannot hold bricks"), "make a grid of them first: vkt resample");
}

void refuse_series(bool& begun, std::string_view file, std::string_view extension) {
    if (std::exchange(begun, true))
        throw Error(ErrorKind::usage, text("the input holds several volumes, ", file, " of vkt holds one"),
                    text("write one each: name it like out_%04d", extension));
}

void refuse_bricks_and_series(Header const& header, bool& begun, std::string_view what, std::string_view file,
                              std::string_view extension) {
    refuse_bricks(header, what);
    refuse_series(begun, file, extension);
}

} // namespace vkt
