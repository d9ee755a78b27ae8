// Loaded before the C library: from the VKT_NO_MEMORY_AT-th block of 128 bytes or more on, VKT_NO_MEMORY_FOR are
// refused. Smaller ones are not: nlohmann::json does not survive that.
// SPDX-License-Identifier: MIT
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>

extern "C" void* __libc_malloc(std::size_t bytes);

namespace {

std::atomic<long> count = 0;
long first = -1, refused = 0;

__attribute__((constructor)) void begin() {
    if (char const* const word = std::getenv("VKT_NO_MEMORY_AT")) first = std::atol(word);
    if (char const* const word = std::getenv("VKT_NO_MEMORY_FOR")) refused = std::atol(word);
    count = 0;
}

/// How many there were, for whoever asks by VKT_NO_MEMORY_AT=-1.
__attribute__((destructor)) void end() {
    if (first < 0) std::fprintf(stderr, "%ld\n", count.load());
}

} // namespace

extern "C" void* malloc(std::size_t bytes) {
    if (bytes < 128) return __libc_malloc(bytes);
    long const at = count++;
    if (first < 0 || at < first || at - first >= refused) return __libc_malloc(bytes);
    errno = ENOMEM;
    return nullptr;
}
