// Formats that vkt does not read, told by their first bytes, so that a refusal says what a file is.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace vkt {

/// "a TIFF file" and the like, from the first 4 KiB of a file; empty if the bytes say nothing.
std::string foreign_format(std::span<std::byte const> head);

/// The same from the name, for files that do not say it in their first bytes: "a FreeSurfer volume", and how to turn it
/// into something that vkt reads. Empty if the name says nothing.
struct ForeignName {
    std::string_view what, how;
};
ForeignName foreign_name(std::string const& path);

/// What lies where a file should be: "a pointer of Git LFS, not the file itself", and what to do. Empty for others.
ForeignName stand_in(std::span<std::byte const> head);

/// The name of a picture in a format that vkt does not write: "scan.jpg".
bool names_foreign_picture(std::string const& path);

} // namespace vkt
