// NumPy's .npz: arrays in a ZIP file (https://pkware.cachefly.net/webdocs/casestudies/APPNOTE.TXT), stored or deflated.
// SPDX-License-Identifier: MIT
#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/numpy.h"
#include "libvkt/formats/parsed_grids.h"
#include "libvkt/formats/slab_sink.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include <zlib.h>

namespace vkt {
namespace {

using namespace std::string_view_literals;

constexpr std::string_view local_mark = "PK\3\4"sv, central_mark = "PK\1\2"sv, end_mark = "PK\5\6"sv,
                           end64_mark = "PK\6\6"sv, locator_mark = "PK\6\7"sv;
constexpr std::size_t local_size = 30, central_size = 46, end_size = 22, end64_size = 56, locator_size = 20;
constexpr std::int64_t longest_comment = 65535, largest_directory = std::int64_t{64} << 20;
constexpr std::uint64_t in_extra = 0xffffffff; ///< a number of 32 bits that stands among those of 64
constexpr std::uint16_t numbers64 = 1;         ///< these, among the extra fields
constexpr int stored = 0, deflated = 8;
constexpr std::string_view suffix = ".npy";

struct Member {
    std::string name; ///< without ".npy"
    int method = stored;
    bool encrypted = false;
    std::uint64_t checksum = 0, packed = 0, bytes = 0, at = 0;
};

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

class Archive {
public:
    explicit Archive(ByteSource const& bytes) : bytes_(bytes) { read_directory(); }

    std::vector<Member> const& arrays() const { return arrays_; }
    /// Where the member's bytes begin.
    std::int64_t begin(Member const& member) const {
        Record const local = record(member.at, local_size);
        if (local.words(0, 4) != local_mark) fail("damaged: an array is not where its directory says");
        std::uint64_t const from = member.at + local_size + local.number(26, 2) + local.number(28, 2);
        if (from > size() || member.packed > size() - from) fail("ended early: an array lies beyond its end");
        return static_cast<std::int64_t>(from);
    }

private:
    [[noreturn]] void fail(std::string const& what) const {
        throw Error(ErrorKind::data, text("'", bytes_.name(), "': ", what));
    }
    /// 0 also where nothing is known of it, as of files without a byte.
    std::uint64_t size() const { return static_cast<std::uint64_t>(std::max<std::int64_t>(bytes_.size(), 0)); }
    Record record(std::uint64_t at, std::uint64_t n) const {
        if (at > size() || n > size() - at) fail("ended early: no whole ZIP file");
        std::vector<unsigned char> bytes(n);
        bytes_.read_at(static_cast<std::int64_t>(at), bytes.data(), bytes.size());
        return {std::move(bytes), bytes_.name()};
    }
    void read_directory();
    static void read_extra(Record const& r, std::size_t at, std::size_t end, Member& member);

