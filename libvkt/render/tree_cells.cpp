// Macrocells of a brick tree: size, bricks, ranges.
// SPDX-License-Identifier: MIT
#include "libvkt/render/tree_cells.h"

#include "libvkt/amr/cells.h"
#include "libvkt/core/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace vkt::render {

namespace {

/// Macrocells [first, last] that a brick's domain meets, per axis.
struct Span {
    std::array<int, 3> first, last;
    std::int64_t count() const {
        std::int64_t n = 1;
        for (std::size_t a = 0; a < 3; ++a) n *= std::max(0, last[a] - first[a] + 1);
        return n;
    }
};

/// A hair more than what rounding does to positions.
constexpr double slack = 1.0 / 1024;

/// Of cells that weigh something in a box.
struct Values {
    float lowest = std::numeric_limits<float>::infinity(), highest = -std::numeric_limits<float>::infinity();
    bool missing = false, some = false;

    /// Those of a brick with cells so wide, in a box of finest cells that is larger by `more` on every side.
    template <class T>
    void add(T const* cells, Brick const& brick, Index3 w, double const* box, double const* size, double more) {
        Index3 first, last;
        for (int a = 0; a < 3; ++a) {
            // Cell i weighs something between the centres of its neighbours: lower + (i - 0.5) w and … (i + 1.5) w.
            double const lower = box[a] - static_cast<double>(brick.lower[a]);
            auto const width = static_cast<double>(w[a]), edge = static_cast<double>(brick.dims[a] - 1);
            first[a] = static_cast<std::int64_t>(std::clamp(std::ceil((lower - more) / width - 1.5), 0.0, edge + 1));
            last[a] =
                static_cast<std::int64_t>(std::clamp(std::floor((lower + size[a] + more) / width + 0.5), -1.0, edge));
            if (first[a] > last[a]) return;
        }
        some = true;
        float low = lowest, high = highest;
        for (std::int64_t z = first.z; z <= last.z; ++z)
            for (std::int64_t y = first.y; y <= last.y; ++y) {
                T const* const row = cells + (z * brick.dims.y + y) * brick.dims.x;
                for (std::int64_t x = first.x; x <= last.x; ++x) {
                    auto const v = static_cast<float>(row[x]);
                    low = v < low ? v : low;
                    high = v > high ? v : high;
                    missing = missing || !(v == v);
                }
            }
        lowest = low, highest = high;
    }
    /// A weighted mean passes its ends by a few roundings.
    void widen() {
        float const largest = std::max(std::abs(lowest), std::abs(highest));
        if (lowest <= highest) lowest -= 4e-7F * largest, highest += 4e-7F * largest;
    }
};

class Builder {
public:
    Builder(TreeSampler const& sampler, Box const& region, TreeCells& cells)
        : bricks_(sampler.volume().bricks()), dims_(sampler.volume().header().dims), cells_(cells) {
        bool some = false;
        Box bounds = region;
        for (Brick const& brick : bricks_) {
            Box const domain = domain_of(brick, dims_);
            Box whole;
            for (int a = 0; a < 3; ++a) {
                whole.lower[a] = domain.lower[a] >> 1;
                whole.upper[a] = (domain.upper[a] + 1) >> 1;
            }
            whole = intersect(whole, region);
            if (whole.empty()) continue;
            for (int a = 0; a < 3; ++a) {
                bounds.lower[a] = some ? std::min(bounds.lower[a], whole.lower[a]) : whole.lower[a];
                bounds.upper[a] = some ? std::max(bounds.upper[a], whole.upper[a]) : whole.upper[a];
            }
            some = true;
        }
        lower_ = bounds.lower, upper_ = bounds.upper;
        std::int64_t held = 0;
        for (Brick const& brick : bricks_) held += brick.cells();
        std::int64_t const most_cells = std::clamp<std::int64_t>(held / 64, 4096, std::int64_t{1} << 21);
        std::int64_t const most_names =
            std::clamp<std::int64_t>(held / 8, std::int64_t{1} << 18, std::int64_t{1} << 25);
        for (std::int64_t size = 8;; size *= 2) {
            place(size);
            if (counts_[0] > (1 << 20) || counts_[1] > (1 << 20) || counts_[2] > (1 << 20)) continue;
            if (static_cast<double>(counts_[0]) * static_cast<double>(counts_[1]) * static_cast<double>(counts_[2]) >
                static_cast<double>(most_cells))
                continue;
            std::int64_t names = 0;
            for (Brick const& brick : bricks_) names += span_of(brick).count();
            // Ever larger cubes end with one name for each brick.
            if (names <= most_names || names <= 8 * static_cast<std::int64_t>(bricks_.size())) break;
        }
    }

