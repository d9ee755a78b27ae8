// Regions out of files of plain or encoded voxels.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/raw_source.h"

#include "libvkt/core/error.h"
#include "libvkt/core/first_failure.h"
#include "libvkt/core/text.h"
#include "libvkt/io/system_error.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <filesystem>
#include <limits>

#include <sys/stat.h>

namespace vkt {

namespace {

/// Rows are read together with what lies between them if that is less than this: a call costs as much as 8 KiB of
/// copying.
constexpr std::int64_t cheap_gap = 4096;
/// Rows that are read together come in pieces that stay in the cache.
constexpr std::int64_t piece = std::int64_t{256} << 10;
/// What is skipped in a stream is read into a block of this size.
constexpr std::int64_t waste_block = std::int64_t{128} << 10;

/// The bytes of all values of `size` bytes in a word, by shifts that compilers do in vectors on every machine.
template <std::size_t size> std::uint64_t swapped(std::uint64_t word) {
    constexpr std::uint64_t bytes = 0x00ff00ff00ff00ff, pairs = 0x0000ffff0000ffff;
    word = (word & bytes) << 8 | (word >> 8 & bytes);
    if constexpr (size >= 4) word = (word & pairs) << 16 | (word >> 16 & pairs);
    if constexpr (size == 8) word = word << 32 | word >> 32;
    return word;
}

template <std::size_t size> void swap_all(std::byte* data, std::size_t n) {
    // So many that the loop over them has no rest.
    std::array<std::uint64_t, 16> words{};
    std::size_t left = n * size;
    for (; left >= sizeof words; data += sizeof words, left -= sizeof words) {
        std::memcpy(words.data(), data, sizeof words);
        for (std::uint64_t& word : words) word = swapped<size>(word);
        std::memcpy(data, words.data(), sizeof words);
    }
    for (; left > 0; data += size, left -= size) std::reverse(data, data + size);
}

std::int64_t product(std::int64_t a, std::int64_t b, std::string const& name) {
    std::int64_t result = 0;
    if (__builtin_mul_overflow(a, b, &result) || result < 0)
        throw Error(ErrorKind::data, text("'", name, "' claims more bytes than any file can have"));
    return result;
}

class RawSource : public Source {
public:
    RawSource(std::unique_ptr<ByteSource> bytes, RawLayout layout);

    bool next_volume() override;
    Header const& header() const override { return layout_.header; }
    Access access() const override { return random_ ? Access::random : Access::forward; }
    std::vector<std::string> not_read() const override { return layout_.not_read; }
    void read(AnyView out) override;
    void finish() override;

private:
    std::size_t file_count() const { return std::max<std::size_t>(layout_.files.size(), 1); }
    std::string const& file_name(std::size_t i) const { return layout_.files.empty() ? name_ : layout_.files[i]; }
    bool all_regular() const;
    /// Compressed files are skipped once decoded, plain and text files as they are.
    bool skips_decoded() const { return layout_.encoding == Encoding::deflate || layout_.encoding == Encoding::bzip2; }
    std::int64_t bytes_before_voxels();
    void check_sizes();
    void check_size(std::string const& name, std::int64_t available) const;
    void open(std::size_t file);
    void start_stream(std::size_t file);
    void end_stream();
    void tell_surplus(std::string const& name, std::int64_t bytes) const;
    void fetch(std::int64_t position, std::byte* to, std::int64_t n);
    void fetch_random(std::int64_t position, std::byte* to, std::int64_t n);
    void fetch_forward(std::int64_t position, std::byte* to, std::int64_t n);
    void advance(std::byte* to, std::int64_t n);
    void skip_to(std::int64_t position);
    std::int64_t position_of(Index3 voxel) const;
    int threads_for(Box const& region);
    std::int64_t rows_of_group(AnyView const& out) const;
    static std::int64_t groups_of(Box const& region, std::int64_t rows);
    template <class Fetch>
    void read_group(AnyView const& out, std::int64_t rows, std::int64_t i, std::vector<std::byte>& scratch,
                    Fetch const& fetch) const;
    void read_groups_together(AnyView const& out, int threads) const;
    void order_bytes(AnyView const& out) const;
    [[noreturn]] void ended_early(std::int64_t got) const;

