// All of a header in an attribute of its dataset, for vkt.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"

#include <hdf5.h>

#include <string>

namespace vkt::hdf5 {

/// A text of any length. False if the library cannot.
bool put_words(hid_t object, char const* name, std::string const& value);
/// As much of the history as there is room for; nothing of a header that is larger than attributes may be.
bool put_header(hid_t object, Header const& header);

} // namespace vkt::hdf5
