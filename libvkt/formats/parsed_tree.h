// Trees read by a child: what its readers implement, how it answers, and the file as the process that asks sees it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/format.h"
#include "libvkt/formats/tree_file.h"
#include "libvkt/io/parser_child.h"

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace vkt {

/// One variable as its reader found it.
struct ParsedTree {
    Header header;
    std::vector<Brick> bricks;
    /// Where each brick's cells begin in the file, if they lie there as they are wanted: who asked reads them then,
    /// without the library. Otherwise empty.
    std::vector<std::int64_t> places;
    BrickSequence::Reader cells; ///< if there are no places
};

/// The reader of an open file; runs in a child and may crash.
class TreeParser {
public:
    virtual ~TreeParser() = default;
    virtual AmrListing const& listing() const = 0;
    /// As AmrFile::read.
    virtual ParsedTree read(AmrReadOptions const& options) = 0;
};

/// The child's side: answers what parsed_file asks.
ParserHandler answer_about(std::shared_ptr<TreeParser> file);

/// The file, read by a child in which `module` is loaded; `what` cannot be done without it. Cells come through shared
/// memory of 8 MiB or two bricks, one half filled while the other is copied, or straight from the file where they lie
/// as they are wanted. `memory` is the budget of parser_limits. Throws Error{data} for files that do its library harm.
std::shared_ptr<AmrFile> parsed_file(std::string const& module, std::string const& what,
                                     std::shared_ptr<ByteSource const> bytes, std::size_t memory);

} // namespace vkt
