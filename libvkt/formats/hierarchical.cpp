// Formats of hierarchical volumes: FLASH (HDF5), AMReX plotfiles, OpenVDB.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/amrex.h"
#include "libvkt/formats/flash.h"
#include "libvkt/formats/refusals.h"
#include "libvkt/formats/vdb.h"

#include <cstring>
#include <optional>

namespace vkt {

namespace {

/// What a file holds, as attributes: every variable with type and stated range, every level, the share of holes.
void describe(AmrListing const& listing, Header& header) {
    std::vector<std::string> names;
    for (AmrVariable const& variable : listing.variables) {
        names.push_back(variable.name);
        std::string range;
        if (variable.minimum && variable.maximum) range = text(", ", *variable.minimum, " to ", *variable.maximum);
        header.attributes[text("variable ", variable.name)] =
            text(variable.dtype, range, variable.extent.empty() ? "" : ", ", variable.extent);
    }
    header.attributes["variables"] = join(names, " ");
    if (listing.bricks.empty()) return;
    TreeSummary const summary = summarise(header.dims, listing.bricks);
    for (LevelSummary const& level : summary.levels)
        header.attributes[text("level ", level.level)] =
            text(level.bricks, " bricks, ", level.cells, " cells ", cell_width(header.dims, level.level),
                 " finest cells wide");
    header.attributes["holes"] = text(100 * summary.hole_share(), " %");
    header.attributes["format"] = listing.format;
}

/// One volume of a file, or the bricks of it that a region needs. Cells are read when somebody asks for them.
class TreeSource : public Source {
public:
    using Open = std::shared_ptr<AmrFile> (*)(std::shared_ptr<ByteSource const> bytes, std::size_t memory);

    TreeSource(std::unique_ptr<ByteSource> bytes, ReadOptions const& options, Open open)
        : bytes_(std::move(bytes)), open_(open), memory_(options.memory.value_or(default_memory())) {
        wanted_.variable = options.variable;
    }

    bool narrow(Roi const& roi, WorldRoi const& world_roi) override {
        wanted_.roi = roi;
        wanted_.world_roi = world_roi;
        return true;
    }

    bool next_volume() override {
        if (file_) return false;
        file_ = open_(bytes_, memory_);
        AmrListing const& listing = file_->listing();
        // Nobody said which of several variables: the header describes all of them, which is enough for who asks for no
        // cells (info); the others are told to choose.
        bool const open_choice = wanted_.variable.empty() && wanted_.roi.empty() && wanted_.world_roi.empty();
        if (open_choice && listing.variables.size() > 1) {
            header_ = listing.header;
            header_.kind = Kind::hierarchical;
            header_.dtype = listing.variables.front().dtype;
            describe(listing, header_);
            return true;
        }
        bricks_ = file_->read(wanted_, default_execution());
        header_ = bricks_->header();
        return true;
    }

    Header const& header() const override { return header_; }
    Access access() const override { return Access::random; }

    void read(AnyView) override {
        throw Error(ErrorKind::usage, text(bytes_->name(), ": a hierarchical volume has no voxels on one grid"),
                    "make it a grid first: vkt resample --cells 50M");
    }

    BrickSequence take_bricks() override {
        if (!bricks_) return file_->read(wanted_, default_execution());
        BrickSequence result = std::move(*bricks_);
        bricks_.reset();
        return result;
    }

    std::vector<std::string> not_read() const override { return file_->listing().not_read; }

    void finish() override {} // bricks come whole or not at all

private:
    std::shared_ptr<ByteSource const> bytes_;
    Open open_;
    std::size_t memory_;
    AmrReadOptions wanted_;
    Header header_;
    std::shared_ptr<AmrFile> file_;
    std::optional<BrickSequence> bricks_;
};

void require_seekable(ByteSource const& bytes, char const* what) {
    if (!bytes.seekable())
        throw Error(ErrorKind::usage, text("'", bytes.name(), "': ", what, " cannot be read from a pipe"),
                    "save it to a file first");
}

std::unique_ptr<Source> flash_source(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    require_seekable(*bytes, "HDF5 files");
    return std::make_unique<TreeSource>(std::move(bytes), options, static_cast<TreeSource::Open>(open_flash));
}

std::unique_ptr<Source> vdb_source(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    require_seekable(*bytes, "OpenVDB files");
    return std::make_unique<TreeSource>(std::move(bytes), options, static_cast<TreeSource::Open>(open_vdb));
}

std::unique_ptr<Source> amrex_source(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    return std::make_unique<TreeSource>(
        std::move(bytes), options,
        [](std::shared_ptr<ByteSource const> folder, std::size_t) { return open_amrex(folder->name()); });
}

bool begins_with(std::span<std::byte const> head, std::string_view magic) {
    return head.size() >= magic.size() && std::memcmp(head.data(), magic.data(), magic.size()) == 0;
}

/// Collects a volume, since OpenVDB needs all of it, and writes it under a name that appears when all is well.
class VdbSink : public Sink {
public:
    VdbSink(std::string const& path, WriteOptions const& options) : file_(path, options.force) {
        if (file_.in_place())
            throw Error(ErrorKind::usage, text("'", path, "': OpenVDB files cannot be written to a pipe"),
                        "name a file: -o out.vdb");
        background_ = options.background;
        memory_ = options.memory.value_or(default_memory());
        written_.prune = options.prune;
    }

