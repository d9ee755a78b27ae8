// Identifiers of the HDF5 library that close themselves.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <utility>

namespace vkt::hdf5 {

/// Closes what it holds. What the library calls hid_t is an integer of 64 bits; its header is left to those who call
/// it.
class Handle {
public:
    Handle(std::int64_t id, int (*close)(std::int64_t)) : id_(id), close_(close) {}
    ~Handle() { reset(); }
    Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
    Handle& operator=(Handle&&) = delete;
    explicit operator bool() const { return id_ >= 0; }
    operator std::int64_t() const { return id_; }
    /// False if what was to be written could not be.
    bool reset() { return id_ < 0 || close_(std::exchange(id_, -1)) >= 0; }

private:
    std::int64_t id_;
    int (*close_)(std::int64_t);
};

} // namespace vkt::hdf5
