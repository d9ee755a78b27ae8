// Attributes of HDF5's objects, as far as they are of the type that is asked for.
// SPDX-License-Identifier: MIT
#pragma once

#include <hdf5.h>

#include <optional>
#include <string>
#include <vector>

namespace vkt::hdf5 {

inline constexpr hssize_t longest_list = 8192; ///< of an attribute, which is no larger than 64 KiB

/// Empty if there is none of numbers, or it has more.
std::vector<double> numbers(hid_t object, char const* name, hssize_t most = 64);
/// The only one, if it is finite.
std::optional<double> number(hid_t object, char const* name);
/// One text; empty if it is none.
std::string words(hid_t object, char const* name);
/// A list of texts of any length each; empty if it is none.
std::vector<std::string> texts(hid_t object, char const* name);

} // namespace vkt::hdf5