    void begin(Header const& header) override {
        bool begun = volume_.has_value();
        refuse_series(begun, "an OpenVDB file", ".vdb");
        header_ = header;
        if (header.kind != Kind::structured) return;
        check_memory(header);
        volume_ = Volume(header);
    }
    AnyView acquire(Box const& slab) override { return volume_->mutable_view().part(slab); }
    void commit() override {}
    void put_bricks(BrickSequence bricks) override {
        // Cells narrower than a leaf become its voxels; wider ones are nodes.
        double voxels = 0;
        for (Brick const& brick : bricks.bricks())
            if (brick.level < 3) voxels += volume_of(bounds_of(brick, bricks.header().dims).dims());
        require_memory(bricks.header(), voxels);
        volume_ = std::move(bricks).whole();
    }

    void end() override {
        auto const attribute = [&](char const* name, std::string const& otherwise) {
            auto const found = header_.attributes.find(name);
            return found == header_.attributes.end() ? otherwise : found->second;
        };
        written_.background = background_ ? *background_ : stored_background(header_).value_or(0);
        written_.name = attribute("variable", "density");
        written_.grid_class = attribute("class", "");
        written_.shown = file_.path();
        write_vdb(*volume_, text("/dev/fd/", file_.descriptor()), written_);
    }
    void close() override { file_.commit(); }

private:
    /// Dense voxels, and OpenVDB's leaves of 8^3 cells of 4 bytes or 8 which they become.
    void check_memory(Header const& header) const {
        auto const padded = [](std::int64_t n) {
            std::int64_t const cells = (n + 7) / 8 * 8;
            return static_cast<double>(cells);
        };
        require_memory(header, padded(header.dims.x) * padded(header.dims.y) * padded(header.dims.z));
    }

    /// What comes in, and so many voxels in leaves.
    void require_memory(Header const& header, double voxels) const {
        double const cell = size_of(header.dtype) == 8 ? 8 : 4;
        double const bytes = static_cast<double>(header.bytes()) + voxels * cell;
        if (bytes <= static_cast<double>(memory_)) return;
        throw Error(ErrorKind::resources,
                    text("'", file_.path(), "': OpenVDB needs ", bytes_text(bytes),
                         " to write this volume, the budget is ", bytes_text(static_cast<double>(memory_))),
                    "raise --memory, or make the volume smaller with 'vkt crop' or 'vkt resample'");
    }

    OutputFile file_;
    VdbWriteOptions written_;
    std::optional<double> background_;
    std::size_t memory_ = 0;
    Header header_;
    std::optional<Volume> volume_;
};

std::unique_ptr<Sink> create_vdb(std::string const& path, WriteOptions const& options) {
    if (!built_with_openvdb())
        throw Error(ErrorKind::failure, text("'", path, "': this build has no OpenVDB"),
                    "build vkt with -DVKT_OPENVDB=ON and libopenvdb");
    return std::make_unique<VdbSink>(path, options);
}

} // namespace

Format flash_format() {
    return {"flash",      "FLASH plot files and checkpoints (HDF5): adaptive mesh refinement",
            {".flash"},   [](std::span<std::byte const> head) { return begins_with(head, "\x89HDF\r\n\x1a\n"); },
            flash_source, nullptr};
}

Format vdb_format() {
    return {"vdb",
            "OpenVDB grids",
            {".vdb"},
            [](std::span<std::byte const> head) { return begins_with(head, std::string_view(" BDV\0\0\0\0", 8)); },
            vdb_source,
            create_vdb};
}

Format amrex_format() {
    return {"amrex",     "AMReX plotfiles (directories): adaptive mesh refinement", {}, nullptr, amrex_source,
            create_amrex};
}

} // namespace vkt
