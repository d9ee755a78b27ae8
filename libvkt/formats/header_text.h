// Pieces that the text headers of formats share: numbers, words, file name patterns, axis signs, the history as a
// value.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {

std::string_view trimmed(std::string_view text);
/// Words separated by blanks.
std::vector<std::string> words_of(std::string_view text);

/// With blanks for ends of lines.
std::string one_line(std::string text);

/// The whole word as a number (also nan, inf, a leading +), or nullopt.
std::optional<double> number_in(std::string_view word);
std::optional<std::int64_t> integer_in(std::string_view word);
/// An attribute that is a number.
std::optional<double> number_of(Header const& header, std::string const& attribute);

/// The names that a printf pattern with one %d (flags 0, width up to 64) makes of first, first+step, …, last.
/// Throws Error{data} for other patterns, a zero or contrary step, or more than 2^20 files.
std::vector<std::string> numbered_files(std::string const& pattern, std::int64_t first, std::int64_t last,
                                        std::int64_t step);
/// True if the text contains a %d conversion.
bool is_numbered(std::string_view text);

/// Three axes of unit length of which some are given: the others become perpendicular ones. Throws Error{data} if two
/// that are given are parallel.
void complete_directions(Geometry& geometry, std::array<bool, 3> known);
/// Splits a vector into its length and direction. Throws Error{data} naming `what` if it is zero or not finite.
void set_axis(Geometry& geometry, int axis, Vec3 vector, std::string const& what);

/// True if two volumes can be entries of one series in a file: equal dims, type, geometry, value map.
bool same_lattice(Header const& a, Header const& b);

/// The history as one line of JSON of at most so many bytes (at least 64), folded until it is, and back; text that is
/// no history is nullopt.
std::string history_text(History const& history, std::size_t most_bytes);
std::optional<History> parse_history(std::string const& text);

/// False if a file needs not say it: silent, or given and without a history.
bool says_error(Header const& header);
/// What is no error as headers have it is unknown.
VolumeError parse_volume_error(std::string const& json);

/// Attributes that a format has no other place for as one line of JSON, and back; text that is none is empty.
std::string attributes_text(std::map<std::string, std::string> const& attributes);
std::map<std::string, std::string> parse_attributes(std::string const& text);

} // namespace vkt
