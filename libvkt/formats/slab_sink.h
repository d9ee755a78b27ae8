// The sink behind every file format that takes voxels in order: a small ring of slabs and a thread that writes them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/source.h"

#include <cstddef>
#include <memory>

namespace vkt {

/// What a format adds: headers, encodings, files. Calls come in the order begin, write…, end, begin, …, close and never
/// two at once, but write() from another thread. Destruction without close() leaves nothing behind.
class VolumeWriter {
public:
    virtual ~VolumeWriter() = default;
    virtual void begin(Header const& header) = 0;
    virtual void write(std::byte const* voxels, std::size_t n) = 0; ///< the next n bytes, x fastest
    virtual void end() {}
    virtual void close() = 0;
    virtual void plan(Header const& /*header*/) {} ///< as that of a Sink
};

/// Checks the order of slabs, lends reused memory, writes behind. An error in write() surfaces in the next call.
std::unique_ptr<Sink> slab_sink(std::unique_ptr<VolumeWriter> writer);

} // namespace vkt
