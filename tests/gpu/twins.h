// What comparing and timing on a GPU share: volumes in both memories, and operations by their words.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/device.h"
#include "libvkt/engine/registry.h"

#include <memory>
#include <string>
#include <vector>

namespace vkt::gpu_test {

/// What is compared and timed has one of these words in its name; empty: all.
std::vector<std::string>& wanted_words();
bool is_wanted(std::string const& what);

Execution cpu();
Execution gpu();

constexpr std::byte poison{0xa5};

/// Device memory with a host image. Rows have gaps and start off any alignment, so that strays are seen.
struct Twin {
    Twin(DataType t, Box const& b, std::int64_t gap) : type(t), box(b) {
        Index3 const n = b.dims();
        row = n.x + gap;
        slice = row * n.y + 2 * gap;
        first = gap;
        bytes = static_cast<std::size_t>(first + slice * n.z) * size_of(t);
        host.assign(bytes, poison);
        device = device_allocate(bytes);
        upload();
    }
    ~Twin() { device_free(device); }
    Twin(Twin const&) = delete;
    Twin& operator=(Twin const&) = delete;

    void upload() { copy_to_device(device, host.data(), bytes); }
    std::vector<std::byte> download() const {
        std::vector<std::byte> result(bytes);
        copy_to_host(result.data(), device, bytes);
        return result;
    }
    AnyView view(Space space) {
        std::byte* const base = space == Space::device ? device : host.data();
        return {base + static_cast<std::size_t>(first) * size_of(type), type, box, row, slice, space};
    }

    DataType type;
    Box box;
    std::int64_t row, slice, first;
    std::size_t bytes;
    std::vector<std::byte> host;
    std::byte* device;
};

/// Numbers from 0 to 100 in no order.
void randomise(Twin& volume, unsigned seed);

/// The voxels that an operation wants to see first, so many slices at a time; 0: all at once.
void scan(Operation& operation, ConstView in, std::int64_t slab, Execution const& execution);

/// As on the command line.
std::unique_ptr<Operation> operation_of(std::vector<std::string> words);
std::vector<std::string> words_of(std::string const& line);

} // namespace vkt::gpu_test
