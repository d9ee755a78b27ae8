// The tile-gather driver of the reconstructions: bins bricks into output tiles, runs kernels, stores samples.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/reconstruct.h"

#include "libvkt/amr/cells.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <cmath>
#include <cstring>
#include <omp.h>

namespace vkt {

namespace {

constexpr Index3 tile_extent{tile::extent_x, tile::extent_y, tile::extent_z};

struct Workspace {
    tile::ScratchFloat single;
    tile::ScratchDouble wide;
    std::uint8_t coarse[tile::samples];
};

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

} // namespace

/// Where a tile's samples go.
struct Reconstructor::TileOutput {
    AnyView out, mask;
    tile::Job const& job;
    double background;

    std::uint8_t* mask_row(int j, int k) const {
        if (mask.data == nullptr) return nullptr;
        return reinterpret_cast<std::uint8_t*>(mask.at(job.begin[0], job.begin[1] + j, job.begin[2] + k));
    }

    /// Divides sums by weights; only where `coarse` equals `wanted`, if it is given.
    template <class T, class C>
    void store(tile::Scratch<C> const& scratch, std::uint8_t const* coarse, std::uint8_t wanted) const {
        T const nothing = store_cell<T>(background);
        for (int k = 0; k < job.count[2]; ++k)
            for (int j = 0; j < job.count[1]; ++j) {
                int const at = (k * job.count[1] + j) * job.count[0];
                T* const row = reinterpret_cast<T*>(out.at(job.begin[0], job.begin[1] + j, job.begin[2] + k));
                std::uint8_t* const covered = mask_row(j, k);
                for (int i = 0; i < job.count[0]; ++i) {
                    if (coarse != nullptr && coarse[at + i] != wanted) continue;
                    C const weight = scratch.weight[at + i];
                    row[i] = weight > C(0) ? store_cell<T>(scratch.sum[at + i] / weight) : nothing;
                    if (covered != nullptr) covered[i] = weight > C(0) ? 1 : 0;
                }
            }
    }