    ByteSource const& bytes_;
    std::vector<Member> arrays_;
};

/// What did not fit into 32 bits, in this order.
void Archive::read_extra(Record const& r, std::size_t at, std::size_t end, Member& member) {
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

void Archive::read_directory() {
    std::uint64_t const tail_size = std::min<std::uint64_t>(size(), longest_comment + end_size);
    std::uint64_t const tail_at = size() - tail_size;
    Record const tail = record(tail_at, tail_size);
    std::string const all = tail.words(0, tail.size());
    std::size_t const end = all.size() < end_size ? std::string::npos : all.rfind(end_mark, all.size() - end_size);
    if (end == std::string::npos) fail("ended early: no ZIP file's directory at its end");
    std::uint64_t count = tail.number(end + 10, 2), bytes = tail.number(end + 12, 4), at = tail.number(end + 16, 4);
    if (std::uint64_t const end_at = tail_at + end; end_at >= locator_size) {
        Record const locator = record(end_at - locator_size, locator_size);
        if (locator.words(0, 4) == locator_mark) {
            Record const end64 = record(locator.number(8, 8), end64_size);
            if (end64.words(0, 4) != end64_mark) fail("damaged: no directory where its end says");
            count = end64.number(32, 8);
            bytes = end64.number(40, 8);
            at = end64.number(48, 8);
        }
    }
    if (bytes > static_cast<std::uint64_t>(largest_directory)) fail("its directory exceeds 64 MiB");
    Record const r = record(at, bytes);
    std::size_t entry = 0;
    for (std::uint64_t i = 0; i < count; ++i) {
        if (r.words(entry, 4) != central_mark) fail("damaged: its directory");
        Member member;
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
        if (!member.name.ends_with(suffix)) continue;
        member.name.resize(member.name.size() - suffix.size());
        arrays_.push_back(std::move(member));
    }
}

Member const& chosen(std::vector<Member> const& arrays, std::string const& variable, std::string const& file) {
    if (arrays.empty()) throw Error(ErrorKind::data, text("'", file, "' holds no array"));
    auto const names = collect(arrays, [](Member const& m) { return m.name; });
    if (variable.empty() && arrays.size() > 1)
        throw Error(ErrorKind::usage, text("'", file, "' holds several arrays: ", join(names, ", ")),
                    text("name one: ", file, ":", names.front()));
    if (variable.empty()) return arrays.front();
    auto const found = std::find(names.begin(), names.end(), variable);
    if (found != names.end()) return arrays[static_cast<std::size_t>(found - names.begin())];
    std::string const near = nearest_name(variable, names);
    throw Error(ErrorKind::usage, text("'", file, "' holds no array '", variable, "', but ", join(names, ", ")),
                near.empty() ? "" : text("did you mean '", near, "'?"));
}

/// The bytes of a deflated member, in order.
class Inflated {
public:
    Inflated(std::shared_ptr<ByteSource const> bytes, std::int64_t at, Member member)
        : bytes_(std::move(bytes)), member_(std::move(member)), at_(at), left_(member_.packed), input_(block) {
        if (inflateInit2(&state_, -MAX_WBITS) != Z_OK) throw Error(ErrorKind::resources, "no memory for inflate");
    }
    ~Inflated() { inflateEnd(&state_); }
    Inflated(Inflated const&) = delete;
    Inflated& operator=(Inflated const&) = delete;

    std::size_t read(std::byte* to, std::size_t n) {
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
            if ((result != Z_OK && result != Z_STREAM_END && result != Z_BUF_ERROR) || starved ||
                count_ > member_.bytes)
                damaged();
        }
        if (ended_ && (count_ != member_.bytes || checksum_ != member_.checksum)) damaged();
        return done;
    }

private:
    static constexpr std::size_t block = std::size_t{128} << 10;

    [[noreturn]] void damaged() const {
        throw Error(ErrorKind::data, text("'", bytes_->name(), "': damaged: the array '", member_.name,
                                          "' does not decompress to what was stored"));
    }
    void fill() {
        auto const n = static_cast<std::size_t>(std::min<std::uint64_t>(left_, block));
        bytes_->read_at(at_, input_.data(), n);
        at_ += static_cast<std::int64_t>(n);
        left_ -= n;
        state_.next_in = input_.data();
        state_.avail_in = static_cast<uInt>(n);
    }

    std::shared_ptr<ByteSource const> bytes_;
    Member member_;
    std::int64_t at_;
    std::uint64_t left_, count_ = 0;
    std::vector<Bytef> input_;
    z_stream state_{};
    unsigned long checksum_ = 0;
    bool ended_ = false;
};

bool is_npz(std::span<std::byte const> head) {
    // The first member's name tells arrays from documents and programs, which are ZIP files too.
    if (head.size() < local_size || std::memcmp(head.data(), local_mark.data(), 4) != 0) return false;
    auto const length = std::to_integer<std::size_t>(head[26]) | std::to_integer<std::size_t>(head[27]) << 8;
    if (head.size() < local_size + length) return false;
    return std::string_view(reinterpret_cast<char const*>(head.data()) + local_size, length).ends_with(suffix);
}

std::unique_ptr<Source> open_npz(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    bytes = seekable_bytes(std::move(bytes));
    FilePart const part = file_part(bytes->name());
    if (!part.part.empty() && !options.variable.empty())
        throw Error(ErrorKind::usage, text("'", bytes->name(), "' names an array, and --variable another one"));
    Archive const archive(*bytes);
    Member const member = chosen(archive.arrays(), part.part.empty() ? options.variable : part.part, part.file);
    if (member.encrypted || (member.method != stored && member.method != deflated))
        throw Error(ErrorKind::data, text("'", part.file, "': the array '", member.name, "' is ",
                                          member.encrypted ? "encrypted" : "compressed as NumPy does not"));
    std::int64_t const at = archive.begin(member);
    if (member.method == deflated) {
        std::string const name = bytes->name();
        auto const inflated =
            std::make_shared<Inflated>(std::shared_ptr<ByteSource const>(std::move(bytes)), at, member);
        bytes = std::make_unique<ByteSource>(
            name, [inflated](std::byte* to, std::size_t n) { return inflated->read(to, n); });
    } else {
        bytes->seek(at);
    }
    RawLayout layout = read_numpy_header(*bytes);
    layout.header.attributes["variable"] = member.name;
    std::int64_t const header = bytes->position() - (member.method == stored ? at : 0);
    check(layout.header);
    // Each factor is below 2^62; their product need not be.
    auto const room = static_cast<std::int64_t>(std::min<std::uint64_t>(member.bytes, std::uint64_t{1} << 62)) - header;
    if (layout.volumes > room / static_cast<std::int64_t>(layout.header.bytes()))
        throw Error(ErrorKind::data, text("'", part.file, "': the array '", member.name, "' ended early: ", room,
                                          " bytes cannot hold its voxels"));
    return raw_source(std::move(bytes), std::move(layout));
}

void put(std::string& bytes, std::uint64_t value, std::size_t n) {
    for (std::size_t i = 0; i < n; ++i) bytes += static_cast<char>(value >> (8 * i));
}

/// One array, as numpy.savez writes it: sizes in 64 bits.
class NpzWriter : public VolumeWriter {
public:
    NpzWriter(std::string const& path, WriteOptions const& options)
        : options_(options), file_(file_part(path).file, options.force), name_(file_part(path).part) {
        if (file_.in_place())
            throw Error(ErrorKind::usage, text("'", path, "': NumPy archives cannot be written to a pipe"),
                        "write .npy, or name a file: -o out.npz");
        if (name_.empty()) name_ = "arr_0";
        name_ += suffix;
    }

