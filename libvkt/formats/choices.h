// Files that hold several arrays of which nobody chose one: the first one's header tells of all, none is read.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/error.h"
#include "libvkt/engine/source.h"

#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace vkt {

/// Arrays by their names, with a word about each, and what else there is.
struct Choices {
    std::vector<std::pair<std::string, std::string>> names;
    std::vector<std::string> not_read;
};

/// "uint8, 4 x 5 x 6": the extents along x, y and so on.
std::string about_array(DataType type, std::vector<std::int64_t> const& extents);

/// The source of the first array, with the attributes "variables" and "variable NAME". Reading throws `refusal`.
std::unique_ptr<Source> unchosen(std::unique_ptr<Source> first, Choices choices, Error refusal);

/// The source, with what else there is in its file.
std::unique_ptr<Source> beside_others(std::unique_ptr<Source> source, std::vector<std::string> not_read);

} // namespace vkt
