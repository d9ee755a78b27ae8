// A file that is there, of which a changed copy takes the name.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/hdf5/handle.h"
#include "libvkt/io/output_file.h"

#include <cstddef>
#include <optional>
#include <string>

namespace vkt::hdf5 {

/// The library prints nothing of what fails in this thread: every thread has a setting of its own.
void keep_quiet();

/// How files are opened that are written.
Handle access_to_write();

/// The temporary file of `file` as a copy of what has its name now, open to be changed; none if there is no such file.
/// `more` bytes are going to be added. Throws Error{io, data}.
std::optional<Handle> copy_of_existing(OutputFile const& file, std::size_t more);

/// What has the name of `file` now, open to be looked at; none if there is no such file. Throws Error{data}.
std::optional<Handle> existing(OutputFile const& file);

/// True if something has this path in an open copy; the file's groups lead there. Throws Error{usage} for a group, a
/// path through what is none, and one that leads on to another file, in which nothing is to be changed.
bool is_taken(std::int64_t copy, std::string const& path, OutputFile const& file);

} // namespace vkt::hdf5
