// Vectors whose memory comes in huge pages from the pool of large blocks.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"

#include <new>
#include <vector>

namespace vkt {

/// allocate_host() for containers. What is made without a value is left as it is: writing zeros first would touch all
/// memory twice.
template <class T> struct LargeAllocator {
    using value_type = T;

    LargeAllocator() = default;
    template <class U> explicit(false) LargeAllocator(LargeAllocator<U> const&) {}
    T* allocate(std::size_t n) {
        if (n > (std::size_t{1} << 62) / sizeof(T)) throw std::bad_array_new_length();
        return reinterpret_cast<T*>(allocate_host(n * sizeof(T)));
    }
    void deallocate(T* data, std::size_t n) { free_host(reinterpret_cast<std::byte*>(data), n * sizeof(T)); }
    template <class U> void construct(U* at) { ::new (static_cast<void*>(at)) U; }
    template <class U, class... A> void construct(U* at, A&&... arguments) {
        ::new (static_cast<void*>(at)) U(std::forward<A>(arguments)...);
    }
    bool operator==(LargeAllocator const&) const { return true; }
};

/// For tables that grow to many megabytes: touching fresh small pages would cost more than filling them. Not in
/// kernels: the functions of a template compiled for newer processors could be taken for those of all.
template <class T> using LargeVector = std::vector<T, LargeAllocator<T>>;

} // namespace vkt
