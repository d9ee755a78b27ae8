// Host memory in large blocks, device memory through the device runtime, migration between them.
// SPDX-License-Identifier: MIT
#include "libvkt/core/buffer.h"

#include "libvkt/core/device.h"
#include "libvkt/core/error.h"
#include "libvkt/core/pool.h"
#include "libvkt/core/text.h"

#include <cstdlib>
#include <new>
#include <utility>

namespace vkt {
namespace {

constexpr std::size_t alignment = 64;

std::size_t rounded(std::size_t bytes, std::size_t unit) { return (bytes + unit - 1) / unit * unit; }

[[noreturn]] void no_memory(std::size_t bytes) {
    throw Error(ErrorKind::resources, text("cannot allocate ", bytes_text(static_cast<double>(bytes)), " of memory"));
}

} // namespace

std::byte* allocate_host(std::size_t bytes) {
    if (bytes == 0) bytes = 1;
    if (bytes > (std::size_t{1} << 62)) no_memory(bytes);
    if (bytes < huge_page) {
        void* data = std::aligned_alloc(alignment, rounded(bytes, alignment));
        if (data == nullptr) no_memory(bytes);
        return static_cast<std::byte*>(data);
    }
    std::byte* const block = take_block(bytes);
    if (block == nullptr) no_memory(bytes);
    return block;
}

void free_host(std::byte* data, std::size_t bytes) {
    if (data == nullptr) return;
    if (bytes < huge_page)
        std::free(data);
    else
        return_block(data, bytes);
}

Buffer::~Buffer() { release(); }

Buffer::Buffer(Buffer&& other) noexcept { *this = std::move(other); }

Buffer& Buffer::operator=(Buffer&& other) noexcept {
    std::swap(host_, other.host_);
    std::swap(device_, other.device_);
    std::swap(device_index_, other.device_index_);
    std::swap(owner_, other.owner_);
    std::swap(adopted_, other.adopted_);
    std::swap(bytes_, other.bytes_);
    std::swap(host_valid_, other.host_valid_);
    std::swap(device_valid_, other.device_valid_);
    return *this;
}

Buffer::Buffer(std::size_t bytes) { reserve(bytes); }

Buffer Buffer::adopt(std::byte* host, std::size_t bytes, std::shared_ptr<void> owner) {
    Buffer buffer;
    buffer.host_ = host;
    buffer.bytes_ = bytes;
    buffer.owner_ = std::move(owner);
    buffer.host_valid_ = true;
    return buffer;
}

Buffer Buffer::adopt_on_device(std::byte* memory, int device, std::size_t bytes, std::shared_ptr<void> owner) {
    Buffer buffer;
    buffer.device_ = memory;
    buffer.device_index_ = device;
    buffer.bytes_ = bytes;
    buffer.owner_ = std::move(owner);
    buffer.adopted_ = Space::device;
    buffer.device_valid_ = true;
    return buffer;
}

void Buffer::release() {
    if (!owner_ || adopted_ != Space::host) free_host(host_, bytes_);
    if (device_ != nullptr && (!owner_ || adopted_ != Space::device)) device_free(device_, device_index_);
    owner_.reset();
    host_ = device_ = nullptr;
    host_valid_ = device_valid_ = false;
}

void Buffer::reserve(std::size_t bytes) {
    if (bytes <= bytes_) return;
    release();
    bytes_ = bytes;
}

std::byte* Buffer::memory(Space space) {
    if (space == Space::host) {
        if (host_ == nullptr) host_ = allocate_host(bytes_);
        return host_;
    }
    if (device_ == nullptr) {
        device_ = device_allocate(bytes_ == 0 ? 1 : bytes_);
        device_index_ = device_current();
    }
    return device_;
}

std::byte* Buffer::write(Space space) {
    std::byte* const data = memory(space);
    host_valid_ = space == Space::host;
    device_valid_ = space == Space::device;
    return data;
}

bool Buffer::resident(Space space) const {
    std::lock_guard const lock(moving_);
    return space == Space::host ? host_valid_ : device_valid_;
}

std::byte const* Buffer::read(Space space) {
    std::lock_guard const lock(moving_);
    std::byte* const data = memory(space);
    bool const to_device = space == Space::device && !device_valid_ && host_valid_;
    bool const to_host = space == Space::host && !host_valid_ && device_valid_;
    if (to_device || to_host) device_select(device_index_);
    if (to_device) copy_to_device(device_, host_, bytes_);
    if (to_host) copy_to_host(host_, device_, bytes_);
    (space == Space::host ? host_valid_ : device_valid_) = true;
    return data;
}

std::byte* Buffer::update(Space space) {
    read(space);
    return write(space);
}

} // namespace vkt
