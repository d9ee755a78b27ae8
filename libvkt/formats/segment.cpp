// A segment is a head of 64 bytes, the header as streams have it, the bricks of a tree, and from a page of its own the
// voxels.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/segment.h"

#include "libvkt/amr/tree.h"
#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/cut.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/io/shared_memory.h"
#include "libvkt/kernel/border.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <ctime>
#include <span>
#include <utility>

#include <sys/stat.h>

namespace vkt {
namespace {

constexpr std::array<char, 8> magic{'V', 'K', 'T', 'S', 'H', 'M', '\r', '\n'};
constexpr std::uint32_t first_version = 1;
constexpr std::uint32_t packed_version = 2; ///< of trees: a PackingRecord and the words of the bricks, no BrickEntries
constexpr std::uint32_t state_whole = 0x454c4857; ///< "WHLE", written when everything else is there
constexpr std::uint64_t largest_text = std::uint64_t{256} << 20, most_bricks = std::uint64_t{1} << 32;

/// The first 64 bytes, in the byte order of the machine.
struct SegmentHead {
    std::array<char, 8> magic{};
    std::uint32_t version = 0, state = 0;
    std::uint64_t text_bytes = 0;  ///< of the header, JSON, behind this head
    std::uint64_t brick_count = 0; ///< BrickEntries or what stands for them follow from the next multiple of 64
    std::uint64_t voxel_offset = 0, voxel_bytes = 0;
    std::uint64_t total_bytes = 0; ///< of the segment
    std::uint64_t reserved = 0;
};
static_assert(sizeof(SegmentHead) == 64);

struct BrickEntry {
    std::int64_t lower[3] = {};
    std::int32_t dims[3] = {};
    std::int32_t level = 0;
};
static_assert(sizeof(BrickEntry) == 40);

constexpr std::uint64_t rounded(std::uint64_t bytes, std::uint64_t unit) { return (bytes + unit - 1) / unit * unit; }

/// Where what follows the head lies, for counts within the limits above.
std::uint64_t bricks_at(SegmentHead const& head) { return rounded(sizeof(SegmentHead) + head.text_bytes, 64); }
std::uint64_t voxels_at(SegmentHead const& head, std::uint64_t words) {
    std::uint64_t const table = head.version == packed_version
                                    ? sizeof(PackingRecord) + head.brick_count * words * sizeof(std::uint32_t)
                                    : head.brick_count * sizeof(BrickEntry);
    return rounded(bricks_at(head) + table, 4096);
}

/// What stands before the voxels.
struct Contents {
    Header header;
    BrickTable bricks; ///< of a tree
    std::size_t voxel_offset = 0, total_bytes = 0;
};

[[noreturn]] void refuse(std::string const& name, char const* why) {
    throw Error(ErrorKind::data, text("'", name, "' ", why), text("free it: vkt shm remove ", name));
}

SegmentHead read_head(ByteSource const& bytes) {
    SegmentHead head;
    if (bytes.size() < static_cast<std::int64_t>(sizeof head)) refuse(bytes.name(), "is no volume: it is too short");
    bytes.read_at(0, &head, sizeof head);
    if (head.magic != magic) refuse(bytes.name(), "is no volume");
    if (head.version != first_version && head.version != packed_version)
        refuse(bytes.name(), "was written by another version of vkt");
    return head;
}

/// Of a packed table, if there is one; nothing that it says is proven.
PackingRecord read_packing(ByteSource const& bytes, SegmentHead const& head) {
    PackingRecord record;
    std::uint64_t const at = bricks_at(head);
    if (head.version != packed_version) return record;
    if (at + sizeof record > head.total_bytes) refuse(bytes.name(), "is damaged: its sizes contradict one another");
    bytes.read_at(static_cast<std::int64_t>(at), &record, sizeof record);
    return record;
}

BrickTable read_numbers(ByteSource const& bytes, SegmentHead const& head, Header const& header) {
    PackingRecord const record = read_packing(bytes, head);
    auto const packing = BrickPacking::of_record(record, header);
    if (!packing) refuse(bytes.name(), "is damaged: its bricks are packed in an impossible way");
    std::vector<std::uint32_t> words(head.brick_count * packing->words());
    bytes.read_at(static_cast<std::int64_t>(bricks_at(head) + sizeof record), words.data(),
                  words.size() * sizeof(std::uint32_t));
    try {
        return table_of_numbers(*packing, std::move(words), header);
    } catch (Error const& error) {
        refuse(bytes.name(), text("is damaged: ", error.what()).c_str());
    }
}

BrickTable read_bricks(ByteSource const& bytes, SegmentHead const& head, Header const& header) {
    if (head.version == packed_version) return read_numbers(bytes, head, header);
    std::vector<BrickEntry> entries(head.brick_count);
    bytes.read_at(static_cast<std::int64_t>(bricks_at(head)), entries.data(), entries.size() * sizeof(BrickEntry));
    std::vector<Brick> bricks;
    bricks.reserve(entries.size());
    std::int64_t left = header.cell_count;
    for (auto const& e : entries) {
        bool const possible = e.dims[0] > 0 && e.dims[1] > 0 && e.dims[2] > 0 && e.level >= 0 &&
                              e.level < header.level_count &&
                              static_cast<double>(e.dims[0]) * e.dims[1] * e.dims[2] <= static_cast<double>(left);
        if (!possible) refuse(bytes.name(), "is damaged: it has an impossible brick");
        bricks.push_back({{e.lower[0], e.lower[1], e.lower[2]}, {e.dims[0], e.dims[1], e.dims[2]}, e.level});
        left -= bricks.back().cells();
    }
    if (left != 0) refuse(bytes.name(), "is damaged: bricks are missing");
    return {header.dims, std::move(bricks)};
}

/// Everything is proven before the voxels are mapped: that they are there, in memory of their own. A segment of fewer
/// pages than bytes would be filled in when it is read, or could not be, which is a fault.
Contents read_contents(ByteSource const& bytes) {
    SegmentHead const head = read_head(bytes);
    if (head.state != state_whole) refuse(bytes.name(), "is unfinished: its writer never came to the end");
    struct stat status {};
    auto const size = static_cast<std::uint64_t>(bytes.size());
    bool const sane = head.text_bytes <= largest_text && head.brick_count <= most_bricks && head.total_bytes == size &&
                      head.voxel_bytes < size && read_packing(bytes, head).words <= 2 &&
                      head.voxel_offset == voxels_at(head, read_packing(bytes, head).words) &&
                      head.voxel_offset + head.voxel_bytes == size && ::fstat(bytes.descriptor(), &status) == 0;
    if (!sane) refuse(bytes.name(), "is damaged: its sizes contradict one another");
    if (static_cast<std::uint64_t>(status.st_blocks) * 512 < size)
        refuse(bytes.name(), "is damaged: pages are missing");
    std::string json(head.text_bytes, ' ');
    bytes.read_at(sizeof head, json.data(), json.size());
    Contents contents;
    contents.header = header_from_json(json);
    Header& header = contents.header;
    header.timing = header.dry_run = false; // of the pipeline that wrote it
    bool const tree = header.kind == Kind::hierarchical;
    if (head.voxel_bytes != header.bytes() ||
        head.brick_count != (tree ? static_cast<std::uint64_t>(header.brick_count) : 0) ||
        (head.version == packed_version && !tree))
        refuse(bytes.name(), "is damaged: its sizes are not those of its header");
    if (tree) contents.bricks = read_bricks(bytes, head, header);
    contents.voxel_offset = head.voxel_offset;
    contents.total_bytes = head.total_bytes;
    return contents;
}

/// Lends the voxels where they lie. Names may be freed or given to another segment meanwhile: this one stays.
class SegmentSource : public Source {
public:
    explicit SegmentSource(std::unique_ptr<ByteSource> bytes) : bytes_(std::move(bytes)) {}

