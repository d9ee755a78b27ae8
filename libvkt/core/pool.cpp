// One list of free blocks, the one last used at the end.
// SPDX-License-Identifier: MIT
#include "libvkt/core/pool.h"

#include "libvkt/core/cgroup.h"

#include <cstdint>
#include <mutex>
#include <sys/mman.h>
#include <vector>

namespace vkt {
namespace {

constexpr std::size_t small_page = std::size_t{4} << 10;

/// The end of a block is in small pages: up to 2 MiB more than were asked for would be in no plan.
std::size_t rounded(std::size_t bytes) { return (bytes + small_page - 1) / small_page * small_page; }

/// Over-maps and trims so that the block starts on a huge page; otherwise up to 2 MiB there fall back to 4 KiB.
std::byte* map_block(std::size_t size) {
    void* const mapping =
        mmap(nullptr, size + huge_page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (mapping == MAP_FAILED) return nullptr;
    auto* const begin = static_cast<std::byte*>(mapping);
    std::size_t const past = reinterpret_cast<std::uintptr_t>(begin) % huge_page;
    std::size_t const head = past == 0 ? 0 : huge_page - past;
    if (head > 0) munmap(begin, head);
    if (head < huge_page) munmap(begin + head + size, huge_page - head);
    madvise(begin + head, size, MADV_HUGEPAGE);
    return begin + head;
}

struct Block {
    std::byte* data;
    std::size_t bytes;
};

class Pool {
public:
    void keep(std::size_t bytes) {
        std::lock_guard const lock(mutex_);
        capacity_ = bytes;
        shrink(capacity_);
    }
    std::size_t release() {
        std::lock_guard const lock(mutex_);
        std::size_t const bytes = kept_;
        shrink(0);
        return bytes;
    }
    std::size_t kept() {
        std::lock_guard const lock(mutex_);
        return kept_;
    }

    /// A kept block, or null after making room for a fresh one.
    std::byte* take(std::size_t size) {
        // Held by another thread, or for ever by one that did not survive a fork(): a fresh block is as good.
        std::unique_lock const lock(mutex_, std::try_to_lock);
        if (!lock || blocks_.empty()) return nullptr;
        // The smallest that is large enough, unless much would be cut off, which what is asked for next would miss.
        auto best = blocks_.end();
        for (auto b = blocks_.begin(); b != blocks_.end(); ++b)
            if (b->bytes >= size && b->bytes - size <= size / 4 && (best == blocks_.end() || b->bytes <= best->bytes))
                best = b;
        if (best == blocks_.end()) {
            shrink(capacity_ > size ? capacity_ - size : 0);
            if (kept_ == 0) return nullptr;
            std::size_t const left = cgroup_memory_left();
            if (left < size) shrink(kept_ > size - left ? kept_ - (size - left) : 0);
            return nullptr;
        }
        Block const block = *best;
        blocks_.erase(best);
        kept_ -= block.bytes;
        if (block.bytes > size) munmap(block.data + size, block.bytes - size);
        return block.data;
    }

    void put(Block const& block) {
        std::unique_lock const lock(mutex_, std::try_to_lock);
        if (!lock || block.bytes > capacity_) {
            munmap(block.data, block.bytes);
            return;
        }
        shrink(capacity_ - block.bytes);
        madvise(block.data, block.bytes, MADV_FREE); // costs little, and nothing when the pages are written to again
        blocks_.push_back(block);
        kept_ += block.bytes;
    }

private:
    /// Unmaps the blocks that were not used for longest until no more than so many bytes are left.
    void shrink(std::size_t bytes) {
        std::size_t count = 0;
        for (; kept_ > bytes; ++count) {
            munmap(blocks_[count].data, blocks_[count].bytes);
            kept_ -= blocks_[count].bytes;
        }
        blocks_.erase(blocks_.begin(), blocks_.begin() + static_cast<std::ptrdiff_t>(count));
    }

    std::mutex mutex_;
    std::vector<Block> blocks_;
    std::size_t kept_ = 0, capacity_ = 0;
};

/// The process has one memory, and so one pool. It is never destroyed: buffers may outlive any order of destruction.
Pool& pool() {
    static Pool& the_pool = *new Pool;
    return the_pool;
}

} // namespace

void keep_blocks(std::size_t bytes) { pool().keep(bytes); }
std::size_t release_blocks() { return pool().release(); }
std::size_t kept_block_bytes() { return pool().kept(); }

std::byte* take_block(std::size_t bytes) {
    std::size_t const size = rounded(bytes);
    if (std::byte* const kept = pool().take(size)) return kept;
    std::byte* block = map_block(size);
    if (block == nullptr && release_blocks() > 0) block = map_block(size);
    return block;
}

void return_block(std::byte* data, std::size_t bytes) { pool().put({data, rounded(bytes)}); }

} // namespace vkt
