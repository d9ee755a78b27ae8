// Ghost cells of bricks.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/ghost.h"

#include "libvkt/amr/cells.h"

#include <algorithm>

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
    with_cell_type(out.type, [&]<class T>(T) {
        View<T> const to = out.as<T>();
        T const cell = store_cell<T>(value);
        for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; ++z)
            for (std::int64_t y = out.box.lower.y; y < out.box.upper.y; ++y)
                for (std::int64_t x = out.box.lower.x; x < out.box.upper.x; ++x) to(x, y, z) = cell;
    });
}

void copy_folded(ConstView from, AnyView out, Index3 n, Boundary boundary) {
    with_cell_type(out.type, [&]<class T>(T) {
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

GhostFiller::GhostFiller(Volume const& volume, BrickIndex const& index, std::span<tile::Source const> sources,
                         TileRule const& rule, InstructionSet instructions)
    : volume_(volume), index_(index), sources_(sources), rule_(rule), instructions_(instructions) {}

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
        Brick const& brick = volume_.bricks()[static_cast<std::size_t>(id)];
        return brick.level == lattice.level ? intersect(lattice_box(lattice, brick), out.box) : Box{};
    };
    for (std::int32_t const id : near_) held += own(id).voxels();
    if (held < out.box.voxels()) compute_box(sources_, near_, grid, rule_, out, workspace_, instructions_);
    for (std::int32_t const id : near_) {
        Box const part = own(id);
        if (part.empty()) continue;
        auto const b = static_cast<std::size_t>(id);
        Index3 const first = lattice_box(lattice, volume_.bricks()[b]).lower;
        copy(volume_.brick_view(b).moved_to(first).part(part), out.part(part));
    }
}

} // namespace vkt
