// A file as a stream.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/gdcm/stream.h"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace vkt::dicom {
namespace {

constexpr std::int64_t head_bytes = 8192, jump_bytes = 512, part_bytes = 32768;

} // namespace

FileBytes::FileBytes(std::string const& path) : descriptor_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
    struct stat about {};
    if (descriptor_ < 0 || ::fstat(descriptor_, &about) != 0) return;
    size_ = about.st_size;
    head_.resize(static_cast<std::size_t>(std::min(head_bytes, size_)));
    head_.resize(static_cast<std::size_t>(read_at(0, head_.data(), std::ssize(head_))));
    part_end_ = std::ssize(head_);
    show(head_, 0, 0);
}

FileBytes::~FileBytes() {
    if (descriptor_ >= 0) ::close(descriptor_);
}

std::int64_t FileBytes::read_at(std::int64_t at, char* to, std::int64_t n) const {
    std::int64_t done = 0;
    while (done < n) {
        ssize_t const got = ::pread(descriptor_, to + done, static_cast<std::size_t>(n - done), at + done);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) break;
        done += got;
    }
    return done;
}

void FileBytes::show(std::vector<char>& part, std::int64_t begin, std::int64_t at) {
    begin_ = begin;
    setg(part.data(), part.data() + (at - begin), part.data() + part.size());
}

FileBytes::int_type FileBytes::underflow() {
    if (gptr() < egptr()) return traits_type::to_int_type(*gptr());
    std::int64_t const at = position();
    if (at < std::ssize(head_)) {
        show(head_, 0, at);
        return traits_type::to_int_type(*gptr());
    }
    part_.resize(static_cast<std::size_t>(at == part_end_ ? part_bytes : jump_bytes));
    part_.resize(static_cast<std::size_t>(read_at(at, part_.data(), std::ssize(part_))));
    part_end_ = at + std::ssize(part_);
    show(part_, at, at);
    return part_.empty() ? traits_type::eof() : traits_type::to_int_type(*gptr());
}

std::streamsize FileBytes::xsgetn(char* to, std::streamsize n) {
    std::streamsize done = 0;
    while (done < n) {
        std::streamsize const here = std::min<std::streamsize>(egptr() - gptr(), n - done);
        if (here > 0) {
            std::memcpy(to + done, gptr(), static_cast<std::size_t>(here));
            setg(eback(), gptr() + here, egptr());
            done += here;
        } else if (n - done >= jump_bytes && position() >= std::ssize(head_)) {
            std::int64_t const at = position(), got = read_at(at, to + done, n - done);
            part_.clear();
            part_end_ = at + got;
            show(part_, at + got, at + got);
            return done + got;
        } else if (traits_type::eq_int_type(underflow(), traits_type::eof())) {
            break;
        }
    }
    return done;
}

FileBytes::pos_type FileBytes::seekoff(off_type by, std::ios::seekdir from, std::ios::openmode which) {
    return seekpos(by + (from == std::ios::beg ? 0 : from == std::ios::cur ? position() : size_), which);
}

FileBytes::pos_type FileBytes::seekpos(pos_type to, std::ios::openmode /*which*/) {
    std::int64_t const at = to;
    if (at < 0) return pos_type(off_type(-1));
    if (at >= begin_ && at <= begin_ + (egptr() - eback())) {
        setg(eback(), eback() + (at - begin_), egptr());
    } else if (at < std::ssize(head_)) {
        show(head_, 0, at);
    } else {
        part_.clear();
        show(part_, at, at);
    }
    return to;
}

} // namespace vkt::dicom