    void name_bricks() {
        CellGrid& grid = cells_.grid;
        grid.nx = static_cast<int>(counts_[0]), grid.ny = static_cast<int>(counts_[1]);
        grid.nz = static_cast<int>(counts_[2]);
        auto const n = static_cast<std::size_t>(counts_[0] * counts_[1] * counts_[2]);
        cells_.first.assign(n + 1, 0);
        for (Brick const& brick : bricks_) each(span_of(brick), [&](std::size_t i) { ++cells_.first[i + 1]; });
        for (std::size_t i = 0; i < n; ++i) cells_.first[i + 1] += cells_.first[i];
        cells_.bricks.resize(static_cast<std::size_t>(cells_.first[n]));
        std::vector<std::int64_t> next(cells_.first.begin(), cells_.first.end() - 1);
        for (std::size_t b = 0; b < bricks_.size(); ++b)
            each(span_of(bricks_[b]), [&](std::size_t i) {
                cells_.bricks[static_cast<std::size_t>(next[i]++)] = static_cast<std::int32_t>(b);
            });
    }

    /// Ranges over the cells that reach into each macrocell.
    template <class T> void find_ranges(TreeSampler const& sampler, int threads) {
        CellGrid& grid = cells_.grid;
        auto const n = static_cast<std::int64_t>(cells_.first.size()) - 1;
        grid.lowest.assign(static_cast<std::size_t>(n), std::numeric_limits<float>::infinity());
        grid.highest.assign(static_cast<std::size_t>(n), -std::numeric_limits<float>::infinity());
        grid.missing.assign(static_cast<std::size_t>(n), 0);
        auto const* const all = reinterpret_cast<T const*>(sampler.volume().buffer().read(Space::host));
#pragma omp parallel for num_threads(threads) schedule(dynamic, 64)
        for (std::int64_t i = 0; i < n; ++i) {
            auto const at = static_cast<std::size_t>(i);
            Index3 const cell{i % grid.nx, i / grid.nx % grid.ny, i / grid.nx / grid.ny};
            double covered = 0;
            for (std::int64_t k = cells_.first[at]; k < cells_.first[at + 1]; ++k) {
                auto const b = static_cast<std::size_t>(cells_.bricks[static_cast<std::size_t>(k)]);
                covered += add(all + sampler.volume().brick_offset(b), bricks_[b], cell, at);
            }
            if (cells_.first[at] == cells_.first[at + 1]) continue;
            if (covered < wanted(cell)) grid.missing[at] = 1; // the surface of a hole is one of what is there
            Values values{grid.lowest[at], grid.highest[at]};
            values.widen();
            grid.lowest[at] = values.lowest, grid.highest[at] = values.highest;
        }
    }

private:
    void place(std::int64_t size) {
        cells_.size = static_cast<double>(size);
        for (int a = 0; a < 3; ++a) {
            // Bricks begin at multiples of their edge, as macrocells then do.
            std::int64_t const from = lower_[a] / size * size;
            start_[a] = from;
            counts_[static_cast<std::size_t>(a)] = (upper_[a] - from + size - 1) / size;
        }
        cells_.origin = {static_cast<double>(start_.x), static_cast<double>(start_.y), static_cast<double>(start_.z)};
    }
    Span span_of(Brick const& brick) const {
        Box const domain = domain_of(brick, dims_);
        Span span;
        for (int a = 0; a < 3; ++a) {
            auto const i = static_cast<std::size_t>(a);
            auto const cell = [&](std::int64_t half, double more) {
                double const place = (0.5 * static_cast<double>(half) + more - static_cast<double>(start_[a]));
                return std::floor(std::clamp(place / cells_.size, -1.0, static_cast<double>(counts_[i])));
            };
            span.first[i] = static_cast<int>(std::max(0.0, cell(domain.lower[a], -slack)));
            span.last[i] =
                static_cast<int>(std::min(static_cast<double>(counts_[i] - 1), cell(domain.upper[a], slack)));
        }
        return span;
    }
    template <class Visit> void each(Span const& span, Visit const& visit) const {
        for (std::int64_t z = span.first[2]; z <= span.last[2]; ++z)
            for (std::int64_t y = span.first[1]; y <= span.last[1]; ++y)
                for (std::int64_t x = span.first[0]; x <= span.last[0]; ++x)
                    visit(static_cast<std::size_t>((z * counts_[1] + y) * counts_[0] + x));
    }
    /// Finest cells of a macrocell within the volume.
    double wanted(Index3 cell) const {
        double volume = 1;
        for (int a = 0; a < 3; ++a) volume *= overlap(0, dims_[a], cell, a);
        return volume;
    }
    /// How much of an axis of a macrocell lies in [from, to).
    double overlap(std::int64_t from, std::int64_t to, Index3 cell, int a) const {
        auto const size = static_cast<std::int64_t>(cells_.size);
        std::int64_t const lower = start_[a] + cell[a] * size;
        return static_cast<double>(std::max<std::int64_t>(0, std::min(to, lower + size) - std::max(from, lower)));
    }
    /// Adds a brick's cells to the range of a macrocell; returns how many finest cells of it they cover.
    template <class T> double add(T const* cells, Brick const& brick, Index3 cell, std::size_t at) {
        CellGrid& grid = cells_.grid;
        Index3 const w = cell_width(dims_, brick.level);
        double lower[3], covered = 1;
        for (int a = 0; a < 3; ++a) {
            lower[a] = static_cast<double>(start_[a]) + static_cast<double>(cell[a]) * cells_.size;
            covered *= overlap(brick.lower[a], brick.lower[a] + brick.dims[a] * w[a], cell, a);
        }
        Values values{grid.lowest[at], grid.highest[at]};
        double const size[3] = {cells_.size, cells_.size, cells_.size};
        values.add(cells, brick, w, lower, size, slack);
        grid.lowest[at] = values.lowest, grid.highest[at] = values.highest;
        if (values.missing) grid.missing[at] = 1;
        return covered;
    }

