// Series as axes.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/series_axes.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace vkt {

namespace {

std::string said(Header const& header, char const* attribute) {
    auto const found = header.attributes.find(attribute);
    return found == header.attributes.end() ? "" : found->second;
}

} // namespace

std::vector<double> times_of(SeriesAxis const& axis) {
    std::vector<double> stated, counted;
    for (std::string const& place : axis.places) {
        counted.push_back(static_cast<double>(counted.size()));
        if (auto const number = number_in(place)) stated.push_back(*number);
    }
    return stated.size() == counted.size() ? stated : counted;
}

std::optional<EvenSteps> steps_of(SeriesAxis const& axis, Header const& header) {
    auto steps = even_steps(times_of(axis));
    if (!steps || steps->step <= 0) return std::nullopt;
    bool const counted = std::find(axis.places.begin(), axis.places.end(), "") != axis.places.end();
    auto const stated = number_in(said(header, "sequence step"));
    // Not as differences round it.
    if (stated && *stated > 0 && (counted || std::abs(*stated - steps->step) <= 1e-3 * *stated)) steps->step = *stated;
    return steps;
}

std::vector<std::string> channels_of(SeriesAxis const& axis) {
    std::vector<std::string> result;
    for (std::string const& place : axis.places) result.push_back(place.empty() ? to_text(std::ssize(result)) : place);
    return result;
}

void check_lattice(Header const& first, Header const& other, std::string const& holder, std::string const& each) {
    if (same_lattice(first, other)) return;
    Header alike = other;
    alike.values = first.values;
    if (!same_lattice(first, alike))
        throw Error(ErrorKind::usage, text("one ", holder, " cannot hold volumes of different dims, types or geometry"),
                    each);
    throw Error(ErrorKind::usage,
                text("one ", holder,
                     " cannot hold volumes that store their values with slopes and intercepts of their ", "own (",
                     first.values.slope, " and ", first.values.intercept, ", then ", other.values.slope, " and ",
                     other.values.intercept, ")"),
                text("where these come from a range, give it in numbers, as in vkt convert --range 0:1000; or ", each));
}

std::vector<std::string> keep_common(Header& first, Header const& other) {
    if (!(other.history == first.history)) first.history.reset();
    if (!(other.error == first.error)) first.error = first.history ? VolumeError{} : VolumeError::lost("series");
    std::vector<std::string> gone;
    std::erase_if(first.attributes, [&](auto const& attribute) {
        auto const found = other.attributes.find(attribute.first);
        if (found != other.attributes.end() && found->second == attribute.second) return false;
        // Seen from the first volume all lie where it does (check_lattice).
        bool const place = attribute.first == "space" || attribute.first == "space units";
        if (place && found != other.attributes.end()) return false;
        gone.push_back(attribute.first);
        return true;
    });
    return gone;
}

void SeriesAxes::no_grid() const {
    throw Error(ErrorKind::usage,
                text("volume ", volumes_, ": times and channels form no full grid, which one ", file_, " needs"),
                text("write one file each: name it like out_%04d", extension_));
}

void SeriesAxes::add(Header const& given) {
    Header header = in_utf8(given);
    if (volumes_ > 0)
        check_lattice(header_, header, file_, text("write one file each: name it like out_%04d", extension_));
    place(said(header, "channel"), said(header, "sequence position"));
    if (volumes_++ == 0) {
        header_ = std::move(header);
        return;
    }
    for (std::string& name : keep_common(header_, header))
        if (name != "channel" && name != "sequence position") differing_.push_back(std::move(name));
}

/// The second volume tells which axis is the inner one; the outer one begins where the inner one does so again.
void SeriesAxes::place(std::string const& channel, std::string const& position) {
    if (volumes_ == 0) {
        inner_.places = {position};
        outer_ = {false, {channel}};
        return;
    }
    if (volumes_ == 1 && channel != outer_.places.front()) std::swap(inner_, outer_);
    std::string const &along = inner_.time ? position : channel, &across = inner_.time ? channel : position;
    if (outer_.size() == 1 && (inner_.time ? across == outer_.places.front() : along != inner_.places.front())) {
        if (across != outer_.places.front()) no_grid(); // channels at times of their own
        return inner_.places.push_back(along);
    }
    std::int64_t const at = volumes_ % inner_.size();
    bool const same_row = at == 0 || across == outer_.places.back();
    if (!same_row || along != inner_.places[static_cast<std::size_t>(at)]) no_grid();
    if (at == 0) outer_.places.push_back(across);
}

void SeriesAxes::finish() const {
    if (volumes_ != inner_.size() * outer_.size()) no_grid();
}

std::vector<SeriesAxis> SeriesAxes::axes() const {
    if (volumes_ < 2) return {};
    if (outer_.size() == 1) return {inner_};
    return {outer_, inner_};
}

std::int64_t SeriesAxes::last_along(bool time) const {
    if (volumes_ < 2) return 0;
    std::int64_t const number = volumes_ - 1;
    if (inner_.time == time) return number % inner_.size();
    return outer_.size() > 1 ? number / inner_.size() : 0;
}

std::int64_t SeriesAxes::time_of_last() const { return last_along(true); }
std::int64_t SeriesAxes::channel_of_last() const { return last_along(false); }

std::vector<std::int64_t> SeriesAxes::extents() const {
    if (volumes_ < 2) return {};
    if (outer_.size() == 1) return {inner_.size()};
    return {outer_.size(), inner_.size()};
}

} // namespace vkt
