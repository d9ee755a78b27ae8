// The conservative reconstruction of one tile: every cell gives to a voxel in proportion to the volume they share.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/kernels/tile_common.h"

namespace vkt::VKT_BACKEND {

namespace {

/// Overlaps of a brick's cells with the tile's voxels along one axis, as shares of a voxel.
struct AxisOverlap {
    double job_lower, step, per_step, brick_lower, width, per_width;
    std::int64_t begin_index, dims;
    int begin = 0, end = 0; ///< voxels of the tile that the brick touches

    AxisOverlap(tile::Job const& job, tile::Source const& brick, int a)
        : job_lower(job.lower[a]), step(job.step[a]), per_step(1 / job.step[a]),
          brick_lower(static_cast<double>(brick.lower[a])), width(static_cast<double>(brick.width[a])),
          per_width(1 / width), begin_index(job.begin[a]), dims(brick.dims[a]) {
        double const upper = brick_lower + static_cast<double>(dims) * width;
        int const n = job.count[a];
        double const first = (brick_lower - face(0)) * per_step;
        begin = first <= 0 ? 0 : first >= n ? n : static_cast<int>(first);
        while (begin > 0 && face(begin) > brick_lower) --begin;
        while (begin < n && face(begin + 1) <= brick_lower) ++begin;
        double const last = (upper - face(0)) * per_step;
        end = last <= begin ? begin : last >= n ? n : static_cast<int>(last);
        while (end < n && face(end) < upper) ++end;
        while (end > begin && face(end - 1) >= upper) --end;
    }

    /// Lower face of voxel i of the tile.
    double face(int i) const { return job_lower + static_cast<double>(begin_index + i) * step; }

    /// First cell that reaches into voxel i, and one past the last.
    std::int64_t first_cell(int i) const {
        auto const c = static_cast<std::int64_t>(__builtin_floor((face(i) - brick_lower) * per_width));
        return c < 0 ? 0 : c < dims ? c : dims - 1;
    }
    std::int64_t last_cell(int i) const {
        auto const c = static_cast<std::int64_t>(__builtin_ceil((face(i + 1) - brick_lower) * per_width));
        return c < 1 ? 1 : c < dims ? c : dims;
    }

    /// Share of voxel i that cell c fills.
    double share(int i, std::int64_t c) const {
        double const cell = brick_lower + static_cast<double>(c) * width;
        double const low = cell > face(i) ? cell : face(i);
        double const high = cell + width < face(i + 1) ? cell + width : face(i + 1);
        return high > low ? (high - low) * per_step : 0.0;
    }
};

/// Cell rows are handled in pieces of this many cells (at multiples of it, so that sums do not depend on the tiles):
/// any brick fits the scratch memory.
constexpr int piece = 512;

/// All overlaps of one piece along x: voxel i takes pairs [start[i], start[i + 1]).
struct PieceOverlap {
    int begin = 0, end = 0;
    int start[tile::extent_x + 1];
    int cell[piece + tile::extent_x + 1];
    double share[piece + tile::extent_x + 1];
    double total[tile::extent_x];

    PieceOverlap(AxisOverlap const& x, std::int64_t first, int n) {
        int pairs = 0;
        begin = end = x.begin;
        for (int i = x.begin; i < x.end; ++i) {
            std::int64_t const from = x.first_cell(i) > first ? x.first_cell(i) : first;
            std::int64_t const to = x.last_cell(i) < first + n ? x.last_cell(i) : first + n;
            start[i] = pairs;
            total[i] = 0;
            for (std::int64_t c = from; c < to; ++c) {
                double const s = x.share(i, c);
                if (s == 0) continue;
                cell[pairs] = static_cast<int>(c - first);
                share[pairs++] = s;
                total[i] += s;
            }
            start[i + 1] = pairs;
            end = i + 1;
        }
    }
};

struct BrickAverage {
    tile::Job const& job;
    tile::Source const& brick;
    tile::ScratchDouble& scratch;
    AxisOverlap x, y, z;

    BrickAverage(tile::Job const& j, tile::Source const& b, tile::ScratchDouble& s)
        : job(j), brick(b), scratch(s), x(j, b, 0), y(j, b, 1), z(j, b, 2) {}

    /// Sums the cell rows that meet voxel row (j, k), weighted along y and z: cells [first, first + n) of x.
    double gather_row(int j, int k, std::int64_t first, int n) {
        double* __restrict const line = scratch.cells;
        double* __restrict const row = scratch.cells + piece;
        for (int i = 0; i < n; ++i) line[i] = 0;
        double filled = 0;
        for (std::int64_t cz = z.first_cell(k); cz < z.last_cell(k); ++cz) {
            double const sz = z.share(k, cz);
            if (sz == 0) continue;
            for (std::int64_t cy = y.first_cell(j); cy < y.last_cell(j); ++cy) {
                double const s = sz * y.share(j, cy);
                if (s == 0) continue;
                load_cells(job.type, brick.cells, (cz * brick.dims[1] + cy) * brick.dims[0] + first, n, row);
                for (int i = 0; i < n; ++i) line[i] = madd(s, row[i], line[i]);
                filled += s;
            }
        }
        return filled;
    }

    void add() {
        if (x.begin >= x.end || y.begin >= y.end || z.begin >= z.end) return;
        std::int64_t const low = x.first_cell(x.begin) / piece * piece, high = x.last_cell(x.end - 1);
        for (std::int64_t first = low; first < high; first += piece) {
            int const n = static_cast<int>(brick.dims[0] - first < piece ? brick.dims[0] - first : piece);
            PieceOverlap const pairs(x, first, n);
            for (int k = z.begin; k < z.end; ++k)
                for (int j = y.begin; j < y.end; ++j) {
                    double const filled = gather_row(j, k, first, n);
                    add_line((static_cast<std::int64_t>(k) * job.count[1] + j) * job.count[0], pairs, filled);
                }
        }
    }

    void add_line(std::int64_t at, PieceOverlap const& pairs, double filled) {
        double const* const line = scratch.cells;
        for (int i = pairs.begin; i < pairs.end; ++i) {
            double sum = 0;
            for (int p = pairs.start[i]; p < pairs.start[i + 1]; ++p)
                sum = madd(pairs.share[p], line[pairs.cell[p]], sum);
            scratch.sum[at + i] += sum;
            scratch.weight[at + i] = madd(pairs.total[i], filled, scratch.weight[at + i]);
        }
    }
};

} // namespace

void average_tile(tile::Job const& job, tile::ScratchDouble& scratch) {
    clear_tile(job, scratch);
    for (std::int64_t i = 0; i < job.id_count; ++i) BrickAverage(job, job.sources[job.ids[i]], scratch).add();
}

} // namespace vkt::VKT_BACKEND
