// Hierarchical to structured: bins bricks into output tiles and runs them on all threads.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/reconstruct.h"

#include "libvkt/amr/device_sampler.h"
#include "libvkt/amr/tile_output.h"
#include "libvkt/core/error.h"
#include "libvkt/core/first_failure.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cmath>
#include <omp.h>

namespace vkt {

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
    : volume_(std::move(volume)), grid_(grid), rule_(tile_rule(volume_.header(), method, background, {1, 0})) {
    if (volume_.header().kind != Kind::hierarchical)
        throw Error(ErrorKind::failure, "reconstruction starts from a hierarchical volume");
    auto const& bricks = volume_.bricks();
    if (bricks.size() >= std::size_t{1} << 31)
        throw Error(ErrorKind::resources, "more than 2^31 bricks cannot be sampled");
    if (method == Reconstruction::automatic && leaves_holes(volume_.header(), bricks, grid))
        rule_.method = Reconstruction::average;
    sources_ = tile_sources(volume_);
    first_z_.resize(bricks.size());
    last_z_.resize(bricks.size());
    for (std::size_t i = 0; i < bricks.size(); ++i) {
        IndexRange const z = touched(grid_, rule_.method, sources_[i], 2);
        first_z_[i] = z.first;
        last_z_[i] = z.last;
    }
    // Sums of integers and halves are wider than what they are stored as: rounding brings them back.
    DataType const type = volume_.header().dtype;
    bool const rounds = type == DataType::float32 || type == DataType::float64;
    if (rounds && method != Reconstruction::nearest) rule_.range = range_near_grid();
}

/// Of the cells that matter to any sample of the grid, so that no result depends on how it is cut into regions.
ValueRange Reconstructor::range_near_grid() const {
    std::vector<std::size_t> near;
    for (std::size_t i = 0; i < sources_.size(); ++i) {
        bool meets = true;
        for (int a = 0; a < 3 && meets; ++a) {
            IndexRange const range = touched(grid_, rule_.method, sources_[i], a);
            meets = range.first < range.last;
        }
        if (meets) near.push_back(i);
    }
    return united(brick_ranges(volume_, near, default_execution()));
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
            IndexRange const range = touched(grid_, rule_.method, sources_[i], a);
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
    if (out.space == Space::device) {
        if (!on_gpu_) on_gpu_ = std::make_shared<DeviceSampler>(volume_);
        return on_gpu_->run(grid_, rule_, out);
    }
    Index3 first_tile, tiles;
    for (int a = 0; a < 3; ++a) {
        first_tile[a] = region.lower[a] / tile_extent[a];
        tiles[a] = (region.upper[a] - 1) / tile_extent[a] + 1 - first_tile[a];
    }
    std::vector<std::int64_t> starts;
    std::vector<std::int32_t> ids;
    bin(region, tiles, first_tile, starts, ids);

    int const threads = std::max(1, execution.threads);
    std::vector<TileWorkspace> work(static_cast<std::size_t>(threads));
    std::int64_t const count = tiles.x * tiles.y * tiles.z;
    FirstFailure failure; // workspaces grow with the tiles
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
        TileWorkspace& mine = work[static_cast<std::size_t>(omp_get_thread_num())];
        failure.catch_from([&] { compute_tile(job, rule_, out, mask, mine, execution.instructions); });
    }
    failure.rethrow();
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
