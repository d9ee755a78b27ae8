// Temporary files: names with a nonce, a table for signal handlers, locks that tell living owners from dead ones.
// SPDX-License-Identifier: MIT
#include "libvkt/io/temporaries.h"

#include "libvkt/core/text.h"

#include <array>
#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <memory>
#include <random>
#include <string_view>

#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

namespace vkt {

namespace {

constexpr int slots = 64;
/// The names outlive every object, since a signal may come between any two instructions.
std::array<std::atomic<char*>, slots> temporaries{};

constexpr std::string_view temporary_mark = ".vkt-";

/// Four bytes that follow from the rest of a temporary name, and that nobody else's name ends in but by a chance of
/// 2^-32: FNV-1a.
std::string check_of(std::string_view name) {
    std::uint32_t hash = 2166136261U;
    for (char const c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 16777619U;
    std::array<char, 9> digits{};
    std::snprintf(digits.data(), digits.size(), "%08x", hash);
    return digits.data();
}

/// Whether a name was made by temporary_name: .NAME.vkt-PID-XXXXXXXX and the check.
bool is_temporary_name(std::string_view name) {
    constexpr std::size_t random = 8, check = 8;
    std::size_t const mark = name.rfind(temporary_mark);
    if (!name.starts_with('.') || mark == std::string_view::npos || mark == 0) return false;
    std::size_t const prefix = mark + temporary_mark.size();
    if (name.size() < prefix + 1 + 1 + random + check) return false;
    std::string_view const rest = name.substr(0, name.size() - check);
    return rest.find_first_not_of("0123456789", prefix) == rest.size() - random - 1 &&
           rest[rest.size() - random - 1] == '-' && name.substr(rest.size()) == check_of(rest);
}

/// True if the file is one of ours whose owner is gone.
bool left_over(int descriptor) {
    struct stat status {};
    bool const directory = ::fstat(descriptor, &status) == 0 && S_ISDIR(status.st_mode);
    if ((!directory && !S_ISREG(status.st_mode)) || status.st_uid != ::geteuid()) return false;
    // What is empty may have been made this moment, before its owner could mark it.
    std::error_code failure;
    bool const empty = directory
                           ? std::filesystem::is_empty(text("/proc/self/fd/", descriptor, "/."), failure) || failure
                           : status.st_size == 0;
    if (empty && status.st_ctime + 60 > std::time(nullptr)) return false;
    return ::flock(descriptor, LOCK_EX | LOCK_NB) == 0;
}

/// What a directory entry begins with, as the kernel writes it.
struct KernelEntry {
    std::uint64_t inode;
    std::int64_t offset;
    std::uint16_t bytes;
    std::uint8_t type;
    char name[1];
};

/// "." and "..".
bool is_self(char const* name) { return name[0] == '.' && (name[1] == '\0' || (name[1] == '.' && name[2] == '\0')); }

/// Removes what is in a directory.
void empty_directory(int folder, int depth) noexcept {
    alignas(KernelEntry) char entries[4096];
    for (bool any = true; any;) { // from the start again, since what is removed may shift what follows
        any = false;
        ::lseek(folder, 0, SEEK_SET);
        for (long n = 0; (n = ::syscall(SYS_getdents64, folder, entries, sizeof entries)) > 0;)
            for (long at = 0; at < n;) {
                auto const* const entry = reinterpret_cast<KernelEntry const*>(entries + at);
                char const* const name = entries + at + offsetof(KernelEntry, name);
                bool gone = ::unlinkat(folder, name, 0) == 0;
                if (!gone && (errno == EISDIR || errno == EPERM) && depth > 0 && !is_self(name)) {
                    int const inner = ::openat(folder, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
                    if (inner >= 0) empty_directory(inner, depth - 1);
                    gone = ::unlinkat(folder, name, AT_REMOVEDIR) == 0;
                }
                any = gone || any;
                at += entry->bytes;
            }
    }
    ::close(folder);
}

/// Removes a file, or a directory and what is in it. Async-signal-safe.
void remove_temporary(char const* path) noexcept {
    if (::unlink(path) == 0 || (errno != EISDIR && errno != EPERM)) return;
    int const folder = ::open(path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (folder < 0) return;
    constexpr int deepest = 16;
    empty_directory(folder, deepest);
    ::rmdir(path);
}

/// False if nobody is there to hear it.
bool say_word(int socket) {
    ssize_t n = 0;
    do {
        n = ::send(socket, "", 1, MSG_NOSIGNAL);
    } while (n < 0 && errno == EINTR);
    return n == 1;
}

/// False if the other end is gone.
bool hear_word(int socket) {
    char word = 0;
    ssize_t n = 0;
    do {
        n = ::recv(socket, &word, 1, 0);
    } while (n < 0 && errno == EINTR);
    return n == 1;
}

} // namespace

std::string directory_of(std::string const& path) {
    std::size_t const slash = path.rfind('/');
    if (slash == std::string::npos) return ".";
    return slash == 0 ? "/" : path.substr(0, slash);
}

std::string temporary_name(std::string const& path) {
    std::random_device random;
    std::array<char, 9> nonce{};
    std::snprintf(nonce.data(), nonce.size(), "%08x", random());
    // A name may not be longer than file systems take.
    std::string const shown = std::filesystem::path(path).filename().string().substr(0, 200);
    std::string const name = text(".", shown, temporary_mark, static_cast<std::int64_t>(::getpid()), "-", nonce.data());
    return text(directory_of(path), "/", name, check_of(name));
}

std::string lasting_name(std::string const& path) {
    std::string result;
    for (std::size_t begin = 0; begin <= path.size();) {
        std::size_t const end = std::min(path.find('/', begin), path.size());
        std::string const part = path.substr(begin, end - begin);
        bool const ours = end < path.size() && is_temporary_name(part);
        result += ours ? part.substr(1, part.rfind(temporary_mark) - 1) : part;
        if (end < path.size()) result += '/';
        begin = end + 1;
    }
    return result;
}

int remember_temporary(std::string const& path) {
    char* const copy = ::strdup(path.c_str());
    if (!copy) return -1;
    for (int i = 0; i < slots; ++i) {
        char* expected = nullptr;
        if (temporaries[static_cast<std::size_t>(i)].compare_exchange_strong(expected, copy)) return i;
    }
    std::free(copy);
    return -1;
}

void forget_temporary(int slot) {
    if (slot >= 0) std::free(temporaries[static_cast<std::size_t>(slot)].exchange(nullptr));
}

void remove_temporaries() noexcept {
    for (auto& slot : temporaries)
        if (char const* const path = slot.load()) remove_temporary(path);
}

void remove_directory(std::string const& path) noexcept { remove_temporary(path.c_str()); }

Guard::Guard(std::string const& path) {
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) return;
    process_ = ::fork();
    if (process_ == 0) { // other threads are gone: nothing but system calls from here on
        ::setsid();
        ::dup2(ends[1], 0);
        ::close_range(1, ~0U, 0);
        if (!say_word(0) || !hear_word(0)) remove_temporary(path.c_str());
        ::_exit(0);
    }
    ::close(ends[1]);
    socket_ = ends[0];
    if (process_ > 0) hear_word(socket_);
}

Guard::~Guard() {
    if (socket_ < 0) return;
    say_word(socket_);
    ::close(socket_);
    while (process_ > 0 && ::waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
    }
}

void mark_alive(int descriptor) { (void)::flock(descriptor, LOCK_EX | LOCK_NB); }

void remove_leftovers(std::string const& path) {
    std::string const directory = directory_of(path);
    std::unique_ptr<DIR, int (*)(DIR*)> const folder(::opendir(directory.c_str()), ::closedir);
    if (!folder) return;
    while (dirent const* const entry = ::readdir(folder.get())) {
        // Whatever is called otherwise is somebody's own.
        if (!is_temporary_name(entry->d_name)) continue;
        int const descriptor =
            ::openat(::dirfd(folder.get()), entry->d_name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
        if (descriptor < 0) continue;
        if (left_over(descriptor)) remove_temporary(text(directory, "/", entry->d_name).c_str());
        ::close(descriptor);
    }
}

} // namespace vkt
