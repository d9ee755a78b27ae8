// Spools.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/spool.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/cut.h"
#include "libvkt/engine/window.h"
#include "libvkt/io/free_space.h"
#include "libvkt/kernel/border.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <unistd.h>
#include <utility>

namespace vkt {

namespace {

constexpr char hint_of_full_disk[] = "set TMPDIR to a larger file system, or raise --memory";

/// One volume that was spooled.
class SpoolSource : public Source {
public:
    SpoolSource(std::unique_ptr<Spool> spool, Header const& header) : spool_(std::move(spool)), header_(header) {}

    bool next_volume() override { return false; }
    Header const& header() const override { return header_; }
    Access access() const override { return Access::random; }
    void read(AnyView out) override { spool_->read(out); }
    std::optional<ConstView> borrow(Box const& region) override { return spool_->borrow(region); }
    Space space() const override { return spool_->space(); }
    void finish() override {}

private:
    std::unique_ptr<Spool> spool_;
    Header header_;
};

} // namespace

Spool::Spool(Header const& header, std::size_t in_memory, Execution const& execution, StageInfo const& info,
             Space space)
    : Spool(header) {
    std::size_t const bytes = header_.bytes();
    if (bytes <= in_memory) {
        memory_.reserve(bytes);
        std::byte* const memory = space == Space::device ? memory_on_gpu() : nullptr;
        voxels_ = memory != nullptr ? dense_view(memory, header_.dtype, box_of(header_.dims), Space::device)
                                    : dense_view(memory_.write(Space::host), header_.dtype, box_of(header_.dims));
        return;
    }
    open_file(execution.temporary_directory);
    require_space(file_, bytes, text("cannot spool to ", directory_), hint_of_full_disk);
    if (info.listener)
        info.listener(info.name,
                      text("spooling ", bytes_text(static_cast<double>(bytes)), " to ", directory_, " (--memory is ",
                           bytes_text(static_cast<double>(execution.memory)), ")"),
                      false);
}

std::byte* Spool::memory_on_gpu() {
    try {
        return memory_.write(Space::device);
    } catch (Error const&) { // there is no room: others use the GPU, too
        return nullptr;
    }
}

void Spool::fill(Source& source, Execution const& execution) {
    Box const whole = box_of(header_.dims);
    source.expect(whole);
    for_each_piece(whole, cut_of(header_, source.natural_slab(), execution), [&](Box const& box) {
        ProgressPart const share = part_of(execution.monitor, whole, box);
        if (file_ >= 0) {
            auto const lent = source.borrow(box);
            if (lent && lent->space == Space::host && lent->contiguous()) return store(*lent);
        }
        AnyView const to = place(box);
        if (to.space == Space::device)
            read_across(source, to, staging_, execution);
        else
            source.read(to);
        store(to);
    });
    source.finish();
}

AnyView Spool::place(Box const& box) {
    if (file_ < 0) return voxels_.part(box);
    staging_.reserve(static_cast<std::size_t>(box.voxels()) * size_of(header_.dtype));
    return dense_view(staging_.write(Space::host), header_.dtype, box);
}

AnyView Spool::take(Box const& box) {
    AnyView const voxels = place(box);
    if (file_ >= 0) read(voxels);
    return voxels;
}

/// Whole rows follow one another in the file, and so do slices if all their rows are there.
void Spool::store(ConstView voxels) {
    if (file_ < 0) return; // they are in their place
    Box const& box = voxels.box;
    if (box.dims().x < header_.dims.x) {
        auto const voxel = static_cast<std::int64_t>(size_of(header_.dtype));
        for_each_piece(box, {1, 1}, [&](Box const& row) {
            Index3 const p = row.lower;
            write(voxels.at(p.x, p.y, p.z), static_cast<std::size_t>(row.dims().x * voxel),
                  offset_of(p.y, p.z) + p.x * voxel);
        });
        return;
    }
    bool const together = box.dims().y == header_.dims.y;
    std::size_t const slices = together ? static_cast<std::size_t>(box.dims().z) : 1;
    std::size_t const bytes = static_cast<std::size_t>(box.dims().x * box.dims().y) * slices * size_of(header_.dtype);
    for (std::int64_t z = box.lower.z; z < box.upper.z; z += static_cast<std::int64_t>(slices))
        write(voxels.at(box.lower.x, box.lower.y, z), bytes, offset_of(box.lower.y, z));
}

Spool::~Spool() {
    if (file_ >= 0) ::close(file_);
}

void Spool::open_file(std::string const& directory) {
    directory_ = directory;
    file_ = ::open(directory.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (file_ >= 0) return;
    // File systems without O_TMPFILE: a private name that exists for an instant.
    std::string name = directory + "/.vkt-spool-XXXXXX";
    file_ = ::mkostemp(name.data(), O_CLOEXEC);
    if (file_ < 0)
        throw Error(ErrorKind::io, text("cannot spool to ", directory, ": ", std::strerror(errno)),
                    "set TMPDIR to a writable directory, or raise --memory");
    ::unlink(name.c_str());
}

std::int64_t Spool::offset_of(std::int64_t y, std::int64_t z) const {
    return (z * header_.dims.y + y) * header_.dims.x * static_cast<std::int64_t>(size_of(header_.dtype));
}

void Spool::write(std::byte const* data, std::size_t left, std::int64_t offset) {
    while (left > 0) {
        ssize_t const n = ::pwrite(file_, data, left, offset);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0)
            throw Error(ErrorKind::io, text("cannot spool to ", directory_, ": ", std::strerror(errno)),
                        hint_of_full_disk);
        data += n;
        left -= static_cast<std::size_t>(n);
        offset += n;
    }
}

std::optional<ConstView> Spool::borrow(Box const& region) const {
    if (file_ >= 0) return std::nullopt;
    return ConstView(voxels_).part(region);
}

void Spool::read(AnyView out) {
    if (file_ < 0) return copy_region(ConstView(voxels_).part(out.box), out, Execution{});
    Index3 const n = out.dims();
    bool const in_place = n.x == header_.dims.x && (out.row == n.x || n.y == 1);
    if (in_place) {
        std::size_t const bytes = static_cast<std::size_t>(n.x * n.y) * size_of(header_.dtype);
        for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; ++z)
            fetch(out.at(0, out.box.lower.y, z), bytes, offset_of(out.box.lower.y, z));
        return;
    }
    auto const voxel = static_cast<std::int64_t>(size_of(header_.dtype));
    std::int64_t const row = header_.dims.x * voxel;
    // What is worth a call of its own is left out.
    constexpr std::int64_t worth_a_call = 4096;
    if (row - n.x * voxel >= worth_a_call) {
        for_each_piece(out.box, {1, 1}, [&](Box const& part) {
            Index3 const p = part.lower;
            fetch(out.at(p.x, p.y, p.z), static_cast<std::size_t>(n.x * voxel), offset_of(p.y, p.z) + p.x * voxel);
        });
        return;
    }
    // Some whole rows at a time.
    constexpr std::int64_t together = std::int64_t{256} << 10;
    for_each_piece(out.box, {1, std::max<std::int64_t>(1, together / row)}, [&](Box const& part) {
        Box const rows{{0, part.lower.y, part.lower.z}, {header_.dims.x, part.upper.y, part.upper.z}};
        std::size_t const bytes = static_cast<std::size_t>(rows.voxels()) * size_of(header_.dtype);
        scratch_.reserve(bytes);
        std::byte* const data = scratch_.write(Space::host);
        fetch(data, bytes, offset_of(part.lower.y, part.lower.z));
        copy(ConstView(dense_view(data, header_.dtype, rows)).part(part), out.part(part));
    });
}

