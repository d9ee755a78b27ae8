// Sequential and positioned reading of one descriptor, with look-ahead so that pipes can be sniffed.
// SPDX-License-Identifier: MIT
#include "libvkt/io/byte_source.h"
#include "libvkt/core/error.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/text.h"
#include "libvkt/io/shared_memory.h"
#include "libvkt/io/system_error.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <exception>
#include <numeric>

#include <fcntl.h>
#include <omp.h>
#include <sys/stat.h>
#include <unistd.h>

namespace vkt {

namespace {

constexpr std::size_t look_ahead = std::size_t{16} << 10;
constexpr std::size_t longest_line = std::size_t{1} << 20;
/// Linux moves at most this much per call; asking for more is not an error, but short.
constexpr std::size_t largest_read = std::size_t{1} << 30;
/// One processor copies out of the page cache more slowly than memory could give: where there are many, a few share a
/// read.
constexpr int most_readers = 8;
constexpr std::int64_t large_file = std::int64_t{16} << 20;
constexpr std::size_t least_share = std::size_t{256} << 10;

} // namespace

ByteSource::ByteSource(int descriptor, std::string name) : descriptor_(descriptor), name_(std::move(name)) {
    struct stat status {};
    if (::fstat(descriptor_, &status) != 0) return;
    directory_ = S_ISDIR(status.st_mode);
    off_t const here = ::lseek(descriptor_, 0, SEEK_CUR);
    if (here < 0) return;
    if (S_ISREG(status.st_mode)) {
        // Files of the kernel (/proc, /sys) claim to be empty; reading to the end is right for them and for empty
        // files.
        if (status.st_size > 0) size_ = status.st_size;
    } else if (S_ISBLK(status.st_mode)) {
        off_t const end = ::lseek(descriptor_, 0, SEEK_END);
        if (end > 0 && ::lseek(descriptor_, here, SEEK_SET) == here) size_ = end;
    }
    // A shell may hand over a file that others have read from: `{ head -1; vkt read -; } < file`.
    if (size_ >= 0) position_ = here;
    if (size_ < large_file) return;
    readers_ = std::clamp(default_threads() / 2, 1, most_readers);
    // LLVM's runtime looks things up in the first thread that it met, which must not be one that reads ahead and ends.
    if (readers_ > 1) static_cast<void>(omp_get_max_threads());
}

ByteSource::ByteSource(std::string name, std::function<std::size_t(std::byte* to, std::size_t n)> next)
    : descriptor_(-1), name_(std::move(name)), next_(std::move(next)) {}

std::size_t ByteSource::read_some(std::byte* to, std::size_t n) {
    if (next_) return next_(to, n);
    for (;;) {
        ssize_t const got = ::read(descriptor_, to, std::min(n, largest_read));
        if (got >= 0) return static_cast<std::size_t>(got);
        if (errno != EINTR) throw system_error(text("cannot read '", name_, "'"));
    }
}

ByteSource::~ByteSource() {
    if (descriptor_ > STDERR_FILENO) {
        ::close(descriptor_);
    } else if (descriptor_ >= 0) {
        // A standard descriptor must not become the next file that is opened.
        int const null = ::open("/dev/null", O_RDWR | O_CLOEXEC);
        if (null >= 0) {
            ::dup2(null, descriptor_);
            ::close(null);
        }
    }
}

std::span<std::byte const> ByteSource::peek(std::size_t n) {
    while (ahead_.size() - ahead_begin_ < n) {
        if (ahead_begin_ > 0) {
            ahead_.erase(ahead_.begin(), ahead_.begin() + static_cast<std::ptrdiff_t>(ahead_begin_));
            ahead_begin_ = 0;
        }
        // Takes whatever is there up to a block, but waits for no more than was asked.
        std::size_t const held = ahead_.size();
        ahead_.resize(std::max(n, held + look_ahead));
        std::size_t got = 0;
        try {
            got = read_some(ahead_.data() + held, ahead_.size() - held);
        } catch (...) {
            ahead_.resize(held);
            throw;
        }
        ahead_.resize(held + got);
        if (got == 0) break;
    }
    std::size_t const count = std::min(n, ahead_.size() - ahead_begin_);
    return {ahead_.data() + ahead_begin_, count};
}

std::size_t ByteSource::read(void* to, std::size_t n) {
    std::size_t done = std::min(n, ahead_.size() - ahead_begin_);
    if (done > 0) {
        std::memcpy(to, ahead_.data() + ahead_begin_, done);
        ahead_begin_ += done;
        if (ahead_begin_ == ahead_.size()) {
            ahead_.clear();
            ahead_begin_ = 0;
        }
    }
    while (done < n) {
        std::size_t const got = read_some(static_cast<std::byte*>(to) + done, n - done);
        if (got == 0) break;
        done += got;
    }
    position_ += static_cast<std::int64_t>(done);
    return done;
}

void ByteSource::read_exactly(void* to, std::size_t n) {
    std::size_t const got = read(to, n);
    if (got < n)
        throw Error(ErrorKind::data, text("'", name_, "' ended early: ", bytes_text(static_cast<double>(got)), " of ",
                                          bytes_text(static_cast<double>(n)), " were there"));
}

std::optional<std::string> ByteSource::read_line() {
    std::string line;
    for (;;) {
        std::span<std::byte const> const head = peek(1);
        if (head.empty()) {
            if (line.empty()) return std::nullopt;
            break;
        }
        char const* const begin = reinterpret_cast<char const*>(ahead_.data() + ahead_begin_);
        std::size_t const count = ahead_.size() - ahead_begin_;
        void const* const newline = std::memchr(begin, '\n', count);
        std::size_t const taken = newline ? static_cast<std::size_t>(static_cast<char const*>(newline) - begin) : count;
        if (line.size() + taken > longest_line)
            throw Error(ErrorKind::data, text("'", name_, "': a header line is longer than 1 MiB"));
        line.append(begin, taken);
        ahead_begin_ += taken + (newline ? 1 : 0);
        position_ += static_cast<std::int64_t>(taken) + (newline ? 1 : 0);
        if (newline) break;
    }
    if (!line.empty() && line.back() == '\r') line.pop_back();
    return line;
}

void ByteSource::skip(std::int64_t n) {
    std::int64_t left = n;
    std::int64_t const held = std::min<std::int64_t>(left, static_cast<std::int64_t>(ahead_.size() - ahead_begin_));
    ahead_begin_ += static_cast<std::size_t>(held);
    position_ += held;
    left -= held;
    if (left == 0) return;
    if (seekable()) {
        if (left > size_ - position_)
            throw Error(ErrorKind::data, text("'", name_, "' ended early: it has ", size_, " bytes"));
        if (::lseek(descriptor_, left, SEEK_CUR) < 0) throw system_error(text("cannot seek in '", name_, "'"));
        position_ += left;
        return;
    }
    std::vector<std::byte> waste(static_cast<std::size_t>(std::min<std::int64_t>(left, 1 << 20)));
    while (left > 0) {
        std::size_t const want = static_cast<std::size_t>(std::min<std::int64_t>(left, std::ssize(waste)));
        std::size_t const got = read(waste.data(), want);
        if (got < want) throw Error(ErrorKind::data, text("'", name_, "' ended early after ", position_, " bytes"));
        left -= static_cast<std::int64_t>(got);
    }
}

void ByteSource::seek(std::int64_t position) {
    if (::lseek(descriptor_, position, SEEK_SET) < 0) throw system_error(text("cannot seek in '", name_, "'"));
    ahead_.clear();
    ahead_begin_ = 0;
    position_ = position;
}

int ByteSource::threads_for(std::size_t n) const {
    return static_cast<int>(std::clamp<std::size_t>(n / least_share, 1, static_cast<std::size_t>(readers_)));
}

void ByteSource::read_at(std::int64_t position, void* to, std::size_t n) const {
    auto* const bytes = static_cast<std::byte*>(to);
    int const parts = threads_for(n);
    std::size_t const there = parts > 1 ? read_together(position, bytes, n, parts) : read_part(position, bytes, n);
    if (there < n)
        throw Error(ErrorKind::data, text("'", name_, "' ended early: ", position + static_cast<std::int64_t>(n),
                                          " bytes needed, ", position + static_cast<std::int64_t>(there), " there"));
}

/// A function of its own: compilers prepare for threads on entry, and who reads alone should not pay for that.
std::size_t ByteSource::read_together(std::int64_t position, std::byte* to, std::size_t n, int parts) const {
    std::size_t const share = (n / static_cast<std::size_t>(parts) + 4095) / 4096 * 4096;
    std::array<std::size_t, most_readers> got{};
    std::array<std::exception_ptr, most_readers> failures;
#pragma omp parallel for num_threads(parts) schedule(static, 1)
    for (int i = 0; i < parts; ++i) {
        auto const part = static_cast<std::size_t>(i);
        std::size_t const begin = part * share, end = i + 1 < parts ? begin + share : n;
        try {
            got[part] = read_part(position + static_cast<std::int64_t>(begin), to + begin, end - begin);
        } catch (...) {
            failures[part] = std::current_exception();
        }
    }
    for (auto const& failure : failures)
        if (failure) std::rethrow_exception(failure);
    return std::accumulate(got.begin(), got.end(), std::size_t{0});
}

/// Fewer than n bytes at the end of the file.
std::size_t ByteSource::read_part(std::int64_t position, std::byte* to, std::size_t n) const {
    std::size_t done = 0;
    while (done < n) {
        ssize_t const got = ::pread(descriptor_, to + done, std::min(n - done, largest_read),
                                    position + static_cast<std::int64_t>(done));
        if (got == 0) break;
        if (got < 0 && errno != EINTR) throw system_error(text("cannot read '", name_, "'"));
        if (got > 0) done += static_cast<std::size_t>(got);
    }
    return done;
}

std::vector<std::byte> ByteSource::take_lookahead() {
    std::vector<std::byte> rest(ahead_.begin() + static_cast<std::ptrdiff_t>(ahead_begin_), ahead_.end());
    position_ += std::ssize(rest);
    ahead_.clear();
    ahead_begin_ = 0;
    return rest;
}

FilePart file_part(std::string const& path) {
    std::size_t colon = path.rfind(":/");
    if (colon == std::string::npos || colon == 0) {
        constexpr std::string_view archive = ".npz:";
        colon = path.rfind(archive);
        if (colon != std::string::npos) colon += archive.size() - 1;
    }
    if (colon == std::string::npos) return {path, {}};
    return {path.substr(0, colon), path.substr(colon + 1)};
}

std::unique_ptr<ByteSource> open_bytes(std::string const& path) {
    bool const standard_input = path == "-";
    int descriptor = standard_input     ? STDIN_FILENO
                     : is_segment(path) ? open_segment(path)
                                        : ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (FilePart const part = file_part(path); descriptor < 0 && !part.part.empty()) {
        int const whole = ::open(part.file.c_str(), O_RDONLY | O_CLOEXEC);
        if (whole >= 0) descriptor = whole;
    }
    std::string const name = standard_input ? "standard input" : path;
    if (descriptor < 0) throw system_error(text("cannot open '", name, "'"));
    return std::make_unique<ByteSource>(descriptor, name);
}

} // namespace vkt
