// Taking a dataset out of a file whose other datasets stay.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <string>

namespace vkt::hdf5 {

/// Removes what has this name in an open file, and takes it out of the lists of the scales of its dimensions. Throws
/// Error{usage} for a scale that other datasets name as theirs, and Error{data} for what this library is too old to
/// remove; `shown` is what messages call the file.
void remove_named(std::int64_t file, std::string const& path, std::string const& shown);

} // namespace vkt::hdf5
