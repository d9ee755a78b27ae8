// The volume that --like names: its header says what region or how many voxels are wanted.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/source.h"

#include <optional>
#include <string>

namespace vkt {

/// A volume file of which only the header matters, and which is opened only once, since it may be a pipe.
class Like {
public:
    std::string file; ///< empty: none

    bool empty() const { return file.empty() && !header_; }
    /// For those who can open more than the library's file formats, or have no file.
    void take(Header header) { header_ = std::move(header); }
    /// Opens the file unless the header was given. Throws Error{io} or Error{data}.
    Header const& header() const;

private:
    mutable std::optional<Header> header_;
};

/// The first header of a source. Throws Error{data}, naming the file, if it holds no volume.
Header header_like(Source& source, std::string const& file);

} // namespace vkt
