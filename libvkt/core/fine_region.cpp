// Parsing regions of fractional ends.
// SPDX-License-Identifier: MIT
#include "libvkt/core/fine_region.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

namespace vkt {
namespace {

/// An end that is a number of voxels, not a share, and no whole one.
bool has_fraction(std::string const& range) {
    auto const ends = split(range, ':');
    return std::any_of(ends.begin(), ends.end(), [](std::string const& end) {
        return end.find('.') != std::string::npos && end.find('%') == std::string::npos;
    });
}

double number(std::string_view word, Roi const& region) {
    try {
        double const value = parse_double(word);
        if (std::isfinite(value)) return value;
    } catch (Error const&) { // said below, with the region
    }
    throw Error(ErrorKind::usage, text(region.option, " '", region.text, "': '", word, "' is not a number"),
                "write X0:X1,Y0:Y1,Z0:Z1; ':' is a whole axis");
}

/// An end of a range that has a fraction somewhere; what has none means what it means in others.
double end_of(std::string_view word, double extent, double if_empty, Roi const& region) {
    if (word.empty()) return if_empty;
    if (word.back() == '%') return std::nearbyint(number(word.substr(0, word.size() - 1), region) / 100 * extent);
    double const value = number(word, region);
    return word.front() == '-' ? extent + value : value;
}

} // namespace

bool FineRegion::partly() const {
    for (int a = 0; a < 3; ++a)
        if (lower[a] != std::floor(lower[a]) || upper[a] != std::floor(upper[a])) return true;
    return false;
}

Box FineRegion::touched() const {
    Box box;
    for (int a = 0; a < 3; ++a) {
        box.lower[a] = static_cast<std::int64_t>(std::floor(lower[a]));
        box.upper[a] = static_cast<std::int64_t>(std::ceil(upper[a]));
    }
    return box;
}

Vec3 FineRegion::middle_from(Index3 first) const {
    Vec3 result;
    for (int a = 0; a < 3; ++a) result[a] = 0.5 * (lower[a] + upper[a]) - 0.5 - static_cast<double>(first[a]);
    return result;
}

FineRegion resolve_fine(Roi const& roi, Index3 dims) {
    auto const ranges = split(roi.text, ',');
    FineRegion region;
    std::string whole; // the ranges that have no fraction
    for (std::size_t a = 0; a < ranges.size(); ++a)
        whole += text(a > 0 ? "," : "", has_fraction(ranges[a]) ? ":" : ranges[a]);
    bool const three = ranges.size() == 3;
    region.voxels = Roi{three ? whole : roi.text, roi.option}.resolve(dims);
    for (int a = 0; a < 3; ++a) {
        region.lower[a] = static_cast<double>(region.voxels.lower[a]);
        region.upper[a] = static_cast<double>(region.voxels.upper[a]);
        if (!three || !has_fraction(ranges[static_cast<std::size_t>(a)])) continue;
        std::string_view const range = ranges[static_cast<std::size_t>(a)];
        std::size_t const colon = range.find(':');
        double const n = static_cast<double>(dims[a]);
        std::string const along(1, "xyz"[a]);
        if (colon == std::string_view::npos || range.find(':', colon + 1) != std::string_view::npos)
            throw Error(ErrorKind::usage, text(roi.option, " '", roi.text, "': '", range, "' is no range of two ends"),
                        "write for example 1.5:30.25");
        std::string_view const end = range.substr(colon + 1);
        double& lower = region.lower[a] = end_of(range.substr(0, colon), n, 0, roi);
        double& upper = region.upper[a] =
            end.starts_with('+') ? lower + end_of(end.substr(1), n, 0, roi) : end_of(end, n, n, roi);
        if (!(lower >= 0 && upper <= n))
            throw Error(ErrorKind::usage,
                        text(roi.option, " ", range, " leaves the volume (", along, " has ", dims[a], " voxels)"));
        region.voxels.lower[a] = static_cast<std::int64_t>(std::ceil(lower - 0.5));
        region.voxels.upper[a] = static_cast<std::int64_t>(std::ceil(upper - 0.5));
        if (!(lower < upper))
            throw Error(ErrorKind::usage, text(roi.option, " ", range, " is empty along ", along),
                        "1:2 is the voxel 1");
    }
    return region;
}

} // namespace vkt
