// The bytes of arrays of VTK's XML files, which lie inline or appended, in base64 or raw, compressed in blocks or not.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/vti_structure.h"

#include <memory>

namespace vkt {

/// The decoded bytes of one array.
class VtiData {
public:
    /// `size` is how many bytes it must have. The structure and the bytes must live as long. Throws Error{data} where
    /// the array states another size.
    VtiData(ByteSource const& bytes, VtiStructure const& structure, VtiArray const& array, std::int64_t size);
    ~VtiData();
    VtiData(VtiData const&) = delete;
    VtiData& operator=(VtiData const&) = delete;

    /// Copies the bytes [position, position + n), in this machine's byte order.
    void read(std::int64_t position, std::byte* to, std::int64_t n);

private:
    class Impl;
    std::unique_ptr<Impl> impl_;
};

} // namespace vkt
