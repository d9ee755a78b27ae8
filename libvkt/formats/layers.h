// Voxels that come in pieces of any size, handed on layer by layer to formats that store chunks.
// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace vkt {

/// Bytes of a layer of chunks, which is some slices or, if it is less than one, some rows of a slice; of a slice, and
/// of all that comes.
struct LayerSizes {
    std::size_t layer = 0, slice = 0, all = 0;
};

/// Holds n bytes and calls flush(), which empties `held`, when a layer is complete and at the end of all. Rows of one
/// slice do not go with those of the next. written() tells how many bytes were flushed before.
template <class Written, class Flush>
void hold_layers(std::vector<std::byte>& held, LayerSizes const& sizes, std::byte const* voxels, std::size_t n,
                 Written const& written, Flush const& flush) {
    while (n > 0) {
        std::size_t const done = written() + held.size();
        std::size_t room = sizes.layer - held.size();
        if (sizes.layer < sizes.slice) room = std::min(room, sizes.slice - done % sizes.slice);
        std::size_t const count = std::min(n, room);
        held.insert(held.end(), voxels, voxels + count);
        voxels += count;
        n -= count;
        bool const slice_ends = sizes.layer < sizes.slice && (done + count) % sizes.slice == 0;
        if (held.size() == sizes.layer || slice_ends || done + count == sizes.all) flush();
    }
}

} // namespace vkt
