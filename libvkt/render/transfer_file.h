// Transfer functions from files, or from what stands for one on a command line.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/transfer.h"

#include <string>

namespace vkt::render {

/// What a file of up to 16 MiB holds, see transfer_from_json(). Throws Error{io} and Error{data}.
TransferFunction read_transfer(std::string const& file);
/// The same of a word that names a file, or is what such a file holds.
TransferFunction transfer_of_word(std::string const& word);

} // namespace vkt::render