    RawLayout layout_;
    std::string name_;
    std::unique_ptr<ByteSource> bytes_; ///< the file that is open now; at first the one that holds the header
    std::unique_ptr<ByteStream> stream_;
    std::int64_t volume_bytes_ = 0, share_ = 0; ///< bytes of one volume, and of all volumes in one file
    std::int64_t index_ = -1;                   ///< of the current volume
    std::int64_t position_ = 0;                 ///< forward: decoded bytes consumed since the first voxel
    std::size_t open_file_ = std::numeric_limits<std::size_t>::max();
    std::int64_t offset_ = 0; ///< random: of the first voxel in the open file
    bool random_ = false;
    std::vector<std::byte> scratch_;
};

RawSource::RawSource(std::unique_ptr<ByteSource> bytes, RawLayout layout)
    : layout_(std::move(layout)), name_(bytes->name()), bytes_(std::move(bytes)) {
    check(layout_.header);
    if (layout_.sequence) layout_.header.attributes["sequence step"] = to_text(layout_.sequence->step);
    if (layout_.volumes < 1 || layout_.channels < 1 || layout_.volumes % layout_.channels != 0 ||
        layout_.line_skip < 0 || layout_.byte_skip < -1)
        throw Error(ErrorKind::data, text("'", name_, "': a negative count in the header"));
    if (layout_.byte_skip == -1 && layout_.encoding != Encoding::raw && !skips_decoded())
        throw Error(ErrorKind::data, text("'", name_, "': a skip of -1 needs binary data"));
    volume_bytes_ = static_cast<std::int64_t>(layout_.header.bytes());
    std::int64_t const total = product(volume_bytes_, layout_.volumes, name_);
    if (total % static_cast<std::int64_t>(file_count()) != 0)
        throw Error(ErrorKind::data, text("'", name_, "': the voxels cannot be shared out evenly among ",
                                          static_cast<std::int64_t>(file_count()), " files"));
    share_ = total / static_cast<std::int64_t>(file_count());
    bool const files = layout_.files.empty() ? bytes_->seekable() : all_regular();
    random_ = layout_.encoding == Encoding::raw && files;
    if (layout_.byte_skip == -1 && !files)
        throw Error(ErrorKind::data, text("'", name_, "': a skip of -1 needs a file, not a pipe"));
}

bool RawSource::all_regular() const {
    return std::all_of(layout_.files.begin(), layout_.files.end(), [](std::string const& file) {
        struct stat status {};
        return ::stat(file.c_str(), &status) != 0 || S_ISREG(status.st_mode); // what is missing is told later
    });
}

void RawSource::check_size(std::string const& name, std::int64_t available) const {
    std::int64_t const skipped = layout_.encoding == Encoding::raw ? std::max<std::int64_t>(layout_.byte_skip, 0) : 0;
    std::int64_t const needed = least_encoded_bytes(layout_.encoding, share_, layout_.header.dtype);
    if (available - skipped < needed)
        throw Error(ErrorKind::data, layout_.encoding == Encoding::raw
                                         ? text("'", name, "' ended early: ", needed, " bytes expected, ",
                                                std::max<std::int64_t>(available - skipped, 0), " found")
                                         : text("'", name, "' ended early: its ", available, " bytes cannot hold ",
                                                share_, " encoded ones"));
    if (layout_.exact && layout_.encoding == Encoding::raw && available - skipped > needed && layout_.byte_skip >= 0)
        throw Error(ErrorKind::data,
                    text("'", name, "' does not fit: ", needed, " bytes expected, ", available - skipped, " found"),
                    "say the right --dims, --dtype and --skip");
}

void RawSource::check_sizes() {
    if (layout_.files.empty()) {
        if (!bytes_->seekable()) return;
        std::int64_t const available = bytes_->size() - bytes_->position();
        check_size(name_, available);
        if (random_ && layout_.byte_skip >= 0 && layout_.line_skip == 0)
            tell_surplus(name_, available - layout_.byte_skip - share_);
        return;
    }
    for (auto const& file : layout_.files) {
        struct stat status {};
        if (::stat(file.c_str(), &status) != 0)
            throw system_error(text("cannot open '", file, "' that '", name_, "' names"));
        if (!S_ISREG(status.st_mode)) continue;
        check_size(file, status.st_size);
        if (random_ && layout_.byte_skip >= 0 && layout_.line_skip == 0)
            tell_surplus(file, status.st_size - layout_.byte_skip - share_);
    }
}

/// Makes a file the open one and moves behind the lines to be skipped.
void RawSource::open(std::size_t file) {
    if (open_file_ == file) return;
    if (!layout_.files.empty()) bytes_ = open_bytes(layout_.files[file]);
    open_file_ = file;
    for (std::int64_t i = 0; i < layout_.line_skip; ++i)
        if (!bytes_->read_line())
            throw Error(ErrorKind::data, text("'", bytes_->name(), "' ended early: lines to skip are missing"));
    if (!random_) return;
    if (layout_.byte_skip < 0) {
        offset_ = bytes_->size() - share_;
    } else {
        check_size(bytes_->name(), bytes_->size() - bytes_->position());
        offset_ = bytes_->position() + layout_.byte_skip;
    }
}

/// Of the open file once decoded. Where voxels come last it is decoded to find out, and left as it was.
std::int64_t RawSource::bytes_before_voxels() {
    if (layout_.byte_skip >= 0) return layout_.byte_skip;
    std::int64_t const begin = bytes_->position();
    auto const stream = decode(*bytes_, layout_.encoding, layout_.header.dtype);
    std::vector<std::byte> waste(static_cast<std::size_t>(waste_block));
    std::int64_t total = 0;
    while (std::size_t const got = stream->read(waste.data(), waste.size())) total += static_cast<std::int64_t>(got);
    if (total < share_) ended_early(total);
    bytes_->seek(begin);
    return total - share_;
}

void RawSource::start_stream(std::size_t file) {
    open(file);
    std::int64_t const skip = skips_decoded() ? bytes_before_voxels() : 0;
    if (!skips_decoded()) bytes_->skip(layout_.byte_skip);
    stream_ = decode(*bytes_, layout_.encoding, layout_.header.dtype);
    std::vector<std::byte> waste(static_cast<std::size_t>(std::min(skip, waste_block)));
    for (std::int64_t left = skip; left > 0;) {
        std::size_t const want = static_cast<std::size_t>(std::min(left, waste_block));
        if (stream_->read(waste.data(), want) < want) ended_early(0);
        left -= static_cast<std::int64_t>(want);
    }
}

/// Others read such files and say nothing; but a header may name too few voxels.
void RawSource::tell_surplus(std::string const& name, std::int64_t bytes) const {
    if (bytes > 0 && layout_.notice)
        layout_.notice(text("'", name, "' holds ", bytes, bytes == 1 ? " byte" : " bytes",
                            " more than the voxels that its header names: not read"));
}

/// Proves that the encoded file is whole: checksums stand behind the last voxel, and behind what follows it.
void RawSource::end_stream() {
    bool const decoded = bytes_->decoded();
    if (!stream_ || (layout_.encoding == Encoding::raw && !layout_.exact && !decoded)) return;
    std::vector<std::byte> rest(static_cast<std::size_t>(waste_block));
    std::int64_t total = 0;
    for (std::size_t more = 1; decoded && !layout_.exact && more > 0; total += static_cast<std::int64_t>(more))
        more = stream_->read(rest.data(), rest.size());
    std::size_t const surplus = stream_->read(rest.data(), rest.size());
    if (layout_.exact && surplus > 0)
        throw Error(ErrorKind::data,
                    text("'", bytes_->name(), "' does not fit: ", share_, " bytes expected, ",
                         surplus == rest.size() ? "at least " : "", share_ + static_cast<std::int64_t>(surplus),
                         " found"),
                    "say the right --dims, --dtype and --skip");
    if (!skips_decoded() && !decoded) return;
    total += static_cast<std::int64_t>(surplus);
    while (std::size_t const more = stream_->read(rest.data(), rest.size())) total += static_cast<std::int64_t>(more);
    tell_surplus(bytes_->name(), total);
}

void RawSource::ended_early(std::int64_t got) const {
    throw Error(ErrorKind::data,
                text("'", bytes_->name(), "' ended early: ", share_, " bytes expected, ", got, " found (",
                     bytes_text(static_cast<double>(got)), " of ", bytes_text(static_cast<double>(share_)), ")"));
}

bool RawSource::next_volume() {
    if (index_ < 0) check_sizes();
    if (index_ + 1 >= layout_.volumes) {
        index_ = layout_.volumes;
        return false;
    }
    ++index_;
    std::int64_t const each = layout_.volumes / layout_.channels;
    if (layout_.sequence)
        layout_.header.attributes["sequence position"] =
            to_text(layout_.sequence->origin + static_cast<double>(index_ % each) * layout_.sequence->step);
    if (layout_.channels > 1) layout_.header.attributes["channel"] = to_text(index_ / each);
    return true;
}

void RawSource::finish() {
    if (random_ || index_ < 0 || index_ >= layout_.volumes) return;
    skip_to((index_ + 1) * volume_bytes_);
    if (index_ + 1 == layout_.volumes) end_stream();
}

void RawSource::fetch(std::int64_t position, std::byte* to, std::int64_t n) {
    position += index_ * volume_bytes_;
    if (random_)
        fetch_random(position, to, n);
    else
        fetch_forward(position, to, n);
}

void RawSource::fetch_random(std::int64_t position, std::byte* to, std::int64_t n) {
    while (n > 0) {
        std::int64_t const inside = position % share_;
        std::int64_t const count = std::min(n, share_ - inside);
        open(static_cast<std::size_t>(position / share_));
        bytes_->read_at(offset_ + inside, to, static_cast<std::size_t>(count));
        position += count;
        to += count;
        n -= count;
    }
}

void RawSource::fetch_forward(std::int64_t position, std::byte* to, std::int64_t n) {
    if (position < position_)
        throw Error(ErrorKind::failure, text("'", name_, "' can only be read forward, and its slices ahead are gone"));
    skip_to(position);
    advance(to, n);
}

void RawSource::skip_to(std::int64_t position) {
    if (position <= position_) return;
    std::vector<std::byte> waste(static_cast<std::size_t>(std::min(position - position_, waste_block)));
    while (position_ < position) advance(waste.data(), std::min(position - position_, waste_block));
}

/// Takes the next n bytes of the sequence of files.
void RawSource::advance(std::byte* to, std::int64_t n) {
    while (n > 0) {
        std::int64_t const inside = position_ % share_;
        if (inside == 0) {
            end_stream();
            start_stream(static_cast<std::size_t>(position_ / share_));
        }
        std::int64_t const count = std::min(n, share_ - inside);
        std::size_t const got = stream_->read(to, static_cast<std::size_t>(count));
        if (static_cast<std::int64_t>(got) < count) ended_early(inside + static_cast<std::int64_t>(got));
        position_ += count;
        to += count;
        n -= count;
    }
}

void RawSource::read(AnyView out) {
    Index3 const dims = layout_.header.dims;
    if (out.box.empty()) return;
    if (!box_of(dims).contains(out.box) || index_ < 0 || index_ >= layout_.volumes)
        throw Error(ErrorKind::failure, text("region ", out.box, " is outside of '", name_, "'"));
    std::int64_t const row = dims.x * static_cast<std::int64_t>(size_of(layout_.header.dtype));
    Index3 const size = out.dims();
    if (size.x == dims.x && out.row == size.x && size.y == dims.y && (out.slice == size.x * size.y || size.z == 1)) {
        fetch(out.box.lower.z * row * dims.y, out.data, row * dims.y * size.z);
    } else if (int const threads = threads_for(out.box); threads > 1) {
        read_groups_together(out, threads);
    } else {
        std::int64_t const rows = rows_of_group(out);
        for (std::int64_t i = 0; i < groups_of(out.box, rows); ++i)
            read_group(out, rows, i, scratch_,
                       [this](std::int64_t position, std::byte* to, std::int64_t n) { fetch(position, to, n); });
    }
    order_bytes(out);
}

std::int64_t RawSource::position_of(Index3 voxel) const {
    Index3 const& dims = layout_.header.dims;
    return ((voxel.z * dims.y + voxel.y) * dims.x + voxel.x) * static_cast<std::int64_t>(size_of(layout_.header.dtype));
}

/// Threads that share the rows of a region: several only where all of them lie in one file.
int RawSource::threads_for(Box const& region) {
    if (!random_) return 1;
    std::int64_t const before = index_ * volume_bytes_, first = before + position_of(region.lower),
                       last = before + position_of(region.upper - Index3{1, 1, 1});
    if (first / share_ != last / share_) return 1;
    open(static_cast<std::size_t>(first / share_));
    return bytes_->threads_for(static_cast<std::size_t>(region.voxels()) * size_of(layout_.header.dtype));
}

/// Rows of a slice that are read together, with what lies between them.
std::int64_t RawSource::rows_of_group(AnyView const& out) const {
    Index3 const n = out.dims();
    auto const element = static_cast<std::int64_t>(size_of(out.type));
    std::int64_t const row = layout_.header.dims.x * element, wanted = n.x * element;
    if (wanted == row && out.row == n.x) return n.y; // one piece of the file and of memory
    // A stream has to be read through anyway.
    bool const together = !random_ || row - wanted <= cheap_gap;
    return together ? std::clamp<std::int64_t>(piece / row, 1, n.y) : 1;
}
std::int64_t RawSource::groups_of(Box const& region, std::int64_t rows) {
    Index3 const n = region.dims();
    return (n.y + rows - 1) / rows * n.z;
}

/// Group i of a region's rows; fetch(position, to, bytes) reads.
template <class Fetch>
void RawSource::read_group(AnyView const& out, std::int64_t rows, std::int64_t i, std::vector<std::byte>& scratch,
                           Fetch const& fetch) const {
    auto const element = static_cast<std::int64_t>(size_of(out.type));
    Box const& box = out.box;
    std::int64_t const row = layout_.header.dims.x * element, wanted = box.dims().x * element,
                       in_slice = groups_of({{}, {1, box.dims().y, 1}}, rows), z = box.lower.z + i / in_slice,
                       y = box.lower.y + i % in_slice * rows, count = std::min(rows, box.upper.y - y);
    std::int64_t const position = position_of({box.lower.x, y, z});
    if (count == 1 || (wanted == row && out.row == box.dims().x)) {
        fetch(position, out.at(box.lower.x, y, z), count * wanted);
        return;
    }
    std::int64_t const span = (count - 1) * row + wanted;
    if (std::ssize(scratch) < span) scratch.resize(static_cast<std::size_t>(span));
    fetch(position, scratch.data(), span);
    for (std::int64_t k = 0; k < count; ++k)
        std::memcpy(out.at(box.lower.x, y + k, z), scratch.data() + k * row, static_cast<std::size_t>(wanted));
}

/// One processor copies out of the page cache more slowly than memory could give.
void RawSource::read_groups_together(AnyView const& out, int threads) const {
    std::int64_t const rows = rows_of_group(out), groups = groups_of(out.box, rows), before = index_ * volume_bytes_;
    FirstFailure failure;
#pragma omp parallel num_threads(threads)
    {
        std::vector<std::byte> scratch;
#pragma omp for schedule(static)
        for (std::int64_t i = 0; i < groups; ++i)
            failure.catch_from([&] {
                read_group(out, rows, i, scratch, [&](std::int64_t position, std::byte* to, std::int64_t n) {
                    bytes_->read_at(offset_ + (before + position) % share_, to, static_cast<std::size_t>(n));
                });
            });
    }
    failure.rethrow();
}

void RawSource::order_bytes(AnyView const& out) const {
    std::size_t const size = size_of(out.type);
    bool const native = layout_.big_endian == (std::endian::native == std::endian::big);
    if (size == 1 || native || layout_.encoding == Encoding::text) return;
    for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; ++z)
        for (std::int64_t y = out.box.lower.y; y < out.box.upper.y; ++y)
            swap_bytes(out.at(out.box.lower.x, y, z), static_cast<std::size_t>(out.dims().x), size);
}

/// The same as seen from the directory of that name, which may be a link's.
std::string beside_name(std::string const& header_name, std::string const& file, bool trusted) {
    namespace fs = std::filesystem;
    std::size_t const slash = header_name.rfind('/');
    std::string const folder = slash == std::string::npos ? "" : header_name.substr(0, slash + 1);
    std::string path = file.starts_with('/') ? file : folder + file;
    if (trusted) return path;
    auto const refuse = [&](char const* what) {
        throw Error(ErrorKind::data, text("'", header_name, "' names '", file.substr(0, 200), "', which ", what),
                    "if you know what it is and trust the header: --trust-paths");
    };
    if (file.starts_with('/')) refuse("is an absolute path, not a file beside it");
    std::error_code error;
    fs::file_status const itself = fs::symlink_status(path, error);
    // A plain name of a plain file cannot lead anywhere else; everything else is followed to its end.
    bool const plain = file.find('/') == std::string::npos && file != "..";
    if (!plain || itself.type() == fs::file_type::symlink) {
        fs::path const home = fs::weakly_canonical(folder.empty() ? "." : fs::path(folder).parent_path(), error);
        fs::path const end = error ? fs::path() : fs::weakly_canonical(path, error);
        if (error || std::mismatch(home.begin(), home.end(), end.begin(), end.end()).first != home.end())
            refuse("leads out of its directory");
    }
    if (fs::exists(itself) && !fs::is_regular_file(path, error)) refuse("is no regular file");
    return path;
}

} // namespace

