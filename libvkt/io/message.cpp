// Messages over a stream socket: eight bytes of length, then the bytes.
// SPDX-License-Identifier: MIT
#include "libvkt/io/message.h"

#include "libvkt/core/error.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include <sys/socket.h>
#include <unistd.h>

namespace vkt {
namespace {

/// The tables of 2^28 blocks fit.
constexpr std::uint64_t longest = std::uint64_t{1} << 34;

bool send_all(int socket, char const* bytes, std::size_t n, int descriptor) {
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
    while (n > 0) {
        iovec part{const_cast<char*>(bytes), n};
        msghdr header{};
        header.msg_iov = &part;
        header.msg_iovlen = 1;
        if (descriptor >= 0) {
            header.msg_control = control.data();
            header.msg_controllen = control.size();
            cmsghdr* const rights = CMSG_FIRSTHDR(&header);
            rights->cmsg_level = SOL_SOCKET;
            rights->cmsg_type = SCM_RIGHTS;
            rights->cmsg_len = CMSG_LEN(sizeof(int));
            std::memcpy(CMSG_DATA(rights), &descriptor, sizeof descriptor);
        }
        ssize_t const sent = ::sendmsg(socket, &header, MSG_NOSIGNAL);
        if (sent < 0 && errno == EINTR) continue;
        if (sent <= 0) return false;
        descriptor = -1; // it went with the first bytes
        bytes += sent;
        n -= static_cast<std::size_t>(sent);
    }
    return true;
}

bool receive_all(int socket, char* bytes, std::size_t n, int& descriptor) {
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
    while (n > 0) {
        iovec part{bytes, n};
        msghdr header{};
        header.msg_iov = &part;
        header.msg_iovlen = 1;
        header.msg_control = control.data();
        header.msg_controllen = control.size();
        ssize_t const got = ::recvmsg(socket, &header, MSG_CMSG_CLOEXEC);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return false;
        cmsghdr const* const rights = CMSG_FIRSTHDR(&header);
        if (rights != nullptr && rights->cmsg_type == SCM_RIGHTS) {
            if (descriptor >= 0) ::close(descriptor);
            std::memcpy(&descriptor, CMSG_DATA(rights), sizeof descriptor);
        }
        bytes += got;
        n -= static_cast<std::size_t>(got);
    }
    return true;
}

} // namespace

void Message::malformed() { throw Error(ErrorKind::data, "its reader gave an answer that makes no sense"); }

void Message::copy(std::string_view from, void* to) {
    if (!from.empty()) std::memcpy(to, from.data(), from.size());
}

void Message::put(std::int64_t number) { bytes_.append(reinterpret_cast<char const*>(&number), sizeof number); }
void Message::put(double number) { bytes_.append(reinterpret_cast<char const*>(&number), sizeof number); }
void Message::put(std::string_view text) {
    put(static_cast<std::int64_t>(text.size()));
    bytes_.append(text);
}

std::int64_t Message::number() {
    std::int64_t value = 0;
    if (bytes_.size() - taken_ < sizeof value) malformed();
    std::memcpy(&value, bytes_.data() + taken_, sizeof value);
    taken_ += sizeof value;
    return value;
}

double Message::real() {
    std::int64_t const bits = number();
    double value = 0;
    std::memcpy(&value, &bits, sizeof value);
    return value;
}

std::string_view Message::view() {
    std::int64_t const size = number();
    if (size < 0 || static_cast<std::size_t>(size) > bytes_.size() - taken_) malformed();
    std::string_view const result(bytes_.data() + taken_, static_cast<std::size_t>(size));
    taken_ += result.size();
    return result;
}

std::string Message::text() { return std::string(view()); }

bool send_message(int socket, Message const& message, int descriptor) {
    std::uint64_t const size = message.bytes().size();
    return size <= longest && send_all(socket, reinterpret_cast<char const*>(&size), sizeof size, descriptor) &&
           send_all(socket, message.bytes().data(), message.bytes().size(), -1);
}

std::optional<Received> receive_message(int socket) {
    Received received;
    std::uint64_t size = 0;
    std::string bytes;
    bool whole =
        receive_all(socket, reinterpret_cast<char*>(&size), sizeof size, received.descriptor) && size <= longest;
    // A piece at a time: memory is taken for what has come, not for what was said to come.
    constexpr std::uint64_t piece = std::uint64_t{16} << 20;
    while (whole && bytes.size() < size) {
        std::size_t const begin = bytes.size();
        bytes.resize(std::min(size, begin + piece));
        whole = receive_all(socket, bytes.data() + begin, bytes.size() - begin, received.descriptor);
    }
    if (!whole) {
        if (received.descriptor >= 0) ::close(received.descriptor);
        return std::nullopt;
    }
    received.message = Message(std::move(bytes));
    return received;
}

} // namespace vkt
