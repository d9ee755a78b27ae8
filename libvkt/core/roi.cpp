// Parsing and resolving regions.
// SPDX-License-Identifier: MIT
#include "libvkt/core/roi.h"

#include "libvkt/core/affine.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cmath>

namespace vkt {
namespace {

char axis_name(int axis) { return "xyz"[axis]; }

/// One bound: empty, integer, negative from the end, or per cent of the extent. What is thrown names no option.
std::int64_t bound(std::string_view word, std::int64_t n, std::int64_t if_empty) {
    if (word.empty()) return if_empty;
    if (word.back() == '%') {
        double const share = parse_double(word.substr(0, word.size() - 1));
        if (!(share >= 0 && share <= 100))
            throw Error(ErrorKind::usage, text("'", word, "' is not between 0% and 100%"));
        return std::llround(share / 100 * static_cast<double>(n));
    }
    std::int64_t const value = parse_integer(word);
    if (value > max_roi_extent || value < -max_roi_extent)
        throw Error(ErrorKind::usage, text("'", word, "' is out of range"));
    return word.front() == '-' ? n + value : value;
}

/// What stands behind the second colon, which is taken off the range.
std::int64_t take_step(std::string_view& range) {
    std::size_t const second = range.find(':', std::min(range.find(':'), range.size() - 1) + 1);
    if (range.empty() || second == std::string_view::npos) return 1;
    std::string_view const word = range.substr(second + 1);
    range = range.substr(0, second);
    if (word.empty()) return 1;
    std::int64_t const step = parse_integer(word);
    if (step < 1)
        throw Error(ErrorKind::usage, text("a step of ", step, " is not a number of voxels from 1 on"),
                    "vkt flip reverses an axis");
    return std::min(step, max_roi_extent);
}

void resolve_axis(std::string const& option, std::string_view range, int axis, std::int64_t n, std::int64_t& lower,
                  std::int64_t& upper) {
    std::size_t const colon = range.find(':');
    if (colon == std::string_view::npos) {
        if (range.empty()) {
            lower = 0;
            upper = n;
            return;
        }
        lower = bound(range, n, 0);
        upper = lower + 1;
    } else {
        std::string_view const end = range.substr(colon + 1);
        lower = bound(range.substr(0, colon), n, 0);
        if (!end.empty() && end.front() == '+') {
            std::string_view const size = end.substr(1);
            if (size.starts_with('-') || size.starts_with('+'))
                throw Error(ErrorKind::usage, text("'", size, "' is not a number of voxels"));
            upper = lower + bound(size, n, 0);
        } else {
            upper = bound(end, n, n);
        }
    }
    if (lower < 0 || upper > n)
        throw Error(ErrorKind::usage, text(option, " ", lower, ":", upper, " leaves the volume (",
                                           std::string(1, axis_name(axis)), " has ", n, " voxels)"));
    if (upper <= lower)
        throw Error(ErrorKind::usage,
                    text(option, " ", lower, ":", upper, " is empty along ", std::string(1, axis_name(axis))),
                    "ranges are half-open: 3:4 is one voxel");
}

/// What a part of a region is refused for names the option and all of its word.
template <class Read> auto in_name_of(std::string const& option, std::string const& region, Read const& read) {
    try {
        return read();
    } catch (Error const& error) {
        if (std::string_view(error.what()).starts_with("--")) throw;
        bool const fine = option == "--roi" && std::string_view(error.what()).find(".") != std::string_view::npos;
        throw Error(error.kind(), text(option, " '", region, "': ", error.what()),
                    !error.hint().empty() ? error.hint()
                    : fine ? "ends between voxels are for grids, and vkt resample, rotate, scale and affine"
                           : "write X0:X1,Y0:Y1,Z0:Z1; ':' is a whole axis");
    }
}

} // namespace

Index3 SteppedBox::dims() const {
    Index3 n;
    for (int axis = 0; axis < 3; ++axis) n[axis] = (box.upper[axis] - box.lower[axis] - 1) / step[axis] + 1;
    return n;
}

Box SteppedBox::source(Box const& result) const {
    Box from;
    for (int axis = 0; axis < 3; ++axis) {
        from.lower[axis] = box.lower[axis] + result.lower[axis] * step[axis];
        from.upper[axis] = box.lower[axis] + (result.upper[axis] - 1) * step[axis] + 1;
    }
    return from;
}

Geometry SteppedBox::geometry(Geometry const& whole) const {
    Geometry result = cropped(whole, box.lower);
    for (int axis = 0; axis < 3; ++axis) result.spacing[axis] *= static_cast<double>(step[axis]);
    return result;
}

std::string to_text(SteppedBox const& region) {
    std::string result;
    for (int axis = 0; axis < 3; ++axis) {
        result += text(axis > 0 ? "," : "", region.box.lower[axis], ":", region.box.upper[axis]);
        if (region.step[axis] > 1) result += text(":", region.step[axis]);
    }
    return result;
}

bool Roi::has_steps() const {
    auto const ranges = split(text, ',');
    return std::any_of(ranges.begin(), ranges.end(),
                       [](std::string const& range) { return std::count(range.begin(), range.end(), ':') > 1; });
}

Box Roi::resolve(Index3 dims) const {
    SteppedBox const region = resolve_steps(dims);
    if (!region.dense())
        throw Error(ErrorKind::usage, vkt::text(option, " '", text, "': a region with steps is no box"),
                    "take every n-th voxel of a grid first: vkt crop --roi ::2,::2,:");
    return region.box;
}

SteppedBox Roi::resolve_steps(Index3 dims) const {
    if (text.empty()) return {box_of(dims)};
    auto const ranges = split(text, ',');
    if (ranges.size() != 3)
        throw Error(ErrorKind::usage, vkt::text(option, " '", text, "' does not name three ranges"),
                    "write X0:X1,Y0:Y1,Z0:Z1; ':' is a whole axis");
    SteppedBox region;
    Box& box = region.box;
    for (int axis = 0; axis < 3; ++axis)
        in_name_of(option, text, [&] {
            std::string_view range = ranges[static_cast<std::size_t>(axis)];
            region.step[axis] = take_step(range);
            resolve_axis(option, range, axis, dims[axis], box.lower[axis], box.upper[axis]);
        });
    box = region.source(box_of(region.dims())); // nothing behind the last voxel
    return region;
}

Box WorldRoi::resolve(Geometry const& geometry, Index3 dims) const {
    if (text.empty()) return box_of(dims);
    auto const ranges = split(text, ',');
    if (ranges.size() != 3)
        throw Error(ErrorKind::usage, vkt::text("--roi-world '", text, "' does not name three ranges"),
                    "write X0:X1,Y0:Y1,Z0:Z1 in world units");
    Vec3 corner[2];
    for (int axis = 0; axis < 3; ++axis) {
        auto const ends = split(ranges[static_cast<std::size_t>(axis)], ':');
        if (ends.size() != 2)
            throw Error(ErrorKind::usage, vkt::text("--roi-world '", text, "' does not name three ranges"));
        for (int i = 0; i < 2; ++i) {
            std::string const& end = ends[static_cast<std::size_t>(i)];
            double const edge = i == 0 ? -HUGE_VAL : HUGE_VAL;
            corner[i][axis] = end.empty() ? edge : in_name_of("--roi-world", text, [&] { return parse_double(end); });
            if (corner[i][axis] == -edge)
                throw Error(ErrorKind::usage, vkt::text("--roi-world '", text, "' does not meet the volume"));
        }
    }
    for (int axis = 0; axis < 3; ++axis)
        if (corner[0][axis] > corner[1][axis])
            throw Error(ErrorKind::usage, vkt::text("--roi-world '", text, "' ends before it begins"));
    // Bounds count as met within 1e-9 voxels.
    Affine const map = index_to_world(geometry);
    for (int axis = 0; axis < 3; ++axis) {
        double const slack = 1e-9 * std::max({std::abs(map.column[0][axis]), std::abs(map.column[1][axis]),
                                              std::abs(map.column[2][axis])});
        corner[0][axis] -= slack;
        corner[1][axis] += slack;
    }
    Box const box = voxels_within(map, corner[0], corner[1], dims);
    if (box.empty()) throw Error(ErrorKind::usage, vkt::text("--roi-world '", text, "' does not meet the volume"));
    return box;
}

Roi roi_of(Index3 first, Index3 last) {
    for (int axis = 0; axis < 3; ++axis)
        if (first[axis] < 0 || last[axis] <= first[axis])
            throw Error(ErrorKind::usage, text("--first ", first, " --last ", last, " is no region"),
                        "--first lies in the volume, --last beyond it along every axis");
    return {to_text(Box{first, last}), "--first, --last"};
}

} // namespace vkt
