// The volume that --like names: its header says what region or which grid is wanted.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/read_once.h"
#include "libvkt/engine/source.h"

#include <string>

namespace vkt {

/// A volume file of which only the header matters, and which is opened only once, since it may be a pipe.
class ReferenceVolume {
public:
    std::string file; ///< empty: none

    /// Its header from whoever has opened it, which may be one who knows more formats than the library. Throws
    /// Error{data} if it holds no volume.
    void take(Source& opened) const;
    /// Opens the file unless somebody did. Throws Error{io} or Error{data}.
    Header const& header() const;

private:
    ReadOnce<Header> header_;
};

} // namespace vkt
