// Identifiers of the HDF5 library that close themselves.
// SPDX-License-Identifier: MIT
#pragma once

#include <hdf5.h>

#include <utility>

namespace vkt::hdf5 {

/// Closes what it holds.
class Handle {
public:
    Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
    ~Handle() { reset(); }
    Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
    Handle& operator=(Handle&&) = delete;
    explicit operator bool() const { return id_ >= 0; }
    operator hid_t() const { return id_; }
    /// False if what was to be written could not be.
    bool reset() { return id_ < 0 || close_(std::exchange(id_, -1)) >= 0; }

private:
    hid_t id_;
    herr_t (*close_)(hid_t);
};

} // namespace vkt::hdf5
