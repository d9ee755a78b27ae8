// What help, manual pages and packages say of an operation or a command.
// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

namespace vkt {

/// A command line that help shows first and tests execute, where there are volume.nrrd and engine_8x8x8_uint8.raw.
struct Example {
    std::string what;
    std::string line;
};

struct Texts {
    std::string summary;     ///< one sentence, capital first, full stop last
    std::string description; ///< paragraphs for help; may be empty
    std::vector<Example> examples;
};

} // namespace vkt
