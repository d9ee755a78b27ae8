// ZIP files (https://pkware.cachefly.net/webdocs/casestudies/APPNOTE.TXT): their directory, and members inflated.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/zip_archive.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <utility>

namespace vkt {
namespace {

using namespace zip;

constexpr std::int64_t longest_comment = 65535, largest_directory = std::int64_t{64} << 20;
constexpr std::size_t block = std::size_t{128} << 10;

/// Little-endian numbers of a piece of the file.
class Record {
public:
    Record(std::vector<unsigned char> bytes, std::string const& name) : bytes_(std::move(bytes)), name_(name) {}

    std::uint64_t number(std::size_t at, std::size_t n) const {
        need(at, n);
        std::uint64_t value = 0;
        for (std::size_t i = n; i-- > 0;) value = value << 8 | bytes_[at + i];
        return value;
    }
    std::string words(std::size_t at, std::size_t n) const {
        need(at, n);
        return {reinterpret_cast<char const*>(bytes_.data()) + at, n};
    }
    std::size_t size() const { return bytes_.size(); }

private:
    void need(std::size_t at, std::size_t n) const {
        if (at > bytes_.size() || n > bytes_.size() - at)
            throw Error(ErrorKind::data, text("'", name_, "': damaged: its directory ends early"));
    }

