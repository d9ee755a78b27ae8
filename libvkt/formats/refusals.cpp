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

void tell_losses(WriteOptions const& options, Header const& header, std::string_view what, Kept const& kept) {
    Geometry const plain, &g = header.geometry;
    std::vector<std::string> lost;
    if (!kept.spacing && !(g.spacing == plain.spacing && g.origin == plain.origin)) lost.emplace_back("the place");
    if (!kept.directions && g.direction != plain.direction) lost.emplace_back("the directions");
    if (!kept.values && header.values != ValueMap{}) lost.emplace_back("the map of values");
    if (!kept.values && !header.units.empty()) lost.emplace_back("units");
    if (!kept.sidecar && header.attributes.contains("sidecar")) lost.emplace_back("what stood in the JSON file beside");
    if (!lost.empty() && options.notice) options.notice(text(what, " do not hold ", join(lost, ", "), ": not kept"));
}

} // namespace vkt