    void begin(Header const& header) override {
        if (header.kind != Kind::structured)
            throw Error(ErrorKind::usage, "NumPy cannot hold bricks", "make a grid of them first: vkt resample");
        if (volumes_ > 0 && !same_lattice(first_, header))
            throw Error(ErrorKind::usage, "one array cannot hold volumes of different dims, types or geometry",
                        "write one file each: name it like out_%04d.npz");
        file_.expect(options_.compress ? least_deflated(header.bytes()) : header.bytes());
        if (volumes_++ > 0) return;
        first_ = in_utf8(header);
        std::string const local = local_header();
        file_.write(local.data(), local.size());
        std::string const head = array_header();
        header_length_ = head.size();
        if (options_.compress) {
            deflate_.emplace(file_, DeflateWriter::Wrapper::none, options_, std::ssize(local));
            deflate_->store(head);
        } else {
            file_.write(head.data(), head.size());
        }
    }
    void write(std::byte const* voxels, std::size_t n) override {
        bytes_ += n;
        if (deflate_) return deflate_->write(voxels, n);
        checksum_ = crc32_z(checksum_, reinterpret_cast<Bytef const*>(voxels), n);
        file_.write(voxels, n);
    }
    void close() override {
        if (volumes_ == 0) throw Error(ErrorKind::data, "there is no volume to write");
        std::string const head = array_header();
        packed_ = bytes_ += head.size();
        if (deflate_) {
            if (volumes_ > 1) deflate_->restore(head);
            deflate_->finish();
            packed_ = static_cast<std::uint64_t>(deflate_->bytes_written());
            checksum_ = deflate_->checksum();
        } else {
            unsigned long const first = crc32_z(0, reinterpret_cast<Bytef const*>(head.data()), head.size());
            checksum_ = crc32_combine(first, checksum_, static_cast<z_off_t>(bytes_ - head.size()));
        }
        std::string const end = directory();
        file_.write(end.data(), end.size());
        std::string const local = local_header();
        file_.write_at(0, local.data(), local.size());
        if (!deflate_ && volumes_ > 1) file_.write_at(std::ssize(local), head.data(), head.size());
        file_.commit();
    }

private:
    std::string array_header() const { return numpy_bytes({first_, volumes_, -1, no_file_, header_length_, false}); }

