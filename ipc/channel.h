// The side channel between the two processes at the ends of one pipe: who they are, and a ring of shared memory or of a
// GPU's.
// SPDX-License-Identifier: MIT
#pragma once

#include "ipc/gpu_memory.h"
#include "libvkt/engine/source.h"

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace vkt::ipc {

/// Anonymous memory divided into slots, mapped by both ends. Allocated in full before use, so that running out is an
/// error here and never a fault later; it has no name, so nothing can be left behind.
class SharedRing {
public:
    /// In the memory of a GPU, if one is given. Throws Error{resources} when the memory cannot be had.
    static SharedRing create(std::uint32_t slots, std::size_t slot_bytes, std::shared_ptr<GpuMemory> gpu = nullptr);
    /// Maps a ring that the other end created, there; checks its size. Takes ownership of the descriptor.
    /// A single slot of the host's memory is a segment for a whole volume: what the consumer changes there is seen by
    /// nobody else.
    static SharedRing open(int descriptor, std::uint32_t slots, std::size_t slot_bytes,
                           std::shared_ptr<GpuMemory> gpu = nullptr);

    std::uint32_t slots() const { return slots_; }
    std::size_t slot_bytes() const { return slot_bytes_; }
    std::byte* slot(std::uint32_t index) const { return memory_->data() + index * slot_bytes_; }
    int descriptor() const { return memory_->descriptor(); }
    bool on_gpu() const { return gpu_ != nullptr; }
    Space space() const { return gpu_ ? gpu_->space() : Space::host; }
    /// Waits until what this process wrote to slots is there, and what it reads from them was read. Throws
    /// Error{resources}.
    void settle() const {
        if (gpu_) gpu_->settle();
    }

private:
    SharedRing() = default;

    std::shared_ptr<GpuMemory> gpu_;
    std::unique_ptr<RingMemory> memory_;
    std::uint32_t slots_ = 0;
    std::size_t slot_bytes_ = 0;
};

/// A slot as frames name it: the ring's generation in the upper half, the index in the lower.
inline std::uint32_t slot_name(std::uint32_t generation, std::uint32_t index) { return generation << 16 | index; }

class SlotLease;

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
    /// Makes a ring, in the memory of a GPU if one is given, and hands it to the consumer; slots of those before are
    /// forgotten. Throws Error{resources}.
    void share_ring(std::uint32_t slots, std::size_t slot_bytes, std::shared_ptr<GpuMemory> gpu = nullptr);
    SharedRing const* ring() const { return ring_ ? &*ring_ : nullptr; }
    /// True if the consumer, once connected, asked for one segment per volume instead of a ring.
    bool wants_whole() const { return wants_whole_; }
    /// What keeps the consumer, once connected, from mapping memory of this GPU; empty if nothing does. Waits for it to
    /// get hold of its own. Throws BrokenPipe when it is gone.
    std::string gpu_obstacle(GpuMemory& gpu);
    /// The name of a free slot of the ring; waits for the consumer to return one, and calls `waiting`, if there is one,
    /// every 20 ms meanwhile. Throws BrokenPipe when it is gone.
    std::uint32_t acquire_slot(std::function<void()> const& waiting);
    /// The name of the only slot of a ring that holds a whole volume.
    std::uint32_t segment() const { return slot_name(generation_, 0); }
    std::byte* slot(std::uint32_t name) const { return ring_->slot(name & 0xffff); }
    /// Lets the consumer see a slot of the producer before us; the name by which it knows it. Waits while it holds so
    /// many of them that the producer before us could run out. Throws BrokenPipe when it is gone, Error{resources}.
    std::uint32_t pass_on(std::shared_ptr<SlotLease> lease);

private:
    void send_ring(SharedRing const& ring);
    bool receive_return(int flags);
    void take_back(std::uint32_t name);
    void relay();

    int pipe_;
    int listener_ = -1, peer_ = -1;
    bool wants_whole_ = false;
    bool works_on_gpu_ = false;            ///< the consumer does, and says which it is
    std::optional<DeviceIdentity> answer_; ///< …, which it has done; zeros if it cannot map memory
    std::uint32_t rings_sent_ = 0;
    std::optional<SharedRing> ring_; ///< the newest: the consumer has mappings of its own
    std::uint32_t generation_ = 0;   ///< of our ring, as the consumer counts those it was sent
    std::vector<std::uint32_t> free_;
    std::shared_ptr<SharedRing> passed_ring_; ///< of the producer before us
    std::uint32_t passed_generation_ = 0;
    std::vector<std::pair<std::uint32_t, std::shared_ptr<SlotLease>>> passed_; ///< what the consumer holds of it

    /// Runs from the first slot passed on: the producer before us gets it back though we may be waiting for input.
    std::thread relay_;
    std::mutex mutex_;
    std::condition_variable returned_;
    bool gone_ = false; ///< the consumer is
};

/// The consumer's end.
class ConsumerChannel {
public:
    /// Connects to the producer at the other end of `pipe`, if it is a vkt process of the same user. `whole` asks for
    /// one segment per volume instead of a ring; `gpu`, if given, is what this process works on: the ring may lie
    /// there.
    explicit ConsumerChannel(int pipe, bool whole = false, std::shared_ptr<GpuMemory> gpu = nullptr);
    ~ConsumerChannel();
    ConsumerChannel(ConsumerChannel const&) = delete;
    ConsumerChannel& operator=(ConsumerChannel const&) = delete;

    bool connected() const { return peer_ >= 0; }
    /// Memory of a slot named in a frame, in the space of memory_of(name). Throws Error{data} if the producer never
    /// shared it or `bytes` exceed it.
    std::byte const* slot(std::uint32_t name, std::size_t bytes);
    void give_back(std::uint32_t name);
    /// The memory that a slot belongs to, to be kept beyond the life of this channel.
    std::shared_ptr<SharedRing> const& memory_of(std::uint32_t name) const { return rings_[(name >> 16) - 1]; }

private:
    void receive_ring();
    void tell_gpu();

    int peer_ = -1;
    std::shared_ptr<GpuMemory> gpu_;
    std::deque<std::shared_ptr<SharedRing>> rings_;
};

/// A slot of the producer's ring; it is given back when nobody holds the lease any more.
class SlotLease : public Lease {
public:
    /// Of a slot that `channel` knows, with `bytes` of voxels at its front.
    SlotLease(std::shared_ptr<ConsumerChannel> channel, std::uint32_t name, std::size_t bytes)
        : channel_(std::move(channel)), ring_(channel_->memory_of(name)), name_(name), bytes_(bytes) {}
    ~SlotLease() override;
    SlotLease(SlotLease const&) = delete;
    SlotLease& operator=(SlotLease const&) = delete;
    /// Somebody else may still look at the slot: it is never given back.
    void abandon() { channel_.reset(); }

    std::shared_ptr<SharedRing> const& ring() const { return ring_; }
    std::uint32_t index() const { return name_ & 0xffff; }
    std::size_t bytes() const { return bytes_; }

private:
    std::shared_ptr<ConsumerChannel> channel_;
    std::shared_ptr<SharedRing> ring_;
    std::uint32_t name_;
    std::size_t bytes_;
};

} // namespace vkt::ipc
