// Keeping a whole volume so that it can be read again in any order: memory up to the budget, an unlinked file beyond.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/source.h"

namespace vkt {

/// Swallows the current volume of a source and serves it with random access. The file has no name from the start, so
/// nothing remains whatever happens to the process. Disk full is Error{io}.
class Spool {
public:
    Spool(Source& source, Execution const& execution, StageInfo const& info);
    ~Spool();
    Spool(Spool const&) = delete;
    Spool& operator=(Spool const&) = delete;

    void read(AnyView out);
    std::optional<ConstView> borrow(Box const& region) const;

private:
    void open_file(std::string const& directory);
    void write_slab(ConstView slab);

    Header header_;
    Buffer memory_;
    ConstView voxels_;
    Buffer scratch_;
    int file_ = -1;
    std::string directory_;
};

} // namespace vkt
