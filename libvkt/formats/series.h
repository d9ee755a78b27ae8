// Several volumes in several files: 'step_*.raw' in, 'out_%04d.nrrd' out.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/source.h"
#include "libvkt/formats/format.h"

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace vkt {

/// The files that a path with *, ? or [ ] stands for, numbers in their names compared as numbers (step_9 before
/// step_10), or a path with a number's place that is no file itself (slice%04d.png). Any other path stands for itself.
/// Throws Error{io} if none matches.
std::vector<std::string> matching_files(std::string const& path);

/// The volumes of several inputs one after another; each input is opened when its turn comes.
std::unique_ptr<Source> series_source(std::vector<std::string> paths,
                                      std::function<std::unique_ptr<Source>(std::string const&)> open);

/// True if the path has a number's place: one "%d", "%4d" or "%04d" ("%%" is a per cent sign).
bool is_numbered(std::string const& path);
/// The path with the number in its place. Throws Error{usage} for anything else after a per cent sign.
std::string numbered_path(std::string const& path, std::int64_t number);

/// Makes the sink of one file.
using CreateFile = std::function<std::unique_ptr<Sink>(std::string const& path, WriteOptions const& options)>;

/// One file per volume, or one for each slice of all volumes, numbered from 0. Those of a volume appear under their
/// names when it is whole; slices one by one where they are more than the files that a process may have open.
/// The options are those of each, to which what slices know of one another is added.
std::unique_ptr<Sink> numbered_sink(std::string pattern, bool slices, WriteOptions options, CreateFile create);

} // namespace vkt
