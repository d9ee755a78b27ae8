// One tile of a reconstruction: runs the kernels of the chosen method and stores samples in the volume's type.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/tile_output.h"

#include "libvkt/amr/cells.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace vkt {

struct TileMemory {
    tile::ScratchFloat single;
    tile::ScratchDouble wide;
    std::uint8_t averaged[tile::samples], inside[tile::samples];
    double high[tile::samples]; ///< of 64-bit integers, what comes of the upper halves
};

namespace {

void basis(tile::Job const& job, auto& scratch, [[maybe_unused]] InstructionSet instructions) {
#ifdef VKT_X86_BACKENDS
    if (instructions == InstructionSet::avx512) return avx512::basis_tile(job, scratch);
    if (instructions == InstructionSet::avx2) return avx2::basis_tile(job, scratch);
#endif
    baseline::basis_tile(job, scratch);
}

void average(tile::Job const& job, tile::ScratchDouble& scratch, [[maybe_unused]] InstructionSet instructions) {
#ifdef VKT_X86_BACKENDS
    if (instructions == InstructionSet::avx512) return avx512::average_tile(job, scratch);
    if (instructions == InstructionSet::avx2) return avx2::average_tile(job, scratch);
#endif
    baseline::average_tile(job, scratch);
}

/// Samples of the tile for which `below` fails and `inside` holds; both are monotone in the sample's index.
struct Span {
    int begin, end;
};

template <class Below, class Inside> Span span_of(int count, double estimate, Below below, Inside inside) {
    int begin = estimate <= 0 ? 0 : estimate >= count ? count : static_cast<int>(estimate);
    while (begin > 0 && !below(begin - 1)) --begin;
    while (begin < count && below(begin)) ++begin;
    int end = begin;
    while (end < count && inside(end)) ++end;
    return {begin, end};
}

/// The tile's samples that lie in the brick.
Span samples_inside(tile::Job const& job, tile::Source const& brick, int a) {
    double const lower = static_cast<double>(brick.lower[a]);
    double const upper = lower + static_cast<double>(brick.dims[a] * brick.width[a]);
    auto const position = [&](int i) {
        return job.lower[a] + (static_cast<double>(job.begin[a] + i) + 0.5) * job.step[a];
    };
    return span_of(
        job.count[a], (lower - position(0)) / job.step[a], [&](int i) { return position(i) < lower; },
        [&](int i) { return position(i) < upper; });
}

/// The tile's voxels that overlap the brick.
Span voxels_touched(tile::Job const& job, tile::Source const& brick, int a) {
    double const lower = static_cast<double>(brick.lower[a]);
    double const upper = lower + static_cast<double>(brick.dims[a] * brick.width[a]);
    auto const face = [&](int i) { return job.lower[a] + static_cast<double>(job.begin[a] + i) * job.step[a]; };
    return span_of(
        job.count[a], (lower - face(0)) / job.step[a], [&](int i) { return face(i + 1) <= lower; },
        [&](int i) { return face(i) < upper; });
}

/// Marks the samples of the tile that lie in a brick's span along each axis.
void mark(tile::Job const& job, tile::Source const& brick, Span (&span)(tile::Job const&, tile::Source const&, int),
          std::uint8_t* marks) {
    Span const x = span(job, brick, 0), y = span(job, brick, 1), z = span(job, brick, 2);
    if (x.begin >= x.end) return;
    for (int k = z.begin; k < z.end; ++k)
        for (int j = y.begin; j < y.end; ++j)
            std::memset(marks + (k * job.count[1] + j) * job.count[0] + x.begin, 1,
                        static_cast<std::size_t>(x.end - x.begin));
}

/// Marks the voxels that overlap bricks whose cells are at most half as wide, and if there are holes those whose
/// centres lie in one; returns how many.
int mark_averaged(tile::Job const& job, bool holes, TileMemory& work) {
    auto const n = std::size_t(1) * job.count[0] * job.count[1] * job.count[2];
    std::memset(work.averaged, 0, n);
    if (holes) std::memset(work.inside, 0, n);
    for (std::int64_t i = 0; i < job.id_count; ++i) {
        tile::Source const& brick = job.sources[job.ids[i]];
        bool covers_several = false;
        for (int a = 0; a < 3; ++a) covers_several |= job.step[a] >= 2 * static_cast<double>(brick.width[a]);
        if (covers_several) mark(job, brick, voxels_touched, work.averaged);
        if (holes) mark(job, brick, samples_inside, work.inside);
    }
    int marked = 0;
    for (std::size_t i = 0; i < n; ++i) {
        if (holes && work.inside[i] == 0) work.averaged[i] = 1;
        marked += work.averaged[i];
    }
    return marked;
}

/// store_cell() of small integers without a call: float has no fractions from 2^23 on, so that a sum there is rounded
/// half to even.
template <class T, class C> T rounded_cell(C value) {
    if constexpr (std::is_same_v<C, float> && std::is_integral_v<T> && sizeof(T) <= 2) {
        constexpr float low = std::numeric_limits<T>::lowest(), high = std::numeric_limits<T>::max();
        constexpr float whole = 0x1.8p23F;
        float const inside = value > low ? (value < high ? value : high) : low;
        T const rounded = static_cast<T>((inside + whole) - whole);
        return value == value ? rounded : T{0}; // NOLINT(misc-redundant-expression): NaN
    } else {
        return store_cell<T>(value);
    }
}

/// By how much shares of a voxel that add up to one may miss it.
constexpr double weight_rounding = 1e-9;

/// Where the samples of a tile go.
struct TileOutput {
    AnyView out, mask;
    tile::Job const& job;
    TileRule const& rule;
    InstructionSet instructions;

