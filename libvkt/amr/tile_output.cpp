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
    std::uint8_t coarse[tile::samples];
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

/// Marks the voxels that overlap bricks whose cells are at most half as wide; returns how many.
int mark_coarse(tile::Job const& job, std::uint8_t* coarse) {
    int const n = job.count[0] * job.count[1] * job.count[2];
    std::memset(coarse, 0, static_cast<std::size_t>(n));
    for (std::int64_t i = 0; i < job.id_count; ++i) {
        tile::Source const& brick = job.sources[job.ids[i]];
        bool covers_several = false;
        for (int a = 0; a < 3; ++a) covers_several |= job.step[a] >= 2 * static_cast<double>(brick.width[a]);
        if (!covers_several) continue;
        Span const x = voxels_touched(job, brick, 0), y = voxels_touched(job, brick, 1),
                   z = voxels_touched(job, brick, 2);
        if (x.begin >= x.end) continue;
        for (int k = z.begin; k < z.end; ++k)
            for (int j = y.begin; j < y.end; ++j)
                std::memset(coarse + (k * job.count[1] + j) * job.count[0] + x.begin, 1,
                            static_cast<std::size_t>(x.end - x.begin));
    }
    int marked = 0;
    for (int i = 0; i < n; ++i) marked += coarse[i];
    return marked;
}

/// By how much shares of a voxel that add up to one may miss it.
constexpr double weight_rounding = 1e-9;

/// Where the samples of a tile go.
struct TileOutput {
    AnyView out, mask;
    tile::Job const& job;
    TileRule const& rule;
    InstructionSet instructions;

    std::uint8_t* mask_row(int j, int k) const {
        if (mask.data == nullptr) return nullptr;
        return reinterpret_cast<std::uint8_t*>(mask.at(job.begin[0], job.begin[1] + j, job.begin[2] + k));
    }

    /// Divides sums by weights; only where `coarse` equals `wanted`, if it is given.
    template <class T, bool weights_are_shares = false, class C>
    void store(tile::Scratch<C> const& scratch, std::uint8_t const* coarse, std::uint8_t wanted) const {
        T const nothing = store_cell<T>(rule.background);
        bool const bounded = !rule.range.empty();
        C const low = bounded ? static_cast<C>(rule.range.minimum) : -std::numeric_limits<C>::infinity();
        C const high = bounded ? static_cast<C>(rule.range.maximum) : std::numeric_limits<C>::infinity();
        for (int k = 0; k < job.count[2]; ++k)
            for (int j = 0; j < job.count[1]; ++j) {
                int const at = (k * job.count[1] + j) * job.count[0];
                T* const row = reinterpret_cast<T*>(out.at(job.begin[0], job.begin[1] + j, job.begin[2] + k));
                std::uint8_t* const covered = mask_row(j, k);
                for (int i = 0; i < job.count[0]; ++i) {
                    if (coarse != nullptr && coarse[at + i] != wanted) continue;
                    C const weight = scratch.weight[at + i];
                    C value = scratch.sum[at + i] / weight;
                    value = value < low ? low : value > high ? high : value; // NaN stays
                    if constexpr (weights_are_shares)
                        if (weight > 0 && weight < 1 - weight_rounding) value = with_background(value, weight, i, j, k);
                    row[i] = weight > C(0) ? store_cell<T>(value) : nothing;
                    if (covered != nullptr) covered[i] = weight > C(0) ? 1 : 0;
                }
            }
    }

    /// The integer that lies high * 2^32 + low above the base.
    template <class T> static T above(std::uint64_t base, double high, double low) {
        double const size = high * 0x1p32, whole = std::floor(size);
        return cell_beyond(cell_beyond(static_cast<T>(base), whole), size - whole + low);
    }