    std::vector<unsigned char> bytes_;
    std::string const& name_;
};

[[noreturn]] void fail(ByteSource const& bytes, std::string const& what) {
    throw Error(ErrorKind::data, text("'", bytes.name(), "': ", what));
}

/// 0 also where nothing is known of it, as of files without a byte.
std::uint64_t size_of(ByteSource const& bytes) {
    return static_cast<std::uint64_t>(std::max<std::int64_t>(bytes.size(), 0));
}

Record record_at(ByteSource const& bytes, std::uint64_t at, std::uint64_t n) {
    if (at > size_of(bytes) || n > size_of(bytes) - at) fail(bytes, "ended early: no whole ZIP file");
    std::vector<unsigned char> held(n);
    bytes.read_at(static_cast<std::int64_t>(at), held.data(), held.size());
    return {std::move(held), bytes.name()};
}

/// What did not fit into 32 bits, in this order.
void read_extra(Record const& r, std::size_t at, std::size_t end, ZipMember& member) {
    while (at + 4 <= end) {
        std::size_t const length = r.number(at + 2, 2);
        std::size_t next = at + 4;
        if (r.number(at, 2) == numbers64)
            for (std::uint64_t* const number : {&member.bytes, &member.packed, &member.at})
                if (*number == in_extra && next + 8 <= at + 4 + length) {
                    *number = r.number(next, 8);
                    next += 8;
                }
        at += 4 + length;
    }
}

} // namespace

std::vector<ZipMember> zip_members(ByteSource const& bytes) {
    std::uint64_t const tail_size = std::min<std::uint64_t>(size_of(bytes), longest_comment + end_size);
    std::uint64_t const tail_at = size_of(bytes) - tail_size;
    Record const tail = record_at(bytes, tail_at, tail_size);
    std::string const all = tail.words(0, tail.size());
    std::size_t const end = all.size() < end_size ? std::string::npos : all.rfind(end_mark, all.size() - end_size);
    if (end == std::string::npos) fail(bytes, "ended early: no ZIP file's directory at its end");
    std::uint64_t count = tail.number(end + 10, 2), length = tail.number(end + 12, 4), at = tail.number(end + 16, 4);
    if (std::uint64_t const end_at = tail_at + end; end_at >= locator_size) {
        Record const locator = record_at(bytes, end_at - locator_size, locator_size);
        if (locator.words(0, 4) == locator_mark) {
            Record const end64 = record_at(bytes, locator.number(8, 8), end64_size);
            if (end64.words(0, 4) != end64_mark) fail(bytes, "damaged: no directory where its end says");
            count = end64.number(32, 8);
            length = end64.number(40, 8);
            at = end64.number(48, 8);
        }
    }
    if (length > static_cast<std::uint64_t>(largest_directory)) fail(bytes, "its directory exceeds 64 MiB");
    Record const r = record_at(bytes, at, length);
    std::vector<ZipMember> members;
    std::size_t entry = 0;
    for (std::uint64_t i = 0; i < count; ++i) {
        if (r.words(entry, 4) != central_mark) fail(bytes, "damaged: its directory");
        ZipMember member;
        member.encrypted = (r.number(entry + 8, 2) & 1) != 0;
        member.method = static_cast<int>(r.number(entry + 10, 2));
        member.checksum = r.number(entry + 16, 4);
        member.packed = r.number(entry + 20, 4);
        member.bytes = r.number(entry + 24, 4);
        std::size_t const name = r.number(entry + 28, 2), extra = r.number(entry + 30, 2),
                          comment = r.number(entry + 32, 2);
        member.at = r.number(entry + 42, 4);
        member.name = r.words(entry + central_size, name);
        std::size_t const end_of_extra = entry + central_size + name + extra;
        r.words(entry + central_size + name, extra);
        read_extra(r, entry + central_size + name, end_of_extra, member);
        entry = end_of_extra + comment;
        members.push_back(std::move(member));
    }
    return members;
}

std::int64_t zip_begin(ByteSource const& bytes, ZipMember const& member) {
    if (member.encrypted || (member.method != stored && member.method != deflated))
        fail(bytes, text("'", member.name, "' is ",
                         member.encrypted ? "encrypted" : "neither stored nor deflated, which is all that is read"));
    Record const local = record_at(bytes, member.at, local_size);
    if (local.words(0, 4) != local_mark) fail(bytes, "damaged: a member is not where its directory says");
    std::uint64_t const from = member.at + local_size + local.number(26, 2) + local.number(28, 2);
    if (from > size_of(bytes) || member.packed > size_of(bytes) - from)
        fail(bytes, "ended early: a member lies beyond its end");
    return static_cast<std::int64_t>(from);
}

std::string zip_first_name(std::span<std::byte const> head) {
    auto const* const text = reinterpret_cast<char const*>(head.data());
    if (head.size() < local_size || std::string_view(text, 4) != local_mark) return {};
    auto const length = std::to_integer<std::size_t>(head[26]) | std::to_integer<std::size_t>(head[27]) << 8;
    return head.size() < local_size + length ? std::string() : std::string(text + local_size, length);
}

namespace {

void put_number(std::string& bytes, std::uint64_t value, std::size_t n) {
    for (std::size_t i = 0; i < n; ++i) bytes += static_cast<char>(value >> (8 * i));
}

/// From "version needed" to the length of the name: what both kinds of header say alike.
std::string said_twice(ZipMember const& m) {
    std::string bytes;
    put_number(bytes, 45, 2);     // numbers of 64 bits
    put_number(bytes, 0x0800, 2); // names are UTF-8
    put_number(bytes, static_cast<std::uint64_t>(m.method), 2);
    put_number(bytes, 0x00210000, 4); // 1980: equal stores give equal files
    put_number(bytes, m.checksum, 4);
    put_number(bytes, in_extra, 4);
    put_number(bytes, in_extra, 4);
    put_number(bytes, m.name.size(), 2);
    return bytes;
}

std::string local_header(ZipMember const& m) {
    std::string bytes = std::string(local_mark) + said_twice(m);
    put_number(bytes, 20, 2);
    bytes += m.name;
    put_number(bytes, numbers64, 2);
    put_number(bytes, 16, 2);
    put_number(bytes, m.bytes, 8);
    put_number(bytes, m.packed, 8);
    return bytes;
}

} // namespace

void ZipWriter::put(std::string const& bytes) {
    file_.write(bytes.data(), bytes.size());
    at_ += bytes.size();
}

void ZipWriter::add(std::string const& name, ByteSource& bytes) {
    begin(name, stored);
    std::vector<std::byte> part(std::size_t{1} << 20);
    std::uint64_t count = 0, checksum = 0;
    while (std::size_t const n = bytes.read(part.data(), part.size())) {
        checksum = crc32_z(checksum, reinterpret_cast<Bytef const*>(part.data()), n);
        count += n;
        file_.write(part.data(), n);
    }
    end(count, count, checksum);
}

void ZipWriter::copy(ByteSource const& archive, ZipMember member) {
    std::int64_t from = zip_begin(archive, member);
    std::vector<std::byte> part(std::size_t{1} << 20);
    begin(member.name, member.method);
    for (std::uint64_t left = member.packed; left > 0;) {
        auto const n = static_cast<std::size_t>(std::min<std::uint64_t>(left, part.size()));
        archive.read_at(from, part.data(), n);
        file_.write(part.data(), n);
        from += static_cast<std::int64_t>(n);
        left -= n;
    }
    end(member.bytes, member.packed, member.checksum);
}

std::int64_t ZipWriter::begin(std::string const& name, int method) {
    ZipMember m;
    m.name = name;
    m.method = method;
    m.at = at_;
    put(local_header(m)); // completed by end()
    members_.push_back(std::move(m));
    return static_cast<std::int64_t>(at_);
}

void ZipWriter::end(std::uint64_t bytes, std::uint64_t packed, std::uint64_t checksum) {
    ZipMember& m = members_.back();
    m.bytes = bytes;
    m.packed = packed;
    m.checksum = checksum;
    at_ += packed;
    std::string const head = local_header(m);
    file_.write_at(static_cast<std::int64_t>(m.at), head.data(), head.size());
}

void ZipWriter::finish() {
    std::uint64_t const at = at_;
    for (ZipMember const& m : members_) {
        std::string bytes(central_mark);
        put_number(bytes, 45, 2);
        bytes += said_twice(m);
        put_number(bytes, 28, 2);
        put_number(bytes, 0, 2 + 2 + 2); // comment, disk, text
        put_number(bytes, std::uint64_t{0600} << 16, 4);
        put_number(bytes, in_extra, 4);
        bytes += m.name;
        put_number(bytes, numbers64, 2);
        put_number(bytes, 24, 2);
        put_number(bytes, m.bytes, 8);
        put_number(bytes, m.packed, 8);
        put_number(bytes, m.at, 8);
        put(bytes);
    }
    std::uint64_t const length = at_ - at, count = members_.size();
    put(zip_end(count, length, at));
}

std::string zip_end(std::uint64_t count, std::uint64_t length, std::uint64_t at) {
    std::string bytes(end64_mark);
    put_number(bytes, end64_size - 12, 8);
    put_number(bytes, 45, 2);
    put_number(bytes, 45, 2);
    put_number(bytes, 0, 8); // disks
    put_number(bytes, count, 8);
    put_number(bytes, count, 8);
    put_number(bytes, length, 8);
    put_number(bytes, at, 8);
    bytes += locator_mark;
    put_number(bytes, 0, 4);
    put_number(bytes, at + length, 8);
    put_number(bytes, 1, 4);
    bytes += end_mark;
    put_number(bytes, 0, 4);
    put_number(bytes, std::min<std::uint64_t>(count, 0xffff), 2);
    put_number(bytes, std::min<std::uint64_t>(count, 0xffff), 2);
    put_number(bytes, std::min(length, in_extra), 4);
    put_number(bytes, std::min(at, in_extra), 4);
    put_number(bytes, 0, 2);
    return bytes;
}

Inflated::Inflated(std::shared_ptr<ByteSource const> bytes, std::int64_t at, ZipMember member)
    : bytes_(std::move(bytes)), member_(std::move(member)), at_(at), left_(member_.packed), input_(block) {
    if (inflateInit2(&state_, -MAX_WBITS) != Z_OK) throw Error(ErrorKind::resources, "no memory for inflate");
}

Inflated::~Inflated() { inflateEnd(&state_); }

std::size_t Inflated::read(std::byte* to, std::size_t n) {
    std::size_t done = 0;
    while (done < n && !ended_) {
        if (state_.avail_in == 0) fill();
        auto const want = static_cast<uInt>(std::min<std::size_t>(n - done, std::size_t{1} << 30));
        state_.next_out = reinterpret_cast<Bytef*>(to + done);
        state_.avail_out = want;
        int const result = inflate(&state_, Z_NO_FLUSH);
        std::size_t const got = want - state_.avail_out;
        checksum_ = crc32_z(checksum_, reinterpret_cast<Bytef const*>(to + done), got);
        done += got;
        count_ += got;
        ended_ = result == Z_STREAM_END;
        bool const starved = result == Z_BUF_ERROR && left_ == 0;
        if ((result != Z_OK && result != Z_STREAM_END && result != Z_BUF_ERROR) || starved || count_ > member_.bytes)
            damaged();
    }
    if (ended_ && (count_ != member_.bytes || checksum_ != member_.checksum)) damaged();
    return done;
}

void Inflated::damaged() const {
    throw Error(ErrorKind::data,
                text("'", bytes_->name(), "': damaged: '", member_.name, "' does not decompress to what was stored"));
}

void Inflated::fill() {
    auto const n = static_cast<std::size_t>(std::min<std::uint64_t>(left_, block));
    bytes_->read_at(at_, input_.data(), n);
    at_ += static_cast<std::int64_t>(n);
    left_ -= n;
    state_.next_in = input_.data();
    state_.avail_in = static_cast<uInt>(n);
}

} // namespace vkt
