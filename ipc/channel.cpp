// Abstract Unix sockets, descriptors passed over them, and anonymous shared memory, of the host or of a GPU.
// SPDX-License-Identifier: MIT
#include "ipc/channel.h"

#include "ipc/descriptor.h"
#include "ipc/waiting.h"
#include "libvkt/core/error.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/text.h"
#include "libvkt/io/shared_memory.h"

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
constexpr std::uint32_t greeting_gpu = 0x474b5456;   ///< … or works on a GPU, or the ring lies there
/// Names of slots have 16 bits for the ring: a series of more volumes than that goes on through the pipe.
constexpr std::uint32_t most_rings = 0xffff;
/// Slots of the producer before us that the consumer may hold: one to work on, the others on their way. What is left
/// keeps that producer going meanwhile.
constexpr std::size_t most_passed = 3;

/// What the consumer sends first. Without a GPU it sends the word alone, which is all that older producers receive.
struct Hello {
    std::uint32_t word = 0, gpu = 0;
};

/// What a consumer on a GPU sends next.
struct GpuMessage {
    std::uint32_t greeting = greeting_gpu, usable = 0;
    DeviceIdentity identity{};
};
static_assert(sizeof(GpuMessage) == 24);

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
    bool reset = false;
    do {
        n = ::recvmsg(socket, &header, MSG_CMSG_CLOEXEC);
        // Who closes its end with words of ours unread makes this fail once; what it sent before is there all the same.
    } while (n < 0 && (errno == EINTR || (errno == ECONNRESET && !std::exchange(reset, true))));
    cmsghdr const* const c = n == static_cast<ssize_t>(sizeof message) ? CMSG_FIRSTHDR(&header) : nullptr;
    if (c == nullptr || c->cmsg_type != SCM_RIGHTS || c->cmsg_len != CMSG_LEN(sizeof(int))) return -1;
    int descriptor = -1;
    std::memcpy(&descriptor, CMSG_DATA(c), sizeof descriptor);
    return descriptor;
}

Error false_offer() { return {ErrorKind::data, "the shared memory that was offered is not what it claims to be"}; }

/// A file in memory without a name.
class FileMemory : public RingMemory {
public:
    /// Takes ownership of the descriptor.
    explicit FileMemory(int descriptor) : descriptor_(descriptor) {}
    ~FileMemory() override { close_descriptor(descriptor_); }
    void map(std::size_t bytes, SharedMapping::Rights rights) {
        mapping_ = std::make_unique<SharedMapping>(descriptor_, bytes, rights);
    }
    std::byte* data() const override { return mapping_->data(); }
    int descriptor() const override { return descriptor_; }

private:
    int descriptor_;
    std::unique_ptr<SharedMapping> mapping_;
};

