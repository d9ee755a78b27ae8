// The other side: what a child that parses does with its file, its limits and its requests.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/io/message.h"

#include <cstddef>
#include <functional>
#include <span>
#include <string>

namespace vkt {

/// The descriptors that a child finds when it begins, and the exit code by which it says that it cannot begin.
inline constexpr int parser_socket = 3, parser_file = 4;
inline constexpr int parser_unusable = 127;

/// What a child says of its own accord, once, when its library has started.
inline constexpr std::int64_t parser_ready = 0x7265616479;

/// The request that brings shared memory along. Those of modules have other numbers, from 0 up.
inline constexpr std::int64_t share_request = -1;

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool sanitized_build = true;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
inline constexpr bool sanitized_build = true;
#else
inline constexpr bool sanitized_build = false;
#endif
#else
inline constexpr bool sanitized_build = false;
#endif

/// Adds what answers one request; `window` is the shared memory, empty before there is any. What it throws is an answer
/// too.
using ParserHandler = std::function<void(Message& request, std::span<std::byte> window, Message& answer)>;

/// What a module does for a file: opens it by name and returns who answers questions about it.
using ParserOpen = ParserHandler (*)(std::string const& path);

/// What is said to a child when it starts.
struct ParserTask {
    std::string name;       ///< of the file in messages
    int parent = 0;         ///< process with which it ends
    std::size_t memory = 0; ///< most bytes
    int seconds = 0;        ///< of processor time
};

/// Takes the limits on, sees to it that this process ends with its parent, loads the library, says that it is ready,
/// and answers until nobody asks any more. `load` is called within the limits; what it throws is the answer to
/// everything. Returns the exit code.
int run_parser(ParserTask const& task, std::function<ParserOpen()> const& load);

} // namespace vkt