    template <class T> void nearest() const {
        T const nothing = store_cell<T>(background);
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

    void basis_where(Workspace& work, Execution const& execution, std::uint8_t const* coarse) const {
        with_cell_type(job.type, [&]<class T>(T) {
            if (computes_in_double(job.type)) {
                basis(job, work.wide, execution.instructions);
                store<T>(work.wide, coarse, 0);
            } else {
                basis(job, work.single, execution.instructions);
                store<T>(work.single, coarse, 0);
            }
        });
    }

    void average_where(Workspace& work, Execution const& execution, std::uint8_t const* coarse) const {
        average(job, work.wide, execution.instructions);
        with_cell_type(job.type, [&]<class T>(T) { store<T>(work.wide, coarse, 1); });
    }

    void compute(Reconstruction method, Workspace& work, Execution const& execution) const {
        switch (method) {
        case Reconstruction::nearest:
            with_cell_type(job.type, [&]<class T>(T) { nearest<T>(); });
            break;
        case Reconstruction::basis:
            basis_where(work, execution, nullptr);
            break;
        case Reconstruction::average:
            average_where(work, execution, nullptr);
            break;
        case Reconstruction::automatic: {
            int const n = job.count[0] * job.count[1] * job.count[2];
            int const marked = mark_coarse(job, work.coarse);
            if (marked > 0) average_where(work, execution, marked == n ? nullptr : work.coarse);
            if (marked < n) basis_where(work, execution, marked == 0 ? nullptr : work.coarse);
            break;
        }
        }
    }
};

namespace {

/// Output indices along an axis that a brick may touch: a close superset, [first, last).
struct IndexRange {
    std::int64_t first, last;
};

IndexRange touched(SampleGrid const& grid, Reconstruction method, tile::Source const& brick, int a) {
    double low = static_cast<double>(brick.lower[a]);
    double high = low + static_cast<double>(brick.dims[a] * brick.width[a]);
    double centre = 0.5; // samples lie in the middle of voxels
    if (method == Reconstruction::basis || method == Reconstruction::automatic) {
        low -= 0.5 * static_cast<double>(brick.width[a]);
        high += 0.5 * static_cast<double>(brick.width[a]);
    }
    if (method == Reconstruction::average) centre = 0;
    double const slack = 0.01 + (method == Reconstruction::automatic ? 0.5 : 0.0);
    double const first = std::ceil((low - grid.lower[a]) / grid.step[a] - centre - slack);
    double const last = std::floor((high - grid.lower[a]) / grid.step[a] - centre + slack) + 1;
    auto const n = static_cast<double>(grid.dims[a]);
    // A voxel that only touches from below starts one index earlier.
    double const begin = method == Reconstruction::average ? first - 1 : first;
    return {static_cast<std::int64_t>(std::clamp(begin, 0.0, n)), static_cast<std::int64_t>(std::clamp(last, 0.0, n))};
}

} // namespace

Reconstructor::Reconstructor(Volume volume, SampleGrid const& grid, Reconstruction method, double background)
    : volume_(std::move(volume)), grid_(grid), method_(method), background_(background) {
    if (volume_.header().kind != Kind::hierarchical)
        throw Error(ErrorKind::failure, "reconstruction starts from a hierarchical volume");
    auto const& bricks = volume_.bricks();
    if (bricks.size() >= std::size_t{1} << 31)
        throw Error(ErrorKind::resources, "more than 2^31 bricks cannot be sampled");
    std::byte const* const data = volume_.buffer().read(Space::host);
    std::size_t const bytes = size_of(volume_.header().dtype);
    sources_.resize(bricks.size());
    first_z_.resize(bricks.size());
    last_z_.resize(bricks.size());
    for (std::size_t i = 0; i < bricks.size(); ++i) {
        tile::Source& source = sources_[i];
        Index3 const width = cell_width(volume_.header().dims, bricks[i].level);
        source.cells = data + static_cast<std::size_t>(volume_.brick_offset(i)) * bytes;
        for (int a = 0; a < 3; ++a) {
            source.lower[a] = bricks[i].lower[a];
            source.dims[a] = bricks[i].dims[a];
            source.width[a] = width[a];
        }
        IndexRange const z = touched(grid_, method_, source, 2);
        first_z_[i] = z.first;
        last_z_[i] = z.last;
    }
}

std::size_t Reconstructor::state_bytes() const {
    return sources_.size() * (sizeof(tile::Source) + 2 * sizeof(std::int64_t));
}

/// Lists for every tile the bricks that may matter to it, ascending: counts first, then fills.
void Reconstructor::bin(Box const& region, Index3 const& tiles, Index3 const& first_tile,
                        std::vector<std::int64_t>& starts, std::vector<std::int32_t>& ids) const {
    struct Entry {
        std::int32_t id;
        std::int32_t lower[3], upper[3]; ///< tiles
    };
    std::vector<Entry> entries;
    starts.assign(static_cast<std::size_t>(tiles.x * tiles.y * tiles.z) + 1, 0);
    auto const each_tile = [&](Entry const& entry, auto&& visit) {
        for (std::int64_t k = entry.lower[2]; k < entry.upper[2]; ++k)
            for (std::int64_t j = entry.lower[1]; j < entry.upper[1]; ++j)
                for (std::int64_t i = entry.lower[0]; i < entry.upper[0]; ++i)
                    visit(static_cast<std::size_t>((k * tiles.y + j) * tiles.x + i));
    };
    for (std::size_t i = 0; i < sources_.size(); ++i) {
        if (first_z_[i] >= region.upper.z || last_z_[i] <= region.lower.z) continue;
        Entry entry{static_cast<std::int32_t>(i), {}, {}};
        bool any = true;
        for (int a = 0; a < 3 && any; ++a) {
            IndexRange const range = touched(grid_, method_, sources_[i], a);
            std::int64_t const first = std::max(range.first, region.lower[a]);
            std::int64_t const last = std::min(range.last, region.upper[a]);
            any = first < last;
            entry.lower[a] = static_cast<std::int32_t>(first / tile_extent[a] - first_tile[a]);
            entry.upper[a] = static_cast<std::int32_t>((last - 1) / tile_extent[a] - first_tile[a] + 1);
        }
        if (!any) continue;
        entries.push_back(entry);
        each_tile(entry, [&](std::size_t t) { ++starts[t + 1]; });
    }
    for (std::size_t t = 1; t < starts.size(); ++t) starts[t] += starts[t - 1];
    ids.resize(static_cast<std::size_t>(starts.back()));
    std::vector<std::int64_t> next(starts.begin(), starts.end() - 1);
    for (Entry const& entry : entries)
        each_tile(entry, [&](std::size_t t) { ids[static_cast<std::size_t>(next[t]++)] = entry.id; });
}

void Reconstructor::run(AnyView out, AnyView mask, Execution const& execution) const {
    Box const region = out.box;
    if (region.empty() || !box_of(grid_.dims).contains(region))
        throw Error(ErrorKind::failure, text("region ", region, " leaves the grid of ", grid_.dims));
    if (out.type != volume_.header().dtype)
        throw Error(ErrorKind::failure, text("reconstruction of ", volume_.header().dtype, " cannot write ", out.type));
    Index3 first_tile, tiles;
    for (int a = 0; a < 3; ++a) {
        first_tile[a] = region.lower[a] / tile_extent[a];
        tiles[a] = (region.upper[a] - 1) / tile_extent[a] + 1 - first_tile[a];
    }
    std::vector<std::int64_t> starts;
    std::vector<std::int32_t> ids;
    bin(region, tiles, first_tile, starts, ids);

    int const threads = std::max(1, execution.threads);
    std::vector<std::unique_ptr<Workspace>> work;
    for (int i = 0; i < threads; ++i) work.push_back(std::make_unique<Workspace>());
    std::int64_t const count = tiles.x * tiles.y * tiles.z;
#pragma omp parallel for num_threads(threads) schedule(dynamic, 1)
    for (std::int64_t t = 0; t < count; ++t) {
        tile::Job job;
        Index3 const at = first_tile + Index3{t % tiles.x, t / tiles.x % tiles.y, t / (tiles.x * tiles.y)};
        for (int a = 0; a < 3; ++a) {
            std::int64_t const begin = std::max(at[a] * tile_extent[a], region.lower[a]);
            std::int64_t const end = std::min((at[a] + 1) * tile_extent[a], region.upper[a]);
            job.lower[a] = grid_.lower[a];
            job.step[a] = grid_.step[a];
            job.begin[a] = begin;
            job.count[a] = static_cast<int>(end - begin);
        }
        job.type = volume_.header().dtype;
        job.sources = sources_.data();
        job.ids = ids.data() + starts[static_cast<std::size_t>(t)];
        job.id_count = starts[static_cast<std::size_t>(t) + 1] - starts[static_cast<std::size_t>(t)];
        Workspace& mine = *work[static_cast<std::size_t>(omp_get_thread_num())];
        TileOutput{out, mask, job, background_}.compute(method_, mine, execution);
    }
}

Volume reconstruct(Volume const& volume, SampleGrid const& grid, Reconstruction method, double background,
                   Execution const& execution, Volume* mask) {
    Reconstructor const reconstructor(volume, grid, method, background);
    Header const header = reconstructor.header();
    Volume result(header);
    AnyView mask_view;
    if (mask != nullptr) {
        Header mask_header = header;
        mask_header.dtype = DataType::uint8;
        mask_header.values = {};
        mask_header.units.clear();
        *mask = Volume(mask_header);
        mask_view = mask->mutable_view();
    }
    reconstructor.run(result.mutable_view(), mask_view, execution);
    return result;
}

} // namespace vkt
