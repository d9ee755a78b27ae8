// Bricks: their lattice, their attributes, and the source that cuts them.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/bricks/bricks.h"

#include "libvkt/engine/spool.h"
#include "libvkt/engine/window.h"

#include <utility>

namespace vkt {
namespace {

constexpr char whole_key[] = "brick-whole", core_key[] = "brick-core", ghost_key[] = "brick-ghost";

/// A layer of bricks, or one brick at a time, of each volume of a source.
class BrickSource : public Source {
public:
    /// `made_by`: the operation that the source is the result of, if it is one.
    BrickSource(std::unique_ptr<Operation> made_by, std::unique_ptr<Source> source, BrickOptions const& options,
                Execution execution, StageInfo info)
        : made_by_(std::move(made_by)), source_(std::move(source)), options_(options), execution_(std::move(execution)),
          info_(std::move(info)) {}

    bool next_volume() override;
    Header const& header() const override { return header_; }
    Access access() const override { return Access::random; }
    void read(AnyView out) override;
    std::optional<ConstView> borrow(Box const& region) override;
    void finish() override {} // the whole is finished after its last brick
    std::int64_t parts_to_come() const override { return lattice_.count() - next_; }

private:
    void begin_whole();
    void begin_brick();
    void hold_layer();
    /// A region of the current brick in the voxels of the source.
    Box in_source(Box const& region) const { return {region.lower + offset_, region.upper + offset_}; }