    bool next_volume() override {
        if (std::exchange(opened_, true)) return false;
        contents_ = read_contents(*bytes_);
        return true;
    }
    Header const& header() const override { return contents_.header; }
    Access access() const override { return Access::random; }
    void read(AnyView out) override { copy_region(view().part(out.box), out, {}); }
    std::optional<ConstView> borrow(Box const& region) override {
        if (header().kind != Kind::structured) return std::nullopt;
        return view().part(region);
    }
    BrickSequence take_bricks() override { return Volume(header(), contents_.bricks, own_voxels()); }
    std::optional<Volume> take_whole() override { return Volume(header(), own_voxels()); }
    void finish() override {}

private:
    ConstView view() {
        if (header().kind != Kind::structured)
            throw Error(ErrorKind::usage, text(bytes_->name(), ": a hierarchical volume has no voxels on one grid"),
                        "make it a grid first: vkt resample --cells 50M");
        if (!mapping_) mapping_ = map(SharedMapping::Rights::read);
        return dense_view<std::byte const>(mapping_->data() + contents_.voxel_offset, header().dtype,
                                           box_of(header().dims));
    }
    /// For who may write to them: the pages that are written to become its own.
    Buffer own_voxels() const {
        std::shared_ptr<SharedMapping> mapping = map(SharedMapping::Rights::copy_on_write);
        std::byte* const voxels = mapping->data() + contents_.voxel_offset;
        return Buffer::adopt(voxels, header().bytes(), std::move(mapping));
    }
    std::unique_ptr<SharedMapping> map(SharedMapping::Rights rights) const {
        return std::make_unique<SharedMapping>(bytes_->descriptor(), contents_.total_bytes, rights);
    }

