// Compression of HDF5's chunks that the library leaves to plugins: which filters are read here, and how others are
// named.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <string>

namespace vkt::hdf5 {

/// Makes the library decode LZF (h5py), Zstandard, LZ4, bzip2, Blosc and bitshuffle, as far as the build has their
/// libraries. They do not encode.
void register_filters();

/// What of the filters of a dataset with this creation property list nobody has: "filter 32026 (blosc2)"; empty if all
/// are there.
std::string absent_filter(std::int64_t creation);
/// The same of those that nobody here encodes.
std::string absent_encoder(std::int64_t creation);

} // namespace vkt::hdf5