std::unique_ptr<Source> raw_source(std::unique_ptr<ByteSource> bytes, RawLayout layout) {
    mark_as_given(layout.header);
    Components const components = layout.components;
    std::int64_t& width = layout.header.dims.x;
    if (components.count < 1 || __builtin_mul_overflow(width, components.count, &width) || width > max_extent)
        throw Error(ErrorKind::data, text("'", bytes->name(), "': rows of more values than can be"));
    auto wide = std::make_unique<RawSource>(std::move(bytes), std::move(layout));
    if (components.count == 1) return wide;
    return component_source(std::move(wide), components);
}

void swap_bytes(std::byte* data, std::size_t n, std::size_t size) {
    if (size == 2) swap_all<2>(data, n);
    if (size == 4) swap_all<4>(data, n);
    if (size == 8) swap_all<8>(data, n);
}

std::string beside(std::string const& header_name, std::string const& file, bool trusted) {
    if (std::string const real = where_linked(header_name); !real.empty()) {
        std::string const path = beside_name(real, file, true);
        std::error_code error;
        if (std::filesystem::exists(path, error)) return beside_name(real, file, trusted);
    }
    return beside_name(header_name, file, trusted);
}

std::string where_linked(std::string const& path) {
    std::error_code error;
    if (!std::filesystem::is_symlink(path, error)) return {};
    std::string real = std::filesystem::canonical(path, error).string();
    return error ? std::string() : real;
}

} // namespace vkt