    /// The row of samples (j, k): its cells, its part of the mask if there is one, and its first index in the scratch.
    template <class T> struct Row {
        int j, k, at;
        T* cells;
        std::uint8_t* covered;
    };

    template <class T> Row<T> row(int j, int k) const {
        auto const of = [&](AnyView const& view) {
            return view.data == nullptr ? nullptr : view.at(job.begin[0], job.begin[1] + j, job.begin[2] + k);
        };
        return {j, k, (k * job.count[1] + j) * job.count[0], reinterpret_cast<T*>(of(out)),
                reinterpret_cast<std::uint8_t*>(of(mask))};
    }

    template <class T> void for_rows(auto&& visit) const {
        for (int k = 0; k < job.count[2]; ++k)
            for (int j = 0; j < job.count[1]; ++j) visit(row<T>(j, k));
    }

    /// Stores weighted means, by `value(row, i, weight)`, where there is weight, and the background elsewhere; only
    /// where `averaged` equals `wanted`, if it is given. What `value` makes of no weight is not used.
    template <class T, class C>
    void store_means(C const* weights, std::uint8_t const* averaged, std::uint8_t wanted, auto&& value) const {
        T const nothing = store_cell<T>(rule.background);
        int const n = job.count[0]; // in a register, whatever cells of bytes might alias
        for_rows<T>([&](Row<T> to) {
            for (int i = 0; i < n; ++i) {
                if (averaged != nullptr && averaged[to.at + i] != wanted) continue;
                C const weight = weights[to.at + i];
                bool const any = weight > C(0);
                T const mean = value(to, i, weight);
                to.cells[i] = any ? mean : nothing;
                if (to.covered != nullptr) to.covered[i] = any ? 1 : 0;
            }
        });
    }

    /// Divides sums by weights; only where `averaged` equals `wanted`, if it is given.
    template <class T, bool weights_are_shares = false, class C>
    void store(tile::Scratch<C> const& scratch, std::uint8_t const* averaged, std::uint8_t wanted) const {
        bool const bounded = !rule.range.empty();
        C const low = bounded ? static_cast<C>(rule.range.minimum) : -std::numeric_limits<C>::infinity();
        C const high = bounded ? static_cast<C>(rule.range.maximum) : std::numeric_limits<C>::infinity();
        store_means<T>(scratch.weight, averaged, wanted, [&](Row<T> const& to, int i, C weight) {
            C value = scratch.sum[to.at + i] / weight;
            value = value < low ? low : value > high ? high : value; // NaN stays
            if constexpr (weights_are_shares)
                if (weight > 0 && weight < 1 - weight_rounding) value = with_background(value, weight, i, to.j, to.k);
            return rounded_cell<T>(value);
        });
    }

    /// The integer that lies high * 2^32 + low above the base.
    template <class T> static T above(std::uint64_t base, double high, double low) {
        double const size = high * 0x1p32, whole = std::floor(size);
        return cell_beyond(cell_beyond(static_cast<T>(base), whole), size - whole + low);
    }