    std::unique_ptr<ByteSource> bytes_;
    Contents contents_;
    std::unique_ptr<SharedMapping> mapping_;
    bool opened_ = false;
};

/// Lends the memory of the segment itself. It gets its name when the volume is whole.
class SegmentSink : public Sink {
public:
    SegmentSink(std::string const& path, WriteOptions const& options)
        : file_(path, options.force, OutputKind::segment) {}

    void begin(Header const& header) override {
        if (begun_)
            throw Error(ErrorKind::usage, text("'", file_.path(), "': a segment holds one volume"),
                        text("name one for each: ", file_.path(), "_%04d"));
        begun_ = true;
        check(header);
        header_ = in_utf8(header);
        header_.timing = false;
        order_ = PieceOrder(header_.dims);
        if (header_.kind == Kind::structured) lay_out({});
    }
    AnyView acquire(Box const& slab) override {
        if (!mapping_ || acquired_ || !order_.takes(slab))
            throw Error(ErrorKind::failure, text("slab ", slab, " is out of order"));
        acquired_ = true;
        order_.advance(slab);
        Index3 const n = header_.dims;
        std::int64_t const first = n.x * (slab.lower.y + n.y * slab.lower.z);
        return dense_view(voxels_ + static_cast<std::size_t>(first) * size_of(header_.dtype), header_.dtype, slab);
    }
    void commit() override { acquired_ = false; }
    void put_bricks(BrickSequence sequence) override {
        header_ = with_counts(header_, sequence.bricks());
        lay_out(sequence.bricks());
        auto const& bricks = sequence.bricks();
        std::byte* to = voxels_;
        for (std::size_t first = 0, count = 0; first < bricks.size(); first += count) {
            count = sequence.group(first, sequence.group_bytes());
            sequence.read(first, count, to);
            to += static_cast<std::size_t>(bricks.cells(first, count)) * size_of(header_.dtype);
        }
    }
    void end() override {
        if (acquired_ || (header_.kind == Kind::structured && !order_.complete()))
            throw Error(ErrorKind::failure,
                        text("the volume ended after ", order_.slices(), " of ", header_.dims.z, " slices"));
        ended_ = true;
    }
    void close() override {
        if (!ended_) throw Error(ErrorKind::data, "there is no volume to write");
        auto& state = reinterpret_cast<SegmentHead*>(mapping_->data())->state;
        std::atomic_ref(state).store(state_whole, std::memory_order_release);
        mapping_.reset();
        file_.commit();
    }

private:
    /// Takes the memory, and writes all but the voxels.
    void lay_out(BrickTable const& bricks) {
        std::string const json = to_json(header_);
        PackingRecord const packing = bricks.packing_for(header_);
        SegmentHead head{magic, packing.words > 0 ? packed_version : first_version};
        head.text_bytes = json.size();
        head.brick_count = bricks.size();
        head.voxel_offset = voxels_at(head, packing.words);
        head.voxel_bytes = header_.bytes();
        head.total_bytes = head.voxel_offset + head.voxel_bytes;
        allocate_segment(file_.descriptor(), head.total_bytes, file_.path());
        mapping_ = std::make_unique<SharedMapping>(file_.descriptor(), head.total_bytes, SharedMapping::Rights::write);
        std::byte* const begin = mapping_->data();
        std::memcpy(begin, &head, sizeof head);
        std::memcpy(begin + sizeof head, json.data(), json.size());
        write_table(bricks, packing, begin + bricks_at(head));
        voxels_ = begin + head.voxel_offset;
    }
    static void write_table(BrickTable const& bricks, PackingRecord const& packing, std::byte* to) {
        if (packing.words > 0) {
            std::memcpy(to, &packing, sizeof packing);
            std::memcpy(to + sizeof packing, bricks.words().data(), bricks.words().size_bytes());
            return;
        }
        auto* entry = reinterpret_cast<BrickEntry*>(to);
        for (Brick const& b : bricks)
            *entry++ = {{b.lower.x, b.lower.y, b.lower.z},
                        {static_cast<std::int32_t>(b.dims.x), static_cast<std::int32_t>(b.dims.y),
                         static_cast<std::int32_t>(b.dims.z)},
                        b.level};
    }

