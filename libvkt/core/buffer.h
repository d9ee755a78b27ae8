// Memory that knows where it lives: host pages advised to be huge, device memory, or both, migrated on demand.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/view.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>

namespace vkt {

/// Owns bytes with up to two residencies. Reading on a device copies there if needed and keeps the other copy valid;
/// writing invalidates the other. Moves are cheap; copies do not exist. Any number of threads may read. Host memory is
/// 64-byte aligned and comes in huge pages from 2 MiB up, because freshly touched 4 KiB pages cost more than most
/// kernels.
class Buffer {
public:
    Buffer() = default;
    explicit Buffer(std::size_t bytes); ///< with reserve(bytes)
    /// Memory that somebody else allocated and `owner` keeps alive; it is written to like any other.
    static Buffer adopt(std::byte* host, std::size_t bytes, std::shared_ptr<void> owner);
    /// The same of device memory, 256-byte aligned, of that GPU.
    static Buffer adopt_on_device(std::byte* memory, int device, std::size_t bytes, std::shared_ptr<void> owner);
    ~Buffer();
    Buffer(Buffer&& other) noexcept;
    Buffer& operator=(Buffer&& other) noexcept;
    Buffer(Buffer const&) = delete;
    Buffer& operator=(Buffer const&) = delete;

    std::size_t bytes() const { return bytes_; }
    /// Grows to at least `bytes`; contents are lost when it grows. Throws Error{resources}.
    void reserve(std::size_t bytes);

    std::byte* write(Space space);      ///< the memory there; other copies become stale
    std::byte* update(Space space);     ///< like write, but present contents are brought along first
    std::byte const* read(Space space); ///< the contents there, migrated if they are elsewhere
    bool resident(Space space) const;
    int device() const { return device_index_; } ///< of the contents there, if they are resident

private:
    void release();
    std::byte* memory(Space space);

    std::byte* host_ = nullptr;
    std::byte* device_ = nullptr;
    /// Of the GPU whose memory device_ is: copies go through its stream, whatever the thread uses.
    int device_index_ = 0;
    std::shared_ptr<void> owner_; ///< of what was adopted
    Space adopted_ = Space::host; ///< where that is
    std::size_t bytes_ = 0;
    bool host_valid_ = false, device_valid_ = false;
    mutable std::mutex moving_; ///< readers that want the contents where they are not yet
};

/// Aligned, huge-page-advised host memory. Throws Error{resources} when there is none.
std::byte* allocate_host(std::size_t bytes);
void free_host(std::byte* data, std::size_t bytes);

} // namespace vkt
