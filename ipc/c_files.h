// Files of the C API: what calls say about them, and how they are opened.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution_options.h"
#include "libvkt/core/history.h"
#include "libvkt/formats/request.h"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

namespace vkt::ipc {

/// The words of vkt_read(): what is asked of a file, and how to run.
class ReadWords {
public:
    ReadWords(char const* const* words, std::size_t count, ExecutionOptions policy);
    ReadWords(ReadWords const&) = delete; // parameters point to what they set
    ReadWords& operator=(ReadWords const&) = delete;

    ExecutionOptions const& options() const { return options_; }
    /// The volumes that were asked for of a file of any format, a stream among them, or of several by a pattern.
    /// `waiting`: see StreamOptions.
    std::unique_ptr<Source> open(std::string const& path, std::function<void()> waiting) const;
    /// How the history of a volume begins that has none.
    History step(std::string const& path) const;
    /// The same of one of several that were asked for, counted from 0.
    History step(std::string const& path, std::int64_t volume) const;

private:
    ReadRequest request_;
    Parameters parameters_;
    ExecutionOptions options_;
};

/// A file that holds all volumes; or one for each of them, or for each slice, where the name has a place for numbers.
std::unique_ptr<Sink> file_sink(std::string const& path, WriteOptions options, Execution const& execution);

} // namespace vkt::ipc