    std::unique_ptr<Operation> made_by_; ///< outlives the source
    std::unique_ptr<Source> source_;
    BrickOptions options_;
    Execution execution_;
    StageInfo info_;
    Header whole_;  ///< of the source's volume, with its margin
    Index3 margin_; ///< below the whole
    BrickLattice lattice_;
    std::int64_t next_ = 0; ///< brick
    bool open_ = false;     ///< within a volume
    bool layered_ = false;  ///< bricks come from the window
    bool spooled_ = false;  ///< … from the spool, once it is filled
    std::unique_ptr<Spool> spool_;
    Window window_;
    std::optional<ConstView> layer_;
    BrickPlace place_;
    Index3 offset_; ///< of the brick's first voxel, in the source
    Header header_;
};

bool BrickSource::next_volume() {
    if (open_ && next_ == lattice_.count()) {
        if (!spool_) source_->finish(); // a spool took all of it
        spool_.reset();
        open_ = false;
    }
    if (!open_) {
        if (!source_->next_volume()) return false;
        begin_whole();
    }
    begin_brick();
    return true;
}

void BrickSource::begin_whole() {
    whole_ = source_->header();
    if (whole_.kind != Kind::structured)
        throw Error(ErrorKind::usage, "the volume is hierarchical: it consists of bricks already",
                    "make a grid of it first: vkt resample --cells 50M");
    margin_ = options_.boundary ? options_.ghost.below : Index3{};
    lattice_ = {whole_.dims, options_.size.dims, options_.ghost, options_.boundary.has_value()};
    if (options_.boundary) lattice_.whole = whole_.dims - options_.ghost.below - options_.ghost.above;
    next_ = 0;
    open_ = true;
    layered_ = spooled_ = false;
    spool_.reset();
    layer_.reset();
    if (whole_.dry_run) return;
    source_->expect(box_of(whole_.dims));
    if (source_->access() == Access::random) return;
    std::int64_t const slices = lattice_.size.z + lattice_.ghost.below.z + lattice_.ghost.above.z;
    Index3 const layer{whole_.dims.x, whole_.dims.y, std::min(slices, whole_.dims.z)};
    std::size_t const bytes = static_cast<std::size_t>(box_of(layer).voxels()) * size_of(whole_.dtype);
    layered_ = bytes <= execution_.memory / 2;
    spooled_ = !layered_;
    window_.reset({whole_.dims, whole_.dtype, Boundary::clamp, 0, bytes});
}

void BrickSource::begin_brick() {
    place_ = lattice_.place(next_++);
    Box const stored = place_.stored();
    offset_ = stored.lower + margin_;
    header_ = whole_;
    header_.dims = stored.dims();
    header_.geometry = cropped(whole_.geometry, offset_);
    Part const outer = whole_.part.value_or(Part{lattice_.whole, {}, {}});
    header_.part = Part{outer.global_dims, outer.offset + stored.lower, options_.ghost.below};
    say_place(header_, place_);
    if (!info_.words.empty()) header_.history = folded(history_step(info_, {whole_}));
}

/// The slices of the current brick's layer.
void BrickSource::hold_layer() {
    Box layer = box_of(whole_.dims);
    layer.lower.z = offset_.z;
    layer.upper.z = offset_.z + header_.dims.z;
    if (!layer_ || !(layer_->box == layer)) layer_ = window_.fetch(*source_, layer, execution_);
}

std::optional<ConstView> BrickSource::borrow(Box const& region) {
    Box const box = in_source(region);
    std::optional<ConstView> lent;
    if (layered_) {
        hold_layer();
        lent = layer_->part(box);
    } else if (!spooled_) {
        lent = source_->borrow(box);
    } else if (spool_) {
        lent = spool_->borrow(box);
    }
    if (lent) lent = lent->moved_to(region.lower);
    return lent;
}

void BrickSource::read(AnyView out) {
    if (spooled_ && !spool_) {
        spool_ = std::make_unique<Spool>(whole_, 0, execution_, info_);
        spool_->fill(*source_, execution_);
    }
    AnyView const to = out.moved_to(out.box.lower + offset_);
    if (layered_) {
        hold_layer();
        copy(layer_->part(to.box), to);
    } else if (spool_) {
        spool_->read(to);
    } else {
        source_->read(to);
    }
}

/// "X0:X1,Y0:Y1,Z0:Z1" of whole numbers, as the attributes have it.
Box parse_box(std::string const& word) {
    auto const malformed = [&] { return Error(ErrorKind::data, text("'", word, "' is no region of voxels")); };
    std::vector<std::string> const ranges = split(word, ',');
    if (ranges.size() != 3) throw malformed();
    Box box;
    for (int axis = 0; axis < 3; ++axis) {
        std::vector<std::string> const ends = split(ranges[static_cast<std::size_t>(axis)], ':');
        if (ends.size() != 2) throw malformed();
        try {
            box.lower[axis] = parse_integer(ends[0]);
            box.upper[axis] = parse_integer(ends[1]);
        } catch (Error const&) {
            throw malformed();
        }
        for (std::int64_t const end : {box.lower[axis], box.upper[axis]})
            if (end < 0 || end > max_extent) throw malformed();
    }
    return box;
}

} // namespace

BrickSize ValueText<BrickSize>::read(std::vector<std::string> const& w, std::string_view name) {
    std::vector<std::string> parts = parts_of(w, name);
    if (parts.size() == 1) parts.resize(3, parts.front());
    if (parts.size() != 3)
        throw Error(ErrorKind::usage, text(name, ": '", w.front(), "' is not N or X,Y,Z"), "for example 64");
    BrickSize result;
    for (int axis = 0; axis < 3; ++axis) {
        std::string const& part = parts[static_cast<std::size_t>(axis)];
        std::int64_t const n = ValueText<std::int64_t>::read({part}, name);
        if (n < 1 || n > max_extent)
            throw Error(ErrorKind::usage, text(name, ": ", part, " is not a number of voxels from 1 on"));
        result.dims[axis] = n;
    }
    return result;
}

std::vector<std::string> ValueText<BrickSize>::write(BrickSize const& v) {
    return {text(v.dims.x, ",", v.dims.y, ",", v.dims.z)};
}

Index3 BrickLattice::counts() const {
    Index3 n;
    for (int axis = 0; axis < 3; ++axis) n[axis] = (whole[axis] - 1) / size[axis] + 1;
    return n;
}

BrickPlace BrickLattice::place(std::int64_t brick) const {
    Index3 const n = counts();
    Index3 const at{brick % n.x, brick / n.x % n.y, brick / n.x / n.y};
    BrickPlace place{whole, {}, ghost};
    for (int axis = 0; axis < 3; ++axis) {
        std::int64_t const lower = at[axis] * size[axis];
        std::int64_t const upper = lower + std::min(size[axis], whole[axis] - lower);
        place.core.lower[axis] = lower;
        place.core.upper[axis] = upper;
        if (filled) continue;
        place.ghost.below[axis] = std::min(ghost.below[axis], lower);
        place.ghost.above[axis] = std::min(ghost.above[axis], whole[axis] - upper);
    }
    return place;
}

void BrickOptions::declare(Parameters& p) {
    p.option("size", size, "N|X,Y,Z", "voxels of a brick, the last ones may have fewer (64)");
    p.option("ghost", ghost, "N|X,Y,Z", "voxels that a brick has of its neighbours, on every side (0)");
    p.option("boundary", boundary, "RULE",
             "ghosts also outside of the volume: mirror, clamp, wrap or border[:VALUE]; without it they end there");
}

void say_place(Header& header, BrickPlace const& place) {
    header.attributes[whole_key] = to_text(place.whole);
    header.attributes[core_key] = to_text(place.core);
    header.attributes[ghost_key] = ValueText<Padding>::write(place.ghost).front();
}

std::optional<BrickPlace> place_in(Header const& header) {
    auto const& said = header.attributes;
    std::size_t const keys = said.count(whole_key) + said.count(core_key) + said.count(ghost_key);
    if (keys == 0) return std::nullopt;
    if (keys < 3)
        throw Error(ErrorKind::data,
                    text("of the attributes ", whole_key, ", ", core_key, " and ", ghost_key, " one is missing"));
    BrickPlace place;
    std::vector<std::string> const extents = split(said.at(whole_key), ' ');
    if (extents.size() != 3) throw Error(ErrorKind::data, text(whole_key, ": '", said.at(whole_key), "' is no extent"));
    place.whole = parse_box(text("0:", extents[0], ",0:", extents[1], ",0:", extents[2])).upper;
    place.core = parse_box(said.at(core_key));
    Box const ghost = parse_box(said.at(ghost_key));
    place.ghost = {ghost.lower, ghost.upper};
    if (place.core.empty() || !box_of(place.whole).contains(place.core))
        throw Error(ErrorKind::data, text("the voxels ", place.core, " do not lie in a volume of ", place.whole));
    if (!(place.stored().dims() == header.dims))
        throw Error(ErrorKind::data, text("it has ", header.dims, " voxels, its place ", place.stored().dims()),
                    "what is done to a brick must keep its extent");
    return place;
}

Header without_place(Header header) {
    for (char const* const key : {whole_key, core_key, ghost_key}) header.attributes.erase(key);
    return header;
}

std::unique_ptr<Source> brick_source(std::unique_ptr<Source> source, BrickOptions const& options,
                                     Execution const& execution, StageInfo info) {
    std::unique_ptr<Pad> pad;
    if (options.boundary) {
        pad = std::make_unique<Pad>();
        pad->by = options.ghost;
        pad->boundary = *options.boundary;
        StageInfo silent = info;
        silent.words.clear(); // bricks say how they came about
        silent.on_plan = {};
        std::vector<std::unique_ptr<Source>> inputs;
        inputs.push_back(std::move(source));
        source = attach(std::move(inputs), *pad, execution, std::move(silent));
    }
    return std::make_unique<BrickSource>(std::move(pad), std::move(source), options, execution, std::move(info));
}

} // namespace vkt