    BrickTable const& bricks_;
    Index3 dims_, lower_, upper_, start_;
    std::array<std::int64_t, 3> counts_{};
    TreeCells& cells_;
};

} // namespace

TreeCells make_tree_cells(TreeSampler const& sampler, LatticeType type, Box const& region, int threads) {
    TreeCells cells;
    Builder builder(sampler, region, cells);
    builder.name_bricks();
    with_lattice_type(type, [&]<class T>(T) { builder.template find_ranges<T>(sampler, threads); });
    return cells;
}

PartRange range_of_part(TreeSampler const& sampler, LatticeType type, TreeCells const& cells, Box const& part,
                        double more) {
    BrickTable const& bricks = sampler.volume().bricks();
    Index3 const dims = sampler.volume().header().dims;
    double lower[3], size[3];
    for (int a = 0; a < 3; ++a) {
        lower[a] = 0.5 * static_cast<double>(part.lower[a]);
        size[a] = 0.5 * static_cast<double>(part.dims()[a]);
    }
    auto const cell = [&](double place, double origin) {
        return static_cast<std::int64_t>(std::floor((place - origin) / cells.size));
    };
    auto const at = static_cast<std::size_t>(
        (cell(lower[2], cells.origin.z) * cells.grid.ny + cell(lower[1], cells.origin.y)) * cells.grid.nx +
        cell(lower[0], cells.origin.x));
    auto const widest = [&](Brick const& brick) {
        Index3 const w = cell_width(dims, brick.level);
        return std::max({w.x, w.y, w.z});
    };
    auto const named = [&](auto const& visit) {
        for (std::int64_t k = cells.first[at]; k < cells.first[at + 1]; ++k)
            visit(static_cast<std::size_t>(cells.bricks[static_cast<std::size_t>(k)]));
    };
    std::int64_t finest = std::numeric_limits<std::int64_t>::max();
    named([&](std::size_t b) { finest = std::min(finest, widest(bricks[b])); });
    Values values;
    std::int64_t width = std::numeric_limits<std::int64_t>::max(); // halves of finest cells are half of it
    with_lattice_type(type, [&]<class T>(T) {
        auto const* const all = reinterpret_cast<T const*>(sampler.volume().buffer().read(Space::host));
        named([&](std::size_t b) {
            values.some = false;
            double const margin = finest < widest(bricks[b]) ? more * static_cast<double>(finest) : 0;
            values.add(all + sampler.volume().brick_offset(b), bricks[b], cell_width(dims, bricks[b].level), lower,
                       size,
                       margin - slack); // where cells end they weigh nothing
            if (values.some) width = std::min(width, widest(bricks[b]));
        });
    });
    values.widen();
    return {values.lowest, values.highest, width};
}

} // namespace vkt::render
