// Axes along which the volumes of a series lie in one array: times, channels, or both.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/formats/coordinates.h"

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace vkt {

struct SeriesAxis {
    bool time = true; ///< else channels
    /// Attribute "sequence position" or "channel" of each entry; empty where a volume does not say.
    std::vector<std::string> places;

    std::string name() const { return time ? "t" : "c"; }
    std::int64_t size() const { return std::ssize(places); }
};

/// Numbers along an axis of times: positions if all volumes state them, else counted from 0.
std::vector<double> times_of(SeriesAxis const& axis);
/// Their distance, as the header states it if that is what they have; none where they do not grow evenly.
std::optional<EvenSteps> steps_of(SeriesAxis const& axis, Header const& header);
/// What channels are called; their numbers where they do not say.
std::vector<std::string> channels_of(SeriesAxis const& axis);

/// Throws Error{usage} if another volume has no place in one array with the first: other dims, type, geometry or map of
/// values. For messages: "NRRD file", and how to write one file each.
void check_lattice(Header const& first, Header const& other, std::string const& holder, std::string const& each);

/// Leaves in the header of a file's first volume what it has in common with another one: the history, the error, or
/// that a series lost it, and attributes. Returns the names of those that went.
std::vector<std::string> keep_common(Header& first, Header const& other);

/// Takes the headers of volumes as they come, of which all have one lattice, and finds the axes that they form.
class SeriesAxes {
public:
    /// For messages: "Zarr array", ".zarr".
    SeriesAxes(std::string file, std::string extension) : file_(std::move(file)), extension_(std::move(extension)) {}

    /// Throws Error{usage} for a volume of another lattice, and for one that has no place in a grid of times and
    /// channels.
    void add(Header const& header);
    /// After the last one. Throws Error{usage} if the grid is not full.
    void finish() const;

    std::int64_t volumes() const { return volumes_; }
    /// Slowest first, so far; none of a single volume.
    std::vector<SeriesAxis> axes() const;
    std::vector<std::int64_t> extents() const;
    /// Where the last volume lies along times and channels, counted from 0; 0 along what there is not.
    std::int64_t time_of_last() const;
    std::int64_t channel_of_last() const;
    bool has_channels() const { return volumes_ > 1 && (!inner_.time || outer_.size() > 1); }
    /// Of the first volume, with the attributes that all have in common and the axes do not tell.
    Header const& header() const { return header_; }
    /// Attributes that differ and that the axes do not tell.
    std::vector<std::string> const& differing() const { return differing_; }

private:
    void place(std::string const& channel, std::string const& position);
    std::int64_t last_along(bool time) const;
    [[noreturn]] void no_grid() const;

    std::string file_, extension_;
    std::int64_t volumes_ = 0;
    SeriesAxis inner_, outer_; ///< the outer one holds one entry until the inner one begins anew
    Header header_;
    std::vector<std::string> differing_;
};

} // namespace vkt
