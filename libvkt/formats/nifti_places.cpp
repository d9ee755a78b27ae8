// Places beside the lattice.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/nifti_places.h"

#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/products.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/nifti_header.h"

#include <array>
#include <cmath>
#include <vector>

namespace vkt {

namespace {

/// What the digits behind these are, is rounding of sums.
double rounded(double value) { return std::round(value * 1e12) / 1e12 + 0.0; }

std::vector<double> numbers_in(std::string const& attribute) {
    std::vector<double> result;
    for (std::string const& word : words_of(attribute)) {
        auto const number = number_in(word);
        if (!number || !std::isfinite(*number)) return {};
        result.push_back(*number);
    }
    return result;
}

/// Where each axis leads for the most part, as nibabel has it: "LAS".
std::string axis_letters(Geometry const& g) {
    std::string letters;
    for (Vec3 const& d : g.direction) {
        int most = 0;
        for (int i = 1; i < 3; ++i)
            if (std::abs(d[i]) > std::abs(d[most])) most = i;
        letters += d[most] < 0 ? "LPI"[most] : "RAS"[most];
    }
    return letters;
}

constexpr std::string_view about_slices[] = {"slice_code", "slice_start", "slice_end", "slice_duration", "dim_info"};

} // namespace

bool is_orthonormal(Geometry const& g) {
    auto const& d = g.direction;
    return std::abs(dot(d[0], d[1])) < 1e-5 && std::abs(dot(d[1], d[2])) < 1e-5 && std::abs(dot(d[2], d[0])) < 1e-5;
}

std::string map_between(Geometry const& from, Geometry const& to) {
    auto const mapped = [&](Vec3 world) { return index_to_world(to, world_to_index(from, world)); };
    Vec3 const origin = mapped({0, 0, 0});
    Vec3 const columns[] = {mapped({1, 0, 0}) - origin, mapped({0, 1, 0}) - origin, mapped({0, 0, 1}) - origin, origin};
    std::vector<std::string> words;
    for (int row = 0; row < 3; ++row)
        for (Vec3 const& column : columns) words.push_back(to_text(rounded(column[row])));
    return join(words, " ");
}

std::optional<Geometry> qform_of(Header const& header, Geometry const& lattice) {
    auto const found = header.attributes.find(qform_map);
    if (found == header.attributes.end()) return std::nullopt;
    std::vector<double> const m = numbers_in(found->second);
    if (m.size() != 12) return std::nullopt;
    auto const turned = [&](Vec3 v) {
        auto const row = [&](std::size_t i) { return m[i] * v.x + m[i + 1] * v.y + m[i + 2] * v.z; };
        return Vec3{row(0), row(4), row(8)};
    };
    Geometry g;
    try {
        for (int axis = 0; axis < 3; ++axis)
            set_axis(g, axis, turned(lattice.direction[static_cast<std::size_t>(axis)] * lattice.spacing[axis]), "");
        g.origin = turned(lattice.origin) + Vec3{m[3], m[7], m[11]};
        check(g);
    } catch (Error const&) {
        return std::nullopt;
    }
    return is_orthonormal(g) ? std::optional(g) : std::nullopt;
}

std::string grid_text(Index3 dims, Geometry const& lattice) {
    Vec3 const o = lattice.origin;
    return text(dims.x, " ", dims.y, " ", dims.z, " ", axis_letters(lattice), " ", to_text(o.x), " ", to_text(o.y), " ",
                to_text(o.z));
}

bool has_slice_grid(Header const& header) {
    auto const found = header.attributes.find(slice_grid);
    if (found == header.attributes.end()) return true;
    std::vector<std::string> const words = words_of(found->second);
    Geometry const g = geometry_in(nifti_frame, header);
    if (words.size() != 7 || words[3] != axis_letters(g)) return false;
    for (int axis = 0; axis < 3; ++axis) {
        auto const a = static_cast<std::size_t>(axis);
        auto const at = number_in(words[4 + a]);
        if (words[a] != to_text(header.dims[axis]) || !at) return false;
        if (!(std::abs(*at - g.origin[axis]) <= 1e-3 * g.spacing[axis])) return false;
    }
    return true;
}

std::string drop_outdated(Header& header) {
    std::vector<std::string> gone;
    if (!has_slice_grid(header)) {
        std::vector<std::string> names;
        for (std::string_view const name : about_slices)
            if (header.attributes.erase(std::string(name)) > 0) names.emplace_back(name);
        if (!names.empty()) gone.push_back("how the scanner took its slices (" + join(names, " ") + ")");
        header.attributes.erase(slice_grid);
    }
    bool const known = is_anatomical(frame_of(header));
    if (header.attributes.contains(qform_map) && !(known && qform_of(header, geometry_in(nifti_frame, header)))) {
        gone.emplace_back(known ? "the qform, which says no shears" : "the qform");
        header.attributes.erase(qform_map);
        header.attributes["qform_code"] = "0";
    }
    return gone.empty() ? "" : text("not true of this lattice: ", join(gone, ", "), ": not kept");
}

} // namespace vkt
