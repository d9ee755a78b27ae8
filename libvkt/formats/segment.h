// Volumes in named segments of shared memory (io/shared_memory.h): written in place, mapped without a copy.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace vkt {

/// What is known of a segment without mapping it.
struct SegmentSummary {
    enum class State : std::uint8_t {
        whole,
        unfinished, ///< its writer never came to the end
        damaged,    ///< what it says of itself cannot be true
    };
    std::string name; ///< "shm:NAME"
    State state = State::damaged;
    std::int64_t bytes = 0;       ///< of memory that it takes
    std::int64_t age = 0;         ///< seconds since it was written
    std::optional<Header> header; ///< of whole ones
};

/// The segments of this user, in alphabetical order.
std::vector<SegmentSummary> list_segments();

} // namespace vkt
