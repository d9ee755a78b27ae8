// Arrays in Zarr stores and what OME-Zarr says of them: which array a name means, its scales, names and units.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/choices.h"
#include "libvkt/formats/zarr_array.h"

#include <nlohmann/json_fwd.hpp>

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace vkt::zarr {

/// Attribute of an array of vkt's: for the dimensions that enumerate volumes, what each of these says of its place.
inline constexpr char const* series_attribute = "vkt_series";

/// Units of time as NRRD and NIfTI spell them, and as OME-NGFF does.
inline constexpr std::pair<char const*, char const*> units_of_time[] = {
    {"s", "second"}, {"ms", "millisecond"}, {"us", "microsecond"}, {"ns", "nanosecond"}, {"min", "minute"}};

/// The member of an object; null if there is none, or if it is no object.
nlohmann::json const* member(nlohmann::json const& object, char const* name);
/// A member that is text; "" for anything else.
std::string words(nlohmann::json const& object, char const* name);

/// What an OME-Zarr group says of one of its arrays.
struct Level {
    std::string path;
    std::vector<double> scale, translation; ///< of all dimensions; may be empty
};
struct Multiscale {
    std::vector<Level> levels; ///< the finest first
    std::vector<std::string> names, kinds, units;
    std::vector<std::string> channels; ///< what they are called; may be empty
};

/// An array, and what is known about it from around it.
struct Found {
    Array array;
    std::optional<Multiscale> image;
    std::size_t level = 0;
    /// Of each dimension, the array that says where its samples lie; empty, or as many as there are dimensions.
    std::vector<std::optional<Array>> coordinates;
    Choices choices{}; ///< where several are there and none was named: this is the first
};

/// The array at `inside` below a folder; without a name, the only one there, or the finest of an image. `shown` is how
/// messages name the store. Throws Error{data} for what is damaged, Error{usage} for names that are not there.
Found find_array(Store const& store, std::string const& shown, std::string const& folder, std::string const& inside);

} // namespace vkt::zarr
