// The side channel between the two processes at the ends of one pipe: who they are, and a ring of shared memory.
// SPDX-License-Identifier: MIT
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

namespace vkt::ipc {

/// Anonymous memory divided into slots, mapped by both ends. Allocated in full before use, so that running out is an
/// error here and never a fault later; it has no name, so nothing can be left behind.
class SharedRing {
public:
    /// Throws Error{resources} when the memory cannot be had.
    static SharedRing create(std::uint32_t slots, std::size_t slot_bytes);
    /// Maps a ring that the other end created; checks its size. Takes ownership of the descriptor.
    /// A single slot is a segment for a whole volume: what the consumer changes there is seen by nobody else.
    static SharedRing open(int descriptor, std::uint32_t slots, std::size_t slot_bytes);
    SharedRing(SharedRing&&) noexcept;
    SharedRing& operator=(SharedRing&&) noexcept;
    ~SharedRing();

    std::uint32_t slots() const { return slots_; }
    std::size_t slot_bytes() const { return slot_bytes_; }
    std::byte* slot(std::uint32_t index) const;
    int descriptor() const { return descriptor_; }

private:
    SharedRing();
    enum class Rights : std::uint8_t { read, write, copy_on_write };
    void map(Rights rights);

    struct Mapping;
    std::unique_ptr<Mapping> mapping_;
    int descriptor_ = -1;
    std::uint32_t slots_ = 0;
    std::size_t slot_bytes_ = 0;
};

/// A slot as frames name it: the ring's generation in the upper half, the index in the lower.
inline std::uint32_t slot_name(std::uint32_t generation, std::uint32_t index) { return generation << 16 | index; }

/// The producer's end: waits for the process that reads our pipe to make itself known.
class ProducerChannel {
public:
    /// Listens under a name made of the user and the pipe's inode. Does nothing useful if `pipe` is no pipe.
    explicit ProducerChannel(int pipe);
    ~ProducerChannel();
    ProducerChannel(ProducerChannel const&) = delete;
    ProducerChannel& operator=(ProducerChannel const&) = delete;

    /// True once a vkt process of the same user reads our pipe directly.
    bool connected(std::chrono::milliseconds wait = std::chrono::milliseconds(0));
    /// Makes a ring and hands it to the consumer. Throws Error{resources}.
    void share_ring(std::uint32_t slots, std::size_t slot_bytes);
    SharedRing* ring() { return ring_ ? &*ring_ : nullptr; }
    std::uint32_t generation() const { return generation_; }
    /// True if the consumer, once connected, asked for one segment per volume instead of a ring.
    bool wants_whole() const { return wants_whole_; }
    /// A free slot of the newest ring; waits for the consumer to return one. Throws BrokenPipe when it is gone.
    std::uint32_t acquire_slot();

private:
    void receive_returns(bool wait);

    int pipe_;
    int listener_ = -1, peer_ = -1;
    bool wants_whole_ = false;
    std::optional<SharedRing> ring_; ///< the newest: the consumer has mappings of its own
    std::uint32_t generation_ = 0;
    std::vector<std::uint32_t> free_;
};

/// The consumer's end.
class ConsumerChannel {
public:
    /// Connects to the producer at the other end of `pipe`, if it is a vkt process of the same user. `whole` asks for
    /// one segment per volume instead of a ring.
    explicit ConsumerChannel(int pipe, bool whole = false);
    ~ConsumerChannel();
    ConsumerChannel(ConsumerChannel const&) = delete;
    ConsumerChannel& operator=(ConsumerChannel const&) = delete;

    bool connected() const { return peer_ >= 0; }
    /// Memory of a slot named in a frame. Throws Error{data} if the producer never shared it or `bytes` exceed it.
    std::byte const* slot(std::uint32_t name, std::size_t bytes);
    void give_back(std::uint32_t name);
    /// The memory that a slot belongs to, to be kept beyond the life of this channel.
    std::shared_ptr<SharedRing> memory_of(std::uint32_t name) const { return rings_[(name >> 16) - 1]; }

private:
    void receive_ring();

    int peer_ = -1;
    std::deque<std::shared_ptr<SharedRing>> rings_;
};

} // namespace vkt::ipc
