// World frames.
// SPDX-License-Identifier: MIT
#include "libvkt/core/frame.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <array>
#include <optional>

namespace vkt {
namespace {

/// An anatomical frame, and which of its axes point as those of left-posterior-superior do.
struct Anatomical {
    std::string_view name, brief;
    std::array<bool, 3> turned;
};

constexpr std::array<Anatomical, 3> anatomical{{
    {lps_frame, "lps", {false, false, false}},
    {"right-anterior-superior", "ras", {true, true, false}},
    {"left-anterior-superior", "las", {false, true, false}},
}};

Anatomical const* find(std::string_view frame) {
    for (auto const& a : anatomical)
        if (a.name == frame) return &a;
    return nullptr;
}

std::string said(std::string const& frame) { return frame.empty() ? "unknown" : frame; }

} // namespace

std::string frame_name(std::string_view space) {
    std::string name = lower_case(space);
    if (name.ends_with("-time")) name.resize(name.size() - 5); // time is the sequence's
    for (auto const& a : anatomical)
        if (name == a.brief || name == std::string(a.brief) + "t") return std::string(a.name);
    return name;
}

std::string frame_of(Header const& header) {
    auto const space = header.attributes.find("space");
    return space == header.attributes.end() ? std::string{} : frame_name(space->second);
}

bool is_anatomical(std::string_view frame) { return find(frame) != nullptr; }

bool comparable_frames(std::string_view a, std::string_view b) {
    return a == b || (is_anatomical(a) && is_anatomical(b));
}

Geometry geometry_in(std::string_view frame, Header const& header) {
    Geometry g = header.geometry;
    Anatomical const *const from = find(frame_of(header)), *const to = find(frame);
    if (from == nullptr || to == nullptr) return g;
    for (int world = 0; world < 3; ++world) {
        auto const w = static_cast<std::size_t>(world);
        if (from->turned[w] == to->turned[w]) continue;
        g.origin[world] = 0.0 - g.origin[world]; // no negative zeros
        for (auto& direction : g.direction) direction[world] = 0.0 - direction[world];
    }
    return g;
}

Geometry geometry_beside(Header const& here, Header const& other) {
    std::string const mine = frame_of(here), its = frame_of(other);
    if (!comparable_frames(mine, its))
        throw Error(ErrorKind::usage,
                    text("the world's axes mean different things: the frame of one volume is ", said(mine),
                         ", that of the other ", said(its)),
                    text("if they are the same, say so: vkt set --attribute space=", mine.empty() ? its : mine));
    return geometry_in(mine, other);
}

bool same_place(Header const& a, Header const& b) {
    std::string const frame = frame_of(a);
    return comparable_frames(frame, frame_of(b)) && same_geometry(a.geometry, geometry_in(frame, b));
}

} // namespace vkt
