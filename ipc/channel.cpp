// Abstract Unix sockets, descriptors passed over them, and anonymous shared memory.
// SPDX-License-Identifier: MIT
#include "ipc/channel.h"

#include "ipc/descriptor.h"
#include "libvkt/core/error.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>
#include <utility>

namespace vkt::ipc {
namespace {

constexpr std::uint32_t greeting = 0x314b5456;       ///< both ends speak this version
constexpr std::uint32_t greeting_whole = 0x574b5456; ///< … and the consumer wants whole volumes in one piece
/// Names of slots have 16 bits for the ring: a series of more volumes than that goes on through the pipe.
constexpr std::uint32_t most_rings = 0xffff;
/// Slots of the producer before us that the consumer may hold: one to work on, the others on their way. What is left
/// keeps that producer going meanwhile.
constexpr std::size_t most_passed = 3;

/// What the producer sends with a ring's descriptor.
struct RingMessage {
    std::uint32_t greeting = 0, slots = 0;
    std::uint64_t slot_bytes = 0;
};

struct Address {
    sockaddr_un address{};
    socklen_t length = 0;
};

/// Only the ends of one pipe share its inode, so whoever sits between (tee, pv) never finds the other side.
std::optional<Address> address_of(int pipe) {
    struct stat status {};
    if (::fstat(pipe, &status) != 0 || !S_ISFIFO(status.st_mode)) return std::nullopt;
    std::string const name =
        text("vkt-", static_cast<std::uint64_t>(::getuid()), "-", static_cast<std::uint64_t>(status.st_dev), "-",
             static_cast<std::uint64_t>(status.st_ino));
    Address result;
    result.address.sun_family = AF_UNIX;
    std::memcpy(result.address.sun_path + 1, name.data(), name.size()); // a leading zero byte: abstract, no file
    result.length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
    return result;
}

bool same_user(int socket) {
    ucred credentials{};
    socklen_t size = sizeof credentials;
    return ::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &credentials, &size) == 0 && credentials.uid == ::getuid();
}

void close_descriptor(int& descriptor) {
    if (descriptor >= 0) ::close(descriptor);
    descriptor = -1;
}

/// Sends a message with a descriptor attached.
bool send_descriptor(int socket, RingMessage const& message, int descriptor) {
    alignas(cmsghdr) std::byte control[CMSG_SPACE(sizeof(int))]{};
    iovec part{const_cast<RingMessage*>(&message), sizeof message};
    msghdr header{};
    header.msg_iov = &part;
    header.msg_iovlen = 1;
    header.msg_control = control;
    header.msg_controllen = sizeof control;
    cmsghdr* const c = CMSG_FIRSTHDR(&header);
    c->cmsg_level = SOL_SOCKET;
    c->cmsg_type = SCM_RIGHTS;
    c->cmsg_len = CMSG_LEN(sizeof(int));
    std::memcpy(CMSG_DATA(c), &descriptor, sizeof descriptor);
    return ::sendmsg(socket, &header, MSG_NOSIGNAL) == static_cast<ssize_t>(sizeof message);
}

/// Receives a message and the descriptor that came with it; -1 if none did.
int receive_descriptor(int socket, RingMessage& message) {
    alignas(cmsghdr) std::byte control[CMSG_SPACE(sizeof(int))]{};
    iovec part{&message, sizeof message};
    msghdr header{};
    header.msg_iov = &part;
    header.msg_iovlen = 1;
    header.msg_control = control;
    header.msg_controllen = sizeof control;
    ssize_t n = 0;
    do {
        n = ::recvmsg(socket, &header, MSG_CMSG_CLOEXEC);
    } while (n < 0 && errno == EINTR);
    cmsghdr const* const c = n == static_cast<ssize_t>(sizeof message) ? CMSG_FIRSTHDR(&header) : nullptr;
    if (c == nullptr || c->cmsg_type != SCM_RIGHTS || c->cmsg_len != CMSG_LEN(sizeof(int))) return -1;
    int descriptor = -1;
    std::memcpy(&descriptor, CMSG_DATA(c), sizeof descriptor);
    return descriptor;
}

} // namespace

SharedRing::SharedRing() = default;
SharedRing::SharedRing(SharedRing&& other) noexcept { *this = std::move(other); }
SharedRing& SharedRing::operator=(SharedRing&& other) noexcept {
    std::swap(mapping_, other.mapping_);
    std::swap(descriptor_, other.descriptor_);
    std::swap(slots_, other.slots_);
    std::swap(slot_bytes_, other.slot_bytes_);
    return *this;
}
SharedRing::~SharedRing() { close_descriptor(descriptor_); }

std::byte* SharedRing::slot(std::uint32_t index) const { return mapping_->data() + index * slot_bytes_; }

