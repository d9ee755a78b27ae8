// What the completion functions of shells offer: commands, options, and values as far as they can be known.
// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

namespace vkt::shell {

/// Candidates for the last of the words (which may be empty). Of the pipeline that vkt pipe takes as one word, which
/// may begin with its quote, each is all of that word.
std::vector<std::string> completions(std::vector<std::string> words);

} // namespace vkt::shell