    OutputFile file_;
    Header header_;
    PieceOrder order_;
    std::unique_ptr<SharedMapping> mapping_;
    std::byte* voxels_ = nullptr;
    bool begun_ = false, acquired_ = false, ended_ = false;
};

std::unique_ptr<Source> open_volume_segment(std::unique_ptr<ByteSource> bytes, ReadOptions const&) {
    if (!is_segment(bytes->name()))
        throw Error(ErrorKind::usage, text("'", bytes->name(), "' is no segment of shared memory"),
                    "segments are named shm:NAME");
    return std::make_unique<SegmentSource>(std::move(bytes));
}

std::unique_ptr<Sink> create_volume_segment(std::string const& path, WriteOptions const& options) {
    if (!is_segment(path))
        throw Error(ErrorKind::usage, text("'", path, "' is no segment of shared memory"),
                    "segments are named shm:NAME");
    if (options.compress) throw Error(ErrorKind::usage, "--compress: segments of shared memory are not compressed");
    return std::make_unique<SegmentSink>(path, options);
}

SegmentSummary summary_of(std::string const& name) {
    SegmentSummary summary;
    summary.name = name;
    struct stat status {};
    if (::lstat(segment_file(name).c_str(), &status) == 0) {
        summary.bytes = static_cast<std::int64_t>(status.st_blocks) * 512;
        summary.age = std::max<std::int64_t>(0, std::time(nullptr) - status.st_mtime);
    }
    try {
        auto const bytes = open_bytes(name);
        if (read_head(*bytes).state != state_whole)
            summary.state = SegmentSummary::State::unfinished;
        else
            summary.header = read_contents(*bytes).header;
        if (summary.header) summary.state = SegmentSummary::State::whole;
    } catch (Error const&) { // damaged, as it was from the start
    }
    return summary;
}

} // namespace

std::vector<SegmentSummary> list_segments() { return collect(segments(), summary_of); }

Format segment_format() {
    return {"shm", "segments of shared memory, shm:NAME", {}, nullptr, open_volume_segment, create_volume_segment};
}

} // namespace vkt