std::unique_ptr<RingMemory> new_file(std::size_t bytes) {
    auto file = std::make_unique<FileMemory>(::memfd_create("vkt-ring", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    int const refusal = file->descriptor() < 0 ? errno : 0;
    // Pages of a memory file count against no limit: asked for more than there is, the kernel kills processes at
    // random.
    if (bytes > std::max(default_memory(), std::size_t{256} << 20))
        throw Error(ErrorKind::resources, text("a ring of ", bytes_text(static_cast<double>(bytes)),
                                               " of shared memory is more than a stage may hold"));
    int const failure = refusal != 0 ? refusal : ::posix_fallocate(file->descriptor(), 0, static_cast<off_t>(bytes));
    if (failure != 0)
        throw Error(ErrorKind::resources, text("cannot have ", bytes_text(static_cast<double>(bytes)),
                                               " of shared memory: ", std::strerror(failure)));
    // Nobody may shrink it under the other's feet.
    ::fcntl(file->descriptor(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL);
    file->map(bytes, SharedMapping::Rights::write);
    return file;
}

std::unique_ptr<RingMemory> open_file(int descriptor, std::size_t bytes, SharedMapping::Rights rights) {
    auto file = std::make_unique<FileMemory>(descriptor);
    struct stat status {};
    bool const sane = ::fstat(descriptor, &status) == 0 && static_cast<std::size_t>(status.st_size) >= bytes &&
                      (::fcntl(descriptor, F_GET_SEALS) & F_SEAL_SHRINK) != 0;
    if (!sane) throw false_offer();
    file->map(bytes, rights);
    return file;
}

} // namespace

SharedRing SharedRing::create(std::uint32_t slots, std::size_t slot_bytes, std::shared_ptr<GpuMemory> gpu) {
    auto const page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
    SharedRing ring;
    ring.slots_ = slots;
    ring.slot_bytes_ = (slot_bytes + page - 1) / page * page;
    std::size_t const bytes = ring.slots_ * ring.slot_bytes_;
    ring.memory_ = gpu ? gpu->create(bytes) : new_file(bytes);
    ring.gpu_ = std::move(gpu);
    return ring;
}

SharedRing SharedRing::open(int descriptor, std::uint32_t slots, std::size_t slot_bytes,
                            std::shared_ptr<GpuMemory> gpu) {
    constexpr std::size_t most = std::size_t{1} << 46;
    if (slots == 0 || slots >= 65536 || slot_bytes == 0 || slot_bytes >= most) {
        ::close(descriptor);
        throw false_offer();
    }
    SharedRing ring;
    ring.slots_ = slots;
    ring.slot_bytes_ = slot_bytes;
    auto const rights = slots == 1 ? SharedMapping::Rights::copy_on_write : SharedMapping::Rights::read;
    std::size_t const bytes = slots * slot_bytes;
    ring.memory_ = gpu ? gpu->open(descriptor, bytes) : open_file(descriptor, bytes, rights);
    ring.gpu_ = std::move(gpu);
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
    Hello hello;
    pollfd entry{candidate, POLLIN, 0};
    bool const greeted = same_user(candidate) && ::poll(&entry, 1, 1000) == 1 &&
                         ::recv(candidate, &hello, sizeof hello, 0) >= static_cast<ssize_t>(sizeof hello.word) &&
                         (hello.word == greeting || hello.word == greeting_whole);
    if (!greeted) {
        close_descriptor(candidate);
        return false;
    }
    peer_ = candidate;
    wants_whole_ = hello.word == greeting_whole;
    works_on_gpu_ = hello.gpu == greeting_gpu;
    close_descriptor(listener_); // one reader only
    return true;
}

std::string ProducerChannel::gpu_obstacle(GpuMemory& gpu) {
    if (!works_on_gpu_) return "the next stage reads no GPU memory";
    DeviceIdentity own;
    try {
        own = gpu.identity();
    } catch (Error const& e) {
        return e.what();
    }
    while (!answer_) receive_return(0);
    if (*answer_ == DeviceIdentity{}) return "the next stage cannot map memory of its GPU";
    return *answer_ == own ? "" : "the next stage works on another GPU";
}

void ProducerChannel::send_ring(SharedRing const& ring) {
    if (rings_sent_ == most_rings) throw Error(ErrorKind::resources, "this stream has shared memory too many times");
    RingMessage const message{ring.on_gpu() ? greeting_gpu : greeting, ring.slots(), ring.slot_bytes()};
    if (!send_descriptor(peer_, message, ring.descriptor())) throw BrokenPipe{};
    ++rings_sent_;
}

void ProducerChannel::share_ring(std::uint32_t slots, std::size_t slot_bytes, std::shared_ptr<GpuMemory> gpu) {
    SharedRing ring = SharedRing::create(slots, slot_bytes, std::move(gpu));
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

/// Receives the name of one slot, or which GPU the consumer works on; false if `flags` forbid to wait for it. Throws
/// BrokenPipe when the consumer is gone.
bool ProducerChannel::receive_return(int flags) {
    GpuMessage message; // whose first word is the name of a slot otherwise
    ssize_t n = 0;
    do {
        n = ::recv(peer_, &message, sizeof message, flags);
    } while (n < 0 && errno == EINTR);
    if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return false;
    std::lock_guard const lock(mutex_);
    if (n == sizeof message)
        answer_ = message.usable != 0 ? message.identity : DeviceIdentity{};
    else if (n == sizeof message.greeting)
        take_back(message.greeting);
    else
        throw BrokenPipe{};
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

std::uint32_t ProducerChannel::acquire_slot(std::function<void()> const& waiting) {
    if (relay_.joinable()) {
        std::unique_lock lock(mutex_);
        wait_for(
            returned_, lock, [&] { return gone_ || !free_.empty(); }, waiting);
        if (gone_) throw BrokenPipe{};
    } else {
        while (receive_return(MSG_DONTWAIT)) {
        }
        while (free_.empty()) {
            pollfd entry{peer_, POLLIN, 0};
            while (waiting && ::poll(&entry, 1, static_cast<int>(waiting_pause.count())) == 0) waiting();
            receive_return(0);
        }
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

ConsumerChannel::ConsumerChannel(int pipe, bool whole, std::shared_ptr<GpuMemory> gpu) : gpu_(std::move(gpu)) {
    auto const address = address_of(pipe);
    if (!address) return;
    Hello const hello{whole ? greeting_whole : greeting, greeting_gpu};
    std::size_t const length = gpu_ ? sizeof hello : sizeof hello.word;
    peer_ = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    bool const met = peer_ >= 0 &&
                     ::connect(peer_, reinterpret_cast<sockaddr const*>(&address->address), address->length) == 0 &&
                     same_user(peer_) && ::send(peer_, &hello, length, MSG_NOSIGNAL) == static_cast<ssize_t>(length);
    if (!met) close_descriptor(peer_);
    if (met && gpu_) tell_gpu();
}

/// After the greeting, for which the producer has little patience: a process may need a while to get hold of its GPU.
void ConsumerChannel::tell_gpu() {
    GpuMessage message;
    try {
        message.identity = gpu_->identity();
        message.usable = 1;
    } catch (Error const&) { // the ring will lie elsewhere
    }
    [[maybe_unused]] ssize_t const n = ::send(peer_, &message, sizeof message, MSG_NOSIGNAL);
}

ConsumerChannel::~ConsumerChannel() { close_descriptor(peer_); }

void ConsumerChannel::receive_ring() {
    RingMessage message;
    int const descriptor = receive_descriptor(peer_, message);
    bool const on_gpu = message.greeting == greeting_gpu && gpu_;
    if (descriptor < 0 || !(message.greeting == greeting || on_gpu)) {
        if (descriptor >= 0) ::close(descriptor);
        throw Error(ErrorKind::data, "an upstream command ended before it shared its memory");
    }
    // A segment of the volume before is gone with that volume.
    if (!rings_.empty() && rings_.back()->slots() == 1) rings_.back().reset();
    rings_.push_back(std::make_shared<SharedRing>(
        SharedRing::open(descriptor, message.slots, message.slot_bytes, on_gpu ? gpu_ : nullptr)));
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

SlotLease::~SlotLease() {
    if (!channel_) return;
    try {
        ring_->settle();
    } catch (Error const&) { // whoever asks the GPU for more is told
    }
    channel_->give_back(name_);
}

} // namespace vkt::ipc
