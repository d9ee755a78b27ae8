// Reading a text file of moderate size.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <string>

namespace vkt {

/// All of a file, a pipe or "-". Throws Error{io}, and Error{data} if it has more than `most` bytes.
std::string whole_text(std::string const& file, std::size_t most);

} // namespace vkt