    /// From "version needed" to the checksum: what both kinds of header say alike.
    std::string said_twice() const {
        std::string bytes;
        put(bytes, 45, 2);     // numbers of 64 bits
        put(bytes, 0x0800, 2); // names are UTF-8
        put(bytes, static_cast<std::uint64_t>(options_.compress ? deflated : stored), 2);
        put(bytes, 0x00210000, 4); // 1980: equal volumes give equal files
        put(bytes, checksum_, 4);
        put(bytes, in_extra, 4);
        put(bytes, in_extra, 4);
        put(bytes, name_.size(), 2);
        return bytes;
    }
    std::string local_header() const {
        std::string bytes = std::string(local_mark) + said_twice();
        put(bytes, 20, 2);
        bytes += name_;
        put(bytes, numbers64, 2);
        put(bytes, 16, 2);
        put(bytes, bytes_, 8);
        put(bytes, packed_, 8);
        return bytes;
    }
    std::string directory() const {
        std::uint64_t const at = local_header().size() + packed_;
        std::string bytes(central_mark);
        put(bytes, 45, 2);
        bytes += said_twice();
        put(bytes, 20, 2);
        put(bytes, 0, 2 + 2 + 2); // comment, disk, text
        put(bytes, std::uint64_t{0600} << 16, 4);
        put(bytes, 0, 4);
        bytes += name_;
        put(bytes, numbers64, 2);
        put(bytes, 16, 2);
        put(bytes, bytes_, 8);
        put(bytes, packed_, 8);
        std::uint64_t const length = bytes.size();
        bytes += end64_mark;
        put(bytes, end64_size - 12, 8);
        put(bytes, 45, 2);
        put(bytes, 45, 2);
        put(bytes, 0, 8); // disks
        put(bytes, 1, 8);
        put(bytes, 1, 8);
        put(bytes, length, 8);
        put(bytes, at, 8);
        bytes += locator_mark;
        put(bytes, 0, 4);
        put(bytes, at + length, 8);
        put(bytes, 1, 4);
        bytes += end_mark;
        put(bytes, 0, 4);
        put(bytes, 1, 2);
        put(bytes, 1, 2);
        put(bytes, length, 4);
        put(bytes, std::min(at, in_extra), 4);
        put(bytes, 0, 2);
        return bytes;
    }

    WriteOptions options_;
    OutputFile file_;
    std::string name_, no_file_;
    Header first_;
    std::int64_t volumes_ = 0;
    std::size_t header_length_ = 0;
    std::uint64_t bytes_ = 0, packed_ = 0; ///< of the array, and as it lies in the file
    unsigned long checksum_ = 0;
    std::optional<DeflateWriter> deflate_;
};

std::unique_ptr<Sink> create_npz(std::string const& path, WriteOptions const& options) {
    return slab_sink(std::make_unique<NpzWriter>(path, options));
}

} // namespace

Format npz_format() {
    return {"npz", "NumPy arrays in a ZIP file: FILE.npz:NAME", {".npz"}, is_npz, open_npz, create_npz};
}

} // namespace vkt
