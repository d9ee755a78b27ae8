// Large blocks of host memory that are not in use, kept so that the next result need not touch fresh pages.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>

namespace vkt {

/// Bytes of a huge page.
inline constexpr std::size_t huge_page = std::size_t{2} << 20;

/// From now on blocks of 2 MiB or more that are freed are kept, `bytes` in all, together with what is asked for next;
/// 0, as at the start, keeps none. Libraries that compute one result after the other want this; a process that streams
/// reuses its slabs anyway. The kernel may take kept pages back when memory is short, and they are given back when an
/// allocation fails or would leave less than nothing of the limit of a control group.
void keep_blocks(std::size_t bytes);
/// Gives all kept blocks back to the system. Returns how many bytes that were.
std::size_t release_blocks();
/// Bytes of kept blocks.
std::size_t kept_block_bytes();

/// Memory that begins on a huge page and takes no more than asked for, in whole pages of 4 KiB, its contents
/// unspecified; null if there is none.
std::byte* take_block(std::size_t bytes);
void return_block(std::byte* data, std::size_t bytes);

} // namespace vkt
