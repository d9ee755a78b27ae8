// Ghost cells of bricks.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/ghost.h"

#include "libvkt/amr/cells.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <array>

namespace vkt {

namespace {

/// Neighbouring indices of an axis whose folded places are neighbours too, so that one box of sources serves them.
struct Segment {
    std::int64_t begin, end;   ///< indices
    std::int64_t lower, upper; ///< places they fold to
    bool border;               ///< they stand for the border value
};

std::vector<Segment> segments(std::int64_t begin, std::int64_t end, std::int64_t n, Boundary boundary) {
    std::vector<Segment> list;
    std::int64_t previous = 0;
    for (std::int64_t i = begin; i < end; ++i) {
        std::int64_t const place = fold(i, n, boundary);
        bool const border = place < 0;
        bool const continues =
            !list.empty() && list.back().border == border && (border || std::abs(place - previous) <= 1);
        if (!continues) list.push_back({i, i, place, place, border});
        Segment& segment = list.back();
        segment.end = i + 1;
        segment.lower = std::min(segment.lower, place);
        segment.upper = std::max(segment.upper, place + 1);
        previous = place;
    }
    return list;
}

void fill_value(AnyView out, double value) {
    with_type(out.type, [&]<class T>(T) {
        View<T> const to = out.as<T>();
        T const cell = store_cell<T>(value);
        for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; ++z)
            for (std::int64_t y = out.box.lower.y; y < out.box.upper.y; ++y)
                for (std::int64_t x = out.box.lower.x; x < out.box.upper.x; ++x) to(x, y, z) = cell;
    });
}

void copy_folded(ConstView from, AnyView out, Index3 n, Boundary boundary) {
    with_type(out.type, [&]<class T>(T) {
        View<T> const to = out.as<T>();
        View<T const> const source = from.as<T>();
        for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; ++z)
            for (std::int64_t y = out.box.lower.y; y < out.box.upper.y; ++y) {
                std::int64_t const sz = fold(z, n.z, boundary), sy = fold(y, n.y, boundary);
                for (std::int64_t x = out.box.lower.x; x < out.box.upper.x; ++x)
                    to(x, y, z) = source(fold(x, n.x, boundary), sy, sz);
            }
    });
}

} // namespace

LevelLattice lattice_of(Index3 logical_dims, Brick const& any) {
    LevelLattice lattice;
    lattice.level = any.level;
    lattice.width = cell_width(logical_dims, any.level);
    for (int a = 0; a < 3; ++a) {
        std::int64_t const w = lattice.width[a];
        lattice.lower[a] =
            any.lower[a] % w == 0 ? 0 : any.lower[a] % w - w; // the first cell may begin outside the grid
        lattice.dims[a] = (logical_dims[a] - lattice.lower[a] + w - 1) / w;
    }
    return lattice;
}

Box lattice_box(LevelLattice const& lattice, Brick const& brick) {
    Index3 lower;
    for (int a = 0; a < 3; ++a) lower[a] = (brick.lower[a] - lattice.lower[a]) / lattice.width[a];
    return {lower, lower + brick.dims};
}

void CellSurvey::add(BrickTable const& bricks, std::byte const* cells, Execution const& execution) {
    for (ValueRange const& range : brick_ranges(cells, type_, bricks, execution))
        range_ = united(std::array{range_, range});
    with_type(type_, [&]<class T>(T) {
        if constexpr (is_wide_cell<T>) {
            std::int64_t count = 0;
            for (Brick const& brick : bricks) count += brick.cells();
            if (count == 0) return;
            auto const* const values = reinterpret_cast<T const*>(cells);
            auto const [low, high] = std::minmax_element(values, values + count);
            T const least = any_ ? std::min(*low, static_cast<T>(least_)) : *low;
            T const most = any_ ? std::max(*high, static_cast<T>(most_)) : *high;
            least_ = static_cast<std::uint64_t>(least);
            most_ = static_cast<std::uint64_t>(most);
            any_ = true;
        }
    });
}

tile::Source CellSurvey::brick() const {
    tile::Source source;
    source.base = least_;
    source.far = most_ - least_ >= std::uint64_t{1} << 53;
    return source;
}

