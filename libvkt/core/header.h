// Everything a stream says about a volume before its voxels: kind, extent, type, geometry, value map, history.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/geometry.h"
#include "libvkt/core/history.h"
#include "libvkt/core/types.h"
#include "libvkt/core/volume_error.h"

#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace vkt {

enum class Kind : std::uint8_t { structured, hierarchical };

/// physical value = slope * stored value + intercept.
struct ValueMap {
    double slope = 1, intercept = 0;
    double physical(double stored) const {
        double const value = slope * stored + intercept;
        // The product may be beyond double where the sum is not.
        return std::isfinite(value) || !std::isfinite(stored) ? value : std::fma(slope, stored, intercept);
    }
    double stored(double physical) const { return (physical - intercept) / slope; }
    friend bool operator==(ValueMap const&, ValueMap const&) = default;
};

/// This volume is a part of a larger one: the whole's dims, where this part starts, and how much of it is halo.
struct Part {
    Index3 global_dims, offset, halo;
    friend bool operator==(Part const&, Part const&) = default;
};

/// One brick of a hierarchical volume. lower counts cells of the finest level (level 0); a cell is 2^level of them
/// wide.
struct Brick {
    Index3 lower;
    Index3 dims;
    int level = 0;

    std::int64_t cell_width() const { return std::int64_t{1} << level; }
    std::int64_t cells() const { return dims.x * dims.y * dims.z; }
    friend bool operator==(Brick const&, Brick const&) = default;
};

struct Header {
    Kind kind = Kind::structured;
    Index3 dims{1, 1, 1}; ///< voxels; for hierarchical volumes the extent of the logical grid in finest cells
    DataType dtype = DataType::uint8;
    Geometry geometry; ///< for hierarchical volumes that of the logical grid
    ValueMap values;
    std::string units;                             ///< of the physical values, e.g. "HU"
    std::map<std::string, std::string> attributes; ///< free key/value pairs that travel along
    std::optional<Part> part;
    VolumeError error; ///< of the voxels; operations and the engine see to it that it is never kept by mistake
    std::optional<History> history;
    std::int64_t brick_count = 0;   ///< hierarchical: how many bricks follow
    std::int64_t cell_count = 0;    ///< hierarchical: how many cells these bricks hold
    int level_count = 0;            ///< hierarchical: 1 + coarsest level
    bool dry_run = false;           ///< only the plan travels; no voxels follow
    std::optional<History> planned; ///< of a dry run: its commands, without what made the files that they read
    bool timing = false;            ///< stages downstream are asked to report their times

    /// Voxels or cells that follow this header, and their bytes.
    std::int64_t voxels() const { return kind == Kind::structured ? dims.x * dims.y * dims.z : cell_count; }
    std::size_t bytes() const { return static_cast<std::size_t>(voxels()) * size_of(dtype); }
    friend bool operator==(Header const&, Header const&) = default;
};

/// Largest extent along an axis and largest number of bytes a header may state: beyond them every reader refuses.
inline constexpr std::int64_t max_extent = std::int64_t{1} << 40;

/// Coarsest level a brick may have: 2^40 is the largest extent of a logical grid.
inline constexpr int max_level = 40;

/// Throws Error{data}: extents in 1…2^40, bytes below 2^62, finite positive geometry, finite non-zero slope.
void check(Header const& header);

/// The error as one JSON object, and the reverse, which throws Error{data}.
std::string to_json(VolumeError const& error);
VolumeError volume_error_from_json(std::string_view text);
/// "exact", "within 0.3 HU of exact", "about 0.3 HU from exact", or "unknown: " and why.
std::string to_sentence(VolumeError const& error, std::string const& units);

/// Physical values that the voxels of a volume lie between, as its header knows it: by the type if that is an integer,
/// by what earlier stages found. None for floats of which nothing is known.
std::optional<ValueInterval> values_of(Header const& header);
/// Those that integers of a type can stand for; none for floats.
std::optional<ValueInterval> values_of(DataType type, ValueMap const& map);

/// Marks the voxels of a file as given, unless the header says how they were made.
void mark_as_given(Header& header);

/// The header with all of its text in UTF-8 (see text.h), as streams and files carry it: what goes through a pipe and
/// what does not says the same.
Header in_utf8(Header header);

/// One object, one key a line, fixed order, in UTF-8. Histories are folded; what a terminal would act on is escaped.
std::string to_json(Header const& header);
/// Throws Error{data}; unknown keys are ignored. Histories of any length are taken, and folded.
Header header_from_json(std::string_view text);

} // namespace vkt