void SharedRing::map(SharedMapping::Rights rights) {
    mapping_ = std::make_unique<SharedMapping>(descriptor_, slots_ * slot_bytes_, rights);
}

SharedRing SharedRing::create(std::uint32_t slots, std::size_t slot_bytes) {
    auto const page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
    SharedRing ring;
    ring.slots_ = slots;
    ring.slot_bytes_ = (slot_bytes + page - 1) / page * page;
    ring.descriptor_ = ::memfd_create("vkt-ring", MFD_CLOEXEC | MFD_ALLOW_SEALING);
    int const refusal = ring.descriptor_ < 0 ? errno : 0;
    std::size_t const bytes = ring.slots_ * ring.slot_bytes_;
    // Pages of a memory file count against no limit: asked for more than there is, the kernel kills processes at
    // random.
    if (bytes > std::max(default_memory(), std::size_t{256} << 20))
        throw Error(ErrorKind::resources, text("a ring of ", bytes_text(static_cast<double>(bytes)),
                                               " of shared memory is more than a stage may hold"));
    int const failure = refusal != 0 ? refusal : ::posix_fallocate(ring.descriptor_, 0, static_cast<off_t>(bytes));
    if (failure != 0)
        throw Error(ErrorKind::resources, text("cannot have ", bytes_text(static_cast<double>(bytes)),
                                               " of shared memory: ", std::strerror(failure)));
    // Nobody may shrink it under the other's feet.
    ::fcntl(ring.descriptor_, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL);
    ring.map(SharedMapping::Rights::write);
    return ring;
}

SharedRing SharedRing::open(int descriptor, std::uint32_t slots, std::size_t slot_bytes) {
    SharedRing ring;
    ring.descriptor_ = descriptor;
    ring.slots_ = slots;
    ring.slot_bytes_ = slot_bytes;
    struct stat status {};
    constexpr std::size_t most = std::size_t{1} << 46;
    bool const sane = slots > 0 && slots < 65536 && slot_bytes > 0 && slot_bytes < most &&
                      ::fstat(descriptor, &status) == 0 &&
                      static_cast<std::size_t>(status.st_size) >= slots * slot_bytes &&
                      (::fcntl(descriptor, F_GET_SEALS) & F_SEAL_SHRINK) != 0;
    if (!sane) throw Error(ErrorKind::data, "the shared memory that was offered is not what it claims to be");
    ring.map(slots == 1 ? SharedMapping::Rights::copy_on_write : SharedMapping::Rights::read);
    return ring;
}

ProducerChannel::ProducerChannel(int pipe) : pipe_(pipe) {
    auto const address = address_of(pipe);
    if (!address) return;
    listener_ = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    bool const listening =
        listener_ >= 0 &&
        ::bind(listener_, reinterpret_cast<sockaddr const*>(&address->address), address->length) == 0 &&
        ::listen(listener_, 1) == 0;
    if (!listening) close_descriptor(listener_);
}

ProducerChannel::~ProducerChannel() {
    if (relay_.joinable()) {
        ::shutdown(peer_, SHUT_RD); // ends its wait
        relay_.join();
    }
    for (auto const& [name, lease] : passed_) lease->abandon(); // the consumer may outlive us
    close_descriptor(listener_);
    close_descriptor(peer_);
}

bool ProducerChannel::connected(std::chrono::milliseconds wait) {
    if (peer_ >= 0) return true;
    if (listener_ < 0) return false;
    pollfd entries[2]{{listener_, POLLIN, 0}, {pipe_, 0, 0}}; // the pipe reports POLLERR when its reader leaves
    if (::poll(entries, 2, static_cast<int>(wait.count())) <= 0 || (entries[0].revents & POLLIN) == 0) return false;
    int candidate = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (candidate < 0) return false;
    std::uint32_t word = 0;
    pollfd hello{candidate, POLLIN, 0};
    bool const greeted = same_user(candidate) && ::poll(&hello, 1, 1000) == 1 &&
                         ::recv(candidate, &word, sizeof word, 0) == sizeof word &&
                         (word == greeting || word == greeting_whole);
    if (!greeted) {
        close_descriptor(candidate);
        return false;
    }
    peer_ = candidate;
    wants_whole_ = word == greeting_whole;
    close_descriptor(listener_); // one reader only
    return true;
}

void ProducerChannel::send_ring(SharedRing const& ring) {
    if (rings_sent_ == most_rings) throw Error(ErrorKind::resources, "this stream has shared memory too many times");
    RingMessage const message{greeting, ring.slots(), ring.slot_bytes()};
    if (!send_descriptor(peer_, message, ring.descriptor())) throw BrokenPipe{};
    ++rings_sent_;
}