    /// 64-bit integers are summed as differences from the least one, in two halves if double has no room for these. So
    /// small differences of large values are kept, and a sample that only one cell contributes to is that cell.
    template <class T> void basis_of_wide(TileMemory& work, std::uint8_t const* averaged) const {
        std::uint64_t const base = job.id_count > 0 ? job.sources[job.ids[0]].base : 0;
        bool const far = job.id_count > 0 && job.sources[job.ids[0]].far;
        int const n = job.count[0] * job.count[1] * job.count[2];
        tile::Job part = job;
        part.load = tile::Load::high_halves;
        if (far) basis(part, work.wide, instructions);
        for (int i = 0; i < n; ++i)
            work.high[i] = far && work.wide.weight[i] > 0 ? work.wide.sum[i] / work.wide.weight[i] : 0;
        part.load = far ? tile::Load::low_halves : tile::Load::differences;
        basis(part, work.wide, instructions);
        store_means<T>(work.wide.weight, averaged, 0, [&](Row<T> const& to, int i, double weight) {
            int const at = to.at + i;
            if (!(weight > 0)) return T{};
            return above<T>(base, work.high[at], work.wide.sum[at] / work.wide.weight[at]);
        });
    }

    /// Share of voxel i along an axis that lies in the logical grid.
    double share_inside(int axis, int i) const {
        double const low = job.lower[axis] + static_cast<double>(job.begin[axis] + i) * job.step[axis];
        double const inside = std::min(low + job.step[axis], rule.extent[axis]) - std::max(low, 0.0);
        return std::clamp(inside / job.step[axis], 0.0, 1.0);
    }

    /// The mean of a voxel that bricks cover in part: the background takes the rest, which keeps the integral. A
    /// background that is not a number means that nothing is there, and the mean is that of what is.
    double with_background(double mean, double covered, int i, int j, int k) const {
        double const inside = share_inside(0, i) * share_inside(1, j) * share_inside(2, k);
        if (!std::isfinite(rule.background) || covered >= inside * (1 - weight_rounding)) return mean;
        double const share = covered / inside, mixed = mean * share + rule.background * (1 - share);
        double const low = std::min(mean, rule.background), high = std::max(mean, rule.background);
        return mixed < low ? low : mixed > high ? high : mixed;
    }

    template <class T> void nearest() const {
        T const nothing = store_cell<T>(rule.background);
        auto const n = static_cast<std::size_t>(job.count[0]);
        for_rows<T>([&](Row<T> to) {
            std::fill_n(to.cells, n, nothing);
            if (to.covered != nullptr) std::memset(to.covered, 0, n);
        });
        for (std::int64_t b = 0; b < job.id_count; ++b) nearest_brick<T>(job.sources[job.ids[b]]);
    }

    template <class T> void nearest_brick(tile::Source const& brick) const {
        Span spans[3];
        std::int64_t cell[3][tile::extent_x];
        for (int a = 2; a >= 0; --a) {
            spans[a] = samples_inside(job, brick, a);
            if (spans[a].begin >= spans[a].end) return;
            for (int i = spans[a].begin; i < spans[a].end; ++i) {
                double const p = job.lower[a] + (static_cast<double>(job.begin[a] + i) + 0.5) * job.step[a];
                auto const c = static_cast<std::int64_t>((p - static_cast<double>(brick.lower[a])) /
                                                         static_cast<double>(brick.width[a]));
                cell[a][i] = std::min(c, brick.dims[a] - 1);
            }
        }
        auto const* const cells = reinterpret_cast<T const*>(brick.cells);
        for (int k = spans[2].begin; k < spans[2].end; ++k)
            for (int j = spans[1].begin; j < spans[1].end; ++j) {
                T const* const from = cells + (cell[2][k] * brick.dims[1] + cell[1][j]) * brick.dims[0];
                Row<T> const to = row<T>(j, k);
                for (int i = spans[0].begin; i < spans[0].end; ++i) to.cells[i] = from[cell[0][i]];
                if (to.covered != nullptr)
                    std::memset(to.covered + spans[0].begin, 1,
                                static_cast<std::size_t>(spans[0].end - spans[0].begin));
            }
    }

    void basis_where(TileMemory& work, std::uint8_t const* averaged) const {
        with_type(job.type, [&]<class T>(T) {
            if constexpr (is_wide_cell<T>) {
                basis_of_wide<T>(work, averaged);
            } else if (computes_in_double(job.type)) {
                basis(job, work.wide, instructions);
                store<T>(work.wide, averaged, 0);
            } else {
                basis(job, work.single, instructions);
                store<T>(work.single, averaged, 0);
            }
        });
    }

