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