void Spool::fetch(std::byte* to, std::size_t left, std::int64_t offset) {
    while (left > 0) {
        ssize_t const got = ::pread(file_, to, left, offset);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0)
            throw Error(ErrorKind::io, text("cannot read the spool in ", directory_, ": ", std::strerror(errno)));
        to += got;
        left -= static_cast<std::size_t>(got);
        offset += got;
    }
}

namespace {

/// The cells of a tree one after another, as a volume.
Header row_of_cells(Header const& tree) {
    Header header;
    header.dims = {1, tree.cell_count, 1};
    header.dtype = tree.dtype;
    return header;
}

} // namespace

BrickSpool::BrickSpool(Header const& tree, BrickTable bricks, Execution const& execution, StageInfo const& info)
    : type_(tree.dtype), bricks_(std::move(bricks)), file_(row_of_cells(tree), 0, execution, info) {}

Box BrickSpool::place_of(std::size_t first, std::size_t count) const {
    return {{0, bricks_.offset(first), 0}, {1, bricks_.offset(first + count), 1}};
}

void BrickSpool::store(std::size_t first, std::size_t count, std::byte const* cells) {
    file_.store(dense_view(cells, type_, place_of(first, count)));
}

void BrickSpool::read(std::size_t first, std::size_t count, std::byte* to) {
    file_.read(dense_view(to, type_, place_of(first, count)));
}

BrickSequence spooled(BrickSequence bricks, std::size_t in_memory, Execution const& execution, StageInfo const& info) {
    if (bricks.order() == BrickOrder::any) return bricks;
    if (bricks.header().bytes() <= in_memory) return std::move(bricks).whole();
    auto const spool = std::make_shared<BrickSpool>(bricks.header(), bricks.bricks(), execution, info);
    std::size_t const all = bricks.bricks().size();
    for (std::size_t first = 0, n = 0; first < all; first += n) {
        n = bricks.group(first, bricks.group_bytes());
        spool->store(first, n, bricks.cells(first, n));
    }
    BrickSequence result(
        bricks.header(), bricks.bricks(),
        [spool](std::size_t first, std::size_t count, std::byte* to) { spool->read(first, count, to); });
    result.set_group_bytes(bricks.group_bytes());
    return result;
}

std::unique_ptr<Source> spooled(Source& source, std::size_t inputs, Execution const& execution, StageInfo const& info) {
    Header const header = source.header();
    Space const space = execution.device == Device::gpu ? source.space() : Space::host;
    auto spool = std::make_unique<Spool>(header, spool_limit(inputs, execution), execution, info, space);
    spool->fill(source, execution);
    return std::make_unique<SpoolSource>(std::move(spool), header);
}

} // namespace vkt
