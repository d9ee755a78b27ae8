// Loaded before libvkt: a GPU whose memory is the host's, so that what moves and who owns what can be tested anywhere.
// SPDX-License-Identifier: MIT
#include "libvkt/core/device.h"
#include "libvkt/core/execution.h"

#include <cstdlib>
#include <cstring>
#include <iterator>
#include <map>
#include <mutex>

namespace {

// NOLINTBEGIN: the functions in whose place these are have no object either
std::mutex mutex;
std::map<std::byte const*, std::size_t> blocks;
// NOLINTEND

} // namespace

namespace vkt {

bool built_with_cuda() { return true; }
int gpu_count() { return 1; }
int device_count() { return 1; }
void device_select(int) {}
int device_current() { return 0; }
int device_of(void const* memory) {
    std::lock_guard const lock(mutex);
    auto const* const at = static_cast<std::byte const*>(memory);
    auto const next = blocks.upper_bound(at);
    if (next == blocks.begin()) return -1;
    auto const& [begin, bytes] = *std::prev(next);
    return at < begin + bytes ? 0 : -1;
}
std::byte* device_allocate(std::size_t bytes) {
    auto* const data = static_cast<std::byte*>(std::aligned_alloc(256, (bytes + 255) / 256 * 256));
    std::lock_guard const lock(mutex);
    blocks[data] = bytes;
    return data;
}
void device_free(std::byte* data, int) noexcept {
    std::lock_guard const lock(mutex);
    if (blocks.erase(data) == 0) std::abort(); // freed twice, or not from here
    std::free(data);
}
void copy_to_device(void* to, void const* from, std::size_t n) { std::memcpy(to, from, n); }
void copy_to_host(void* to, void const* from, std::size_t n) { std::memcpy(to, from, n); }
void copy_on_device(void* to, void const* from, std::size_t n) { std::memcpy(to, from, n); }
void device_clear(void* at, std::size_t n) { std::memset(at, 0, n); }
void device_synchronize() {}

} // namespace vkt

// For the test, which plays another package.
extern "C" {
void* host_gpu_allocate(std::size_t bytes) { return vkt::device_allocate(bytes); }
void host_gpu_free(void* data) { vkt::device_free(static_cast<std::byte*>(data), 0); }
std::size_t host_gpu_blocks() {
    std::lock_guard const lock(mutex);
    return blocks.size();
}
}
