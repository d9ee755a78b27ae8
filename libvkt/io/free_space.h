// Whether a file system has room for what is about to be written to a file.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <string>

namespace vkt {

/// Throws Error{io} "cannot DO: no space left on device: …" if so many bytes more do not fit where the open file or
/// directory lies.
/// Says nothing of pipes and devices, nor where the file system does not tell. Others may fill it meanwhile: writing
/// can fail all the same.
void require_space(int descriptor, std::size_t bytes, std::string const& cannot, std::string const& hint = {});

} // namespace vkt