    /// 64-bit integers are summed as differences from the least one, in two halves if double has no room for these. So
    /// small differences of large values are kept, and a sample that only one cell contributes to is that cell.
    template <class T> void basis_of_wide(TileMemory& work, std::uint8_t const* coarse) const {
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
        T const nothing = store_cell<T>(rule.background);
        for (int k = 0; k < job.count[2]; ++k)
            for (int j = 0; j < job.count[1]; ++j) {
                int const at = (k * job.count[1] + j) * job.count[0];
                T* const row = reinterpret_cast<T*>(out.at(job.begin[0], job.begin[1] + j, job.begin[2] + k));
                std::uint8_t* const covered = mask_row(j, k);
                for (int i = 0; i < job.count[0]; ++i) {
                    if (coarse != nullptr && coarse[at + i] != 0) continue;
                    double const weight = work.wide.weight[at + i];
                    row[i] = weight > 0 ? above<T>(base, work.high[at + i], work.wide.sum[at + i] / weight) : nothing;
                    if (covered != nullptr) covered[i] = weight > 0 ? 1 : 0;
                }
            }
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
        for (int k = 0; k < job.count[2]; ++k)
            for (int j = 0; j < job.count[1]; ++j) {
                T* const row = reinterpret_cast<T*>(out.at(job.begin[0], job.begin[1] + j, job.begin[2] + k));
                for (int i = 0; i < job.count[0]; ++i) row[i] = nothing;
                if (std::uint8_t* const covered = mask_row(j, k))
                    std::memset(covered, 0, static_cast<std::size_t>(job.count[0]));
            }
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
                T* const row = reinterpret_cast<T*>(out.at(job.begin[0], job.begin[1] + j, job.begin[2] + k));
                for (int i = spans[0].begin; i < spans[0].end; ++i) row[i] = from[cell[0][i]];
                if (std::uint8_t* const covered = mask_row(j, k))
                    std::memset(covered + spans[0].begin, 1, static_cast<std::size_t>(spans[0].end - spans[0].begin));
            }
    }

    void basis_where(TileMemory& work, std::uint8_t const* coarse) const {
        with_cell_type(job.type, [&]<class T>(T) {
            if constexpr (is_wide_cell<T>) {
                basis_of_wide<T>(work, coarse);
            } else if (computes_in_double(job.type)) {
                basis(job, work.wide, instructions);
                store<T>(work.wide, coarse, 0);
            } else {
                basis(job, work.single, instructions);
                store<T>(work.single, coarse, 0);
            }
        });
    }

    void average_where(TileMemory& work, std::uint8_t const* coarse) const {
        average(job, work.wide, instructions);
        with_cell_type(job.type, [&]<class T>(T) { store<T, true>(work.wide, coarse, 1); });
    }

    void compute(TileMemory& work) const {
        switch (rule.method) {
        case Reconstruction::nearest:
            with_cell_type(job.type, [&]<class T>(T) { nearest<T>(); });
            break;
        case Reconstruction::basis:
            basis_where(work, nullptr);
            break;
        case Reconstruction::average:
            average_where(work, nullptr);
            break;
        case Reconstruction::automatic: {
            int const n = job.count[0] * job.count[1] * job.count[2];
            int const marked = mark_coarse(job, work.coarse);
            if (marked > 0) average_where(work, marked == n ? nullptr : work.coarse);
            if (marked < n) basis_where(work, marked == 0 ? nullptr : work.coarse);
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
    return {method, background, {static_cast<double>(n.x), static_cast<double>(n.y), static_cast<double>(n.z)}, range};
}

std::vector<tile::Source> tile_sources(Volume const& volume) {
    auto const& bricks = volume.bricks();
    std::byte const* const data = volume.buffer().read(Space::host);
    std::size_t const bytes = size_of(volume.header().dtype);
    std::vector<tile::Source> sources(bricks.size());
    tile::Source first;
    with_cell_type(volume.header().dtype, [&]<class T>(T) {
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
        Index3 const width = cell_width(volume.header().dims, bricks[i].level);
        source.cells = data + static_cast<std::size_t>(volume.brick_offset(i)) * bytes;
        for (int a = 0; a < 3; ++a) {
            source.lower[a] = bricks[i].lower[a];
            source.dims[a] = bricks[i].dims[a];
            source.width[a] = width[a];
        }
    }
    return sources;
}

} // namespace vkt
