// From words to parameters: the only place with CLI11.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/parameters.h"

#include <string>
#include <vector>

namespace vkt::shell {

/// Parses the words into all lists at once. Unknown options, missing values and surplus words throw Error{usage} with a
/// suggestion, or the command whose help tells; values are set in the order of declaration.
void parse_words(std::vector<std::string> const& words, std::vector<Parameters*> const& lists,
                 std::string const& command);

} // namespace vkt::shell