void BrickCells::want(std::span<std::int32_t const> ids) {
    if (bricks_.in_memory()) return;
    std::size_t const size = size_of(bricks_.header().dtype);
    auto const bytes_of = [&](std::int32_t id) {
        return static_cast<std::size_t>(bricks_.bricks()[static_cast<std::size_t>(id)].cells()) * size;
    };
    std::size_t wanted = 0;
    for (std::int32_t const id : ids) wanted += bytes_of(id);
    if (wanted > limit_)
        throw Error(ErrorKind::resources,
                    text("a brick and its neighbours take ", bytes_text(static_cast<double>(wanted)),
                         " of memory, and ", bytes_text(static_cast<double>(limit_)), " of the budget are for them"),
                    "raise --memory");
    for (std::int32_t const id : ids)
        if (auto const found = kept_.find(id); found != kept_.end())
            order_.splice(order_.begin(), order_, found->second.place);
    std::size_t missing = 0;
    for (std::int32_t const id : ids) missing += kept_.contains(id) ? 0 : bytes_of(id);
    while (held_ + missing > limit_) { // those that are wanted are before the others, and have room
        std::int32_t const oldest = order_.back();
        held_ -= bytes_of(oldest);
        kept_.erase(oldest);
        order_.pop_back();
    }
    for (std::int32_t const id : ids) {
        if (kept_.contains(id)) continue;
        Buffer cells(bytes_of(id));
        bricks_.read(static_cast<std::size_t>(id), 1, cells.write(Space::host));
        order_.push_front(id);
        kept_.emplace(id, Kept{std::move(cells), order_.begin()});
        held_ += bytes_of(id);
    }
}

std::byte const* BrickCells::of(std::int32_t id) {
    if (bricks_.in_memory()) return bricks_.cells(static_cast<std::size_t>(id), 1);
    return kept_.at(id).cells.read(Space::host);
}

GhostFiller::GhostFiller(BrickCells& cells, BrickIndex const& index, tile::Source const& like, TileRule const& rule,
                         InstructionSet instructions)
    : cells_(cells), bricks_(cells.bricks().bricks()), index_(index), like_(like), rule_(rule),
      instructions_(instructions) {}

void GhostFiller::fill(LevelLattice const& lattice, AnyView out, Boundary boundary, double border_value) {
    if (box_of(lattice.dims).contains(out.box)) return fill_inside(lattice, out);
    std::vector<Segment> axes[3];
    for (int a = 0; a < 3; ++a) axes[a] = segments(out.box.lower[a], out.box.upper[a], lattice.dims[a], boundary);
    for (Segment const& z : axes[2])
        for (Segment const& y : axes[1])
            for (Segment const& x : axes[0]) {
                AnyView const part = out.part({{x.begin, y.begin, z.begin}, {x.end, y.end, z.end}});
                if (x.border || y.border || z.border) {
                    fill_value(part, border_value);
                    continue;
                }
                Box const source{{x.lower, y.lower, z.lower}, {x.upper, y.upper, z.upper}};
                if (source == part.box) {
                    fill_inside(lattice, part);
                    continue;
                }
                folded_.resize(static_cast<std::size_t>(source.voxels()) * size_of(out.type));
                AnyView const held = dense_view(folded_.data(), out.type, source);
                fill_inside(lattice, held);
                copy_folded(held, part, lattice.dims, boundary);
            }
}

void GhostFiller::fill_inside(LevelLattice const& lattice, AnyView out) {
    SampleGrid grid;
    Vec3 lower, upper;
    for (int a = 0; a < 3; ++a) {
        grid.lower[a] = static_cast<double>(lattice.lower[a]);
        grid.step[a] = static_cast<double>(lattice.width[a]);
        lower[a] = static_cast<double>(lattice.lower[a] + out.box.lower[a] * lattice.width[a]);
        upper[a] = static_cast<double>(lattice.lower[a] + out.box.upper[a] * lattice.width[a]);
    }
    index_.query(lower, upper, near_);
    // Mostly the box lies among bricks of its own level: then nothing needs to be reconstructed.
    std::int64_t held = 0;
    auto const own = [&](std::int32_t id) {
        Brick const& brick = bricks_[static_cast<std::size_t>(id)];
        return brick.level == lattice.level ? intersect(lattice_box(lattice, brick), out.box) : Box{};
    };
    own_.clear();
    for (std::int32_t const id : near_) {
        std::int64_t const cells = own(id).voxels();
        if (cells > 0) own_.push_back(id);
        held += cells;
    }
    if (held < out.box.voxels()) {
        Index3 const dims = cells_.bricks().header().dims;
        std::erase_if(near_, [&](std::int32_t id) {
            return !domain_meets(bricks_[static_cast<std::size_t>(id)], dims, lower, upper);
        });
        cells_.want(near_); // all of its own as well
        reconstruct(grid, out);
    } else {
        cells_.want(own_);
    }
    for (std::int32_t const id : own_) {
        Box const part = own(id);
        Box const whole = lattice_box(lattice, bricks_[static_cast<std::size_t>(id)]);
        copy(dense_view(cells_.of(id), out.type, whole).part(part), out.part(part));
    }
}

/// From the bricks near by.
void GhostFiller::reconstruct(SampleGrid const& grid, AnyView out) {
    sources_.assign(near_.size(), like_);
    places_.resize(near_.size());
    for (std::size_t i = 0; i < near_.size(); ++i) {
        Brick const& brick = bricks_[static_cast<std::size_t>(near_[i])];
        place(sources_[i], brick, cell_width(cells_.bricks().header().dims, brick.level), cells_.of(near_[i]));
        places_[i] = static_cast<std::int32_t>(i);
    }
    compute_box(sources_, places_, grid, rule_, out, workspace_, instructions_);
}

} // namespace vkt
