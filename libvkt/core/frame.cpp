// World frames.
// SPDX-License-Identifier: MIT
#include "libvkt/core/frame.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

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

/// Of lengths along all axes of the world, in millimetres; none if they differ, or nobody says or knows it.
std::optional<double> length_unit(Header const& header) {
    auto const found = header.attributes.find("space units");
    if (found == header.attributes.end()) return std::nullopt;
    for (auto const& [name, millimetres] :
         {std::pair{"mm", 1.0}, {"um", 1e-3}, {"nm", 1e-6}, {"angstrom", 1e-7}, {"cm", 10.0}, {"m", 1e3}})
        if (found->second == text("\"", name, "\" \"", name, "\" \"", name, "\"")) return millimetres;
    return std::nullopt;
}

/// The lattice of `other` in the unit of `here`, if both say theirs.
void measure_in(Header const& here, Header const& other, Geometry& g) {
    std::optional<double> const mine = length_unit(here), its = length_unit(other);
    if (!mine || !its || *mine == *its) return;
    double const larger = std::max(*mine, *its), smaller = std::min(*mine, *its), ratio = std::round(larger / smaller);
    auto const scaled = [&](double v) { return *its > *mine ? v * ratio : v / ratio; };
    for (int axis = 0; axis < 3; ++axis) {
        g.spacing[axis] = scaled(g.spacing[axis]);
        g.origin[axis] = scaled(g.origin[axis]);
    }
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
    Geometry g = geometry_in(mine, other);
    measure_in(here, other, g);
    return g;
}

void take_world(Header const& like, Header& header) {
    header.attributes.erase("space");
    for (char const* const name : {"space", "space units"})
        if (auto const found = like.attributes.find(name); found != like.attributes.end())
            header.attributes[name] = found->second;
}

bool same_place(Header const& a, Header const& b) {
    std::string const frame = frame_of(a);
    if (!comparable_frames(frame, frame_of(b))) return false;
    Geometry g = geometry_in(frame, b);
    measure_in(a, b, g);
    return same_geometry(a.geometry, g);
}

} // namespace vkt