void ProducerChannel::share_ring(std::uint32_t slots, std::size_t slot_bytes) {
    SharedRing ring = SharedRing::create(slots, slot_bytes);
    send_ring(ring);
    std::lock_guard const lock(mutex_);
    ring_ = std::move(ring);
    generation_ = rings_sent_;
    free_.clear();
    for (std::uint32_t i = slots; i-- > 0;) free_.push_back(i);
}

/// Under the lock: the consumer no longer needs a slot.
void ProducerChannel::take_back(std::uint32_t name) {
    std::uint32_t const index = name & 0xffff;
    if (ring_ && name >> 16 == generation_ && index < ring_->slots())
        free_.push_back(index);
    else
        std::erase_if(passed_, [&](auto const& passed) { return passed.first == name; });
}

/// Receives the name of one slot; false if `flags` forbid to wait for it. Throws BrokenPipe when the consumer is gone.
bool ProducerChannel::receive_return(int flags) {
    std::uint32_t name = 0;
    ssize_t n = 0;
    do {
        n = ::recv(peer_, &name, sizeof name, flags);
    } while (n < 0 && errno == EINTR);
    if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return false;
    if (n != sizeof name) throw BrokenPipe{};
    std::lock_guard const lock(mutex_);
    take_back(name);
    return true;
}

void ProducerChannel::relay() {
    try {
        while (receive_return(0)) returned_.notify_one();
    } catch (BrokenPipe const&) {
        std::lock_guard const lock(mutex_);
        gone_ = true;
        passed_.clear(); // the producer before us may wait for these, and we for it
        returned_.notify_one();
    }
}

std::uint32_t ProducerChannel::acquire_slot() {
    if (relay_.joinable()) {
        std::unique_lock lock(mutex_);
        returned_.wait(lock, [&] { return gone_ || !free_.empty(); });
        if (gone_) throw BrokenPipe{};
    } else {
        while (receive_return(MSG_DONTWAIT)) {
        }
        while (free_.empty()) receive_return(0);
    }
    std::lock_guard const lock(mutex_);
    std::uint32_t const index = free_.back();
    free_.pop_back();
    return slot_name(generation_, index);
}

std::uint32_t ProducerChannel::pass_on(std::shared_ptr<SlotLease> lease) {
    if (passed_ring_ != lease->ring()) {
        send_ring(*lease->ring());
        passed_ring_ = lease->ring();
        passed_generation_ = rings_sent_;
    }
    if (!relay_.joinable()) relay_ = std::thread([this] { relay(); });
    std::uint32_t const name = slot_name(passed_generation_, lease->index());
    std::unique_lock lock(mutex_);
    returned_.wait(lock, [&] { return gone_ || passed_.size() < most_passed; });
    if (gone_) throw BrokenPipe{};
    passed_.emplace_back(name, std::move(lease));
    return name;
}

ConsumerChannel::ConsumerChannel(int pipe, bool whole) {
    auto const address = address_of(pipe);
    if (!address) return;
    std::uint32_t const word = whole ? greeting_whole : greeting;
    peer_ = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    bool const met = peer_ >= 0 &&
                     ::connect(peer_, reinterpret_cast<sockaddr const*>(&address->address), address->length) == 0 &&
                     same_user(peer_) && ::send(peer_, &word, sizeof word, MSG_NOSIGNAL) == sizeof word;
    if (!met) close_descriptor(peer_);
}

ConsumerChannel::~ConsumerChannel() { close_descriptor(peer_); }

void ConsumerChannel::receive_ring() {
    RingMessage message;
    int const descriptor = receive_descriptor(peer_, message);
    if (descriptor < 0 || message.greeting != greeting)
        throw Error(ErrorKind::data, "an upstream command ended before it shared its memory");
    // A segment of the volume before is gone with that volume.
    if (!rings_.empty() && rings_.back()->slots() == 1) rings_.back().reset();
    rings_.push_back(std::make_shared<SharedRing>(SharedRing::open(descriptor, message.slots, message.slot_bytes)));
}

std::byte const* ConsumerChannel::slot(std::uint32_t name, std::size_t bytes) {
    std::uint32_t const generation = name >> 16;
    std::uint32_t const index = name & 0xffff;
    if (!connected() || generation == 0)
        throw Error(ErrorKind::data, "a slab lies in shared memory that was not offered to this command");
    while (rings_.size() < generation) receive_ring();
    if (!rings_[generation - 1]) throw Error(ErrorKind::data, "a slab lies in the segment of another volume");
    SharedRing const& ring = *rings_[generation - 1];
    if (index >= ring.slots() || bytes > ring.slot_bytes())
        throw Error(ErrorKind::data, "a slab lies outside the shared memory");
    return ring.slot(index);
}

void ConsumerChannel::give_back(std::uint32_t name) {
    [[maybe_unused]] ssize_t const n = ::send(peer_, &name, sizeof name, MSG_NOSIGNAL);
}

} // namespace vkt::ipc