    void average_where(TileMemory& work, std::uint8_t const* averaged) const {
        average(job, work.wide, instructions);
        with_type(job.type, [&]<class T>(T) { store<T, true>(work.wide, averaged, 1); });
    }

    void compute(TileMemory& work) const {
        switch (rule.method) {
        case Reconstruction::nearest:
            with_type(job.type, [&]<class T>(T) { nearest<T>(); });
            break;
        case Reconstruction::basis:
            basis_where(work, nullptr);
            break;
        case Reconstruction::average:
            average_where(work, nullptr);
            break;
        case Reconstruction::automatic: {
            int const n = job.count[0] * job.count[1] * job.count[2];
            int const marked = mark_averaged(job, rule.holes, work);
            if (marked > 0) average_where(work, marked == n ? nullptr : work.averaged);
            if (marked < n) basis_where(work, marked == 0 ? nullptr : work.averaged);
            break;
        }
        }
    }
};

} // namespace

TileWorkspace::TileWorkspace() : memory_(std::make_unique<TileMemory>()) {}
TileWorkspace::~TileWorkspace() = default;
TileWorkspace::TileWorkspace(TileWorkspace&&) noexcept = default;

void compute_tile(tile::Job const& job, TileRule const& rule, AnyView out, AnyView mask, TileWorkspace& workspace,
                  InstructionSet instructions) {
    TileOutput{out, mask, job, rule, instructions}.compute(workspace.memory());
}

void compute_box(std::span<tile::Source const> sources, std::span<std::int32_t const> ids, SampleGrid const& grid,
                 TileRule const& rule, AnyView out, TileWorkspace& workspace, InstructionSet instructions) {
    Box const region = out.box;
    tile::Job job;
    job.type = out.type;
    job.sources = sources.data();
    job.ids = ids.data();
    job.id_count = static_cast<std::int64_t>(ids.size());
    for (int a = 0; a < 3; ++a) {
        job.lower[a] = grid.lower[a];
        job.step[a] = grid.step[a];
    }
    Index3 at;
    for (at.z = region.lower.z; at.z < region.upper.z; at.z += tile_extent.z)
        for (at.y = region.lower.y; at.y < region.upper.y; at.y += tile_extent.y)
            for (at.x = region.lower.x; at.x < region.upper.x; at.x += tile_extent.x) {
                for (int a = 0; a < 3; ++a) {
                    job.begin[a] = at[a];
                    job.count[a] = static_cast<int>(std::min(tile_extent[a], region.upper[a] - at[a]));
                }
                compute_tile(job, rule, out, AnyView{}, workspace, instructions);
            }
}

TileRule tile_rule(Header const& header, Reconstruction method, double background, ValueRange range) {
    Index3 const n = header.dims;
    return {method,
            background,
            {static_cast<double>(n.x), static_cast<double>(n.y), static_cast<double>(n.z)},
            range,
            false};
}

void place(tile::Source& source, Brick const& brick, Index3 width, std::byte const* cells) {
    source.cells = cells;
    for (int a = 0; a < 3; ++a) {
        source.lower[a] = brick.lower[a];
        source.dims[a] = brick.dims[a];
        source.width[a] = width[a];
    }
}

std::vector<tile::Source> tile_sources(Volume const& volume) {
    auto const& bricks = volume.bricks();
    std::byte const* const data = volume.buffer().read(Space::host);
    std::size_t const bytes = size_of(volume.header().dtype);
    std::vector<tile::Source> sources(bricks.size());
    tile::Source first;
    with_type(volume.header().dtype, [&]<class T>(T) {
        if constexpr (is_wide_cell<T>) {
            auto const* const cells = reinterpret_cast<T const*>(data);
            auto const [least, most] = std::minmax_element(cells, cells + volume.header().voxels());
            if (bricks.empty()) return;
            first.base = static_cast<std::uint64_t>(*least);
            first.far = static_cast<std::uint64_t>(*most) - first.base >= std::uint64_t{1} << 53;
        }
    });
    for (std::size_t i = 0; i < bricks.size(); ++i) {
        tile::Source& source = sources[i];
        source = first;
        place(source, bricks[i], cell_width(volume.header().dims, bricks[i].level),
              data + static_cast<std::size_t>(volume.brick_offset(i)) * bytes);
    }
    return sources;
}

} // namespace vkt
