// The basis reconstruction of one tile: sums of cell-width hat functions, separable within every brick.
// Method: Wald, Zellmann, Usher, Morrical, Lang, Pascucci, "Ray Tracing Structured AMR Data Using ExaBricks" (2021),
// §4.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/kernels/tile_common.h"

namespace vkt::VKT_BACKEND {

namespace {

/// Cell rows a run of samples needs along one axis: samples [begin, begin + count) of the tile, tap weights of each,
/// and for both taps the slot of the cell in `cells`; slot `slots` stands for a cell that is not there.
template <class C, int extent> struct AxisTaps {
    int begin = 0, count = 0, slots = 0;
    C weight[2][extent], total[extent];
    int slot[2][extent];
    std::int64_t cells[2 * extent];

    int slot_of(std::int64_t cell) {
        for (int back = 1; back <= 2 && back <= slots; ++back)
            if (cells[slots - back] == cell) return slots - back;
        cells[slots] = cell;
        return slots++;
    }

    /// False if no sample of the tile lies inside the brick's domain.
    bool build(tile::Job const& job, tile::Source const& brick, int a) {
        double const inverse = 1.0 / static_cast<double>(brick.width[a]);
        double const lower = static_cast<double>(brick.lower[a]);
        double const n = static_cast<double>(brick.dims[a]);
        auto const position = [&](int i) {
            double const p = job.lower[a] + (static_cast<double>(job.begin[a] + i) + 0.5) * job.step[a];
            return (p - lower) * inverse - 0.5;
        };
        // The estimate may be off by rounding; the test of the position itself decides.
        double const per_sample = inverse * job.step[a];
        double const first = (-1.0 - position(0)) / per_sample;
        int const end = job.count[a];
        begin = first <= 0 ? 0 : first >= end ? end : static_cast<int>(first);
        while (begin > 0 && position(begin - 1) > -1.0) --begin;
        while (begin < end && position(begin) <= -1.0) ++begin;
        count = slots = 0;
        for (int i = begin; i < end; ++i) {
            double const q = position(i);
            if (q >= n) break;
            double const floor = __builtin_floor(q);
            C const t = static_cast<C>(q - floor);
            auto const cell = static_cast<std::int64_t>(floor);
            C const w0 = cell >= 0 ? C(1) - t : C(0);
            C const w1 = cell + 1 < brick.dims[a] ? t : C(0);
            // A tap of weight zero reads a zero, not the cell: NaN and infinity must not spread to where they have no
            // weight.
            slot[0][count] = w0 != C(0) ? slot_of(cell) : -1;
            slot[1][count] = w1 != C(0) ? slot_of(cell + 1) : -1;
            weight[0][count] = w0;
            weight[1][count] = w1;
            total[count] = w0 + w1;
            ++count;
        }
        for (int tap = 0; tap < 2; ++tap)
            for (int i = 0; i < count; ++i)
                if (slot[tap][i] < 0) slot[tap][i] = slots;
        return count > 0;
    }
};

/// Interpolates one row of cells along x.
template <class C> void interpolate_x(AxisTaps<C, tile::extent_x> const& x, C const* row, C* out) {
    for (int i = 0; i < x.count; ++i)
        out[i] = madd(x.weight[1][i], row[x.slot[1][i]], x.weight[0][i] * row[x.slot[0][i]]);
}

template <class C> struct BrickPass {
    tile::Job const& job;
    tile::Source const& brick;
    tile::Scratch<C>& scratch;
    AxisTaps<C, tile::extent_x> x;
    AxisTaps<C, tile::extent_y> y;
    AxisTaps<C, tile::extent_z> z;

    /// Arrays stay as they are: setting them to zero takes as long as a small brick.
    BrickPass(tile::Job const& of, tile::Source const& from, tile::Scratch<C>& to)
        : job(of), brick(from), scratch(to) {}

    /// The cell rows that the samples' x taps need, side by side, then a zero.
    void load(std::int64_t cell_y, std::int64_t cell_z) {
        std::int64_t const start = (cell_z * brick.dims[1] + cell_y) * brick.dims[0];
        std::int64_t const low = x.cells[0], high = x.cells[x.slots - 1];
        if (high - low + 1 == x.slots) {
            load_part(job, brick, start + low, x.slots, scratch.cells);
        } else {
            for (int s = 0; s < x.slots; ++s) load_part(job, brick, start + x.cells[s], 1, scratch.cells + s);
        }
        scratch.cells[x.slots] = C(0);
    }

    /// Plane of one layer of cells, interpolated along x and y.
    void plane(std::int64_t cell_z, C* to) {
        for (int s = 0; s < y.slots; ++s) {
            load(y.cells[s], cell_z);
            interpolate_x(x, scratch.cells, scratch.rows + s * tile::extent_x);
        }
        C* const zero = scratch.rows + y.slots * tile::extent_x;
        for (int i = 0; i < x.count; ++i) zero[i] = C(0);
        for (int j = 0; j < y.count; ++j) {
            C const w0 = y.weight[0][j], w1 = y.weight[1][j];
            C const* const r0 = scratch.rows + y.slot[0][j] * tile::extent_x;
            C const* const r1 = scratch.rows + y.slot[1][j] * tile::extent_x;
            C* const out = to + j * tile::extent_x;
            for (int i = 0; i < x.count; ++i) out[i] = madd(w1, r1[i], w0 * r0[i]);
        }
    }

    void add() {
        int held[2] = {-1, -1}; // which slots the two planes hold
        for (int k = 0; k < z.count; ++k) {
            C const* taps[2];
            for (int tap = 0; tap < 2; ++tap) {
                int const slot = z.slot[tap][k];
                if (slot == z.slots) {
                    taps[tap] = scratch.planes[2];
                    continue;
                }
                int const buffer = slot % 2; // slots ascend by one, so two neighbours never share a buffer
                if (held[buffer] != slot) {
                    plane(z.cells[slot], scratch.planes[buffer]);
                    held[buffer] = slot;
                }
                taps[tap] = scratch.planes[buffer];
            }
            add_layer(k, taps[0], taps[1]);
        }
    }

    void add_layer(int k, C const* p0, C const* p1) {
        C const w0 = z.weight[0][k], w1 = z.weight[1][k];
        for (int j = 0; j < y.count; ++j) {
            std::int64_t const at =
                (static_cast<std::int64_t>(z.begin + k) * job.count[1] + y.begin + j) * job.count[0] + x.begin;
            C* __restrict const sum = scratch.sum + at;
            C* __restrict const weight = scratch.weight + at;
            C const* const r0 = p0 + j * tile::extent_x;
            C const* const r1 = p1 + j * tile::extent_x;
            C const wyz = y.total[j] * z.total[k];
            for (int i = 0; i < x.count; ++i) {
                sum[i] += madd(w1, r1[i], w0 * r0[i]);
                weight[i] = madd(x.total[i], wyz, weight[i]);
            }
        }
    }
};

/// Whether samples lie at the centres of cells, each of which is all that its brick adds there.
bool samples_cells(tile::Job const& job, tile::Source const& brick) {
    bool all = true;
    for (int a = 0; a < 3; ++a)
        all = all && brick.width[a] == 1 && job.step[a] == 1 && job.lower[a] == __builtin_floor(job.lower[a]);
    return all;
}

/// What BrickPass adds then, bit for bit: small bricks of finest cells are most of a refined scan.
template <class C> void add_cells(tile::Job const& job, tile::Source const& brick, tile::Scratch<C>& scratch) {
    std::int64_t from[3]; // of the tile's first sample, in cells of the brick
    int begin[3], end[3];
    for (int a = 0; a < 3; ++a) {
        from[a] = static_cast<std::int64_t>(job.lower[a]) + job.begin[a] - brick.lower[a];
        std::int64_t const last = brick.dims[a] - from[a];
        begin[a] = from[a] >= 0 ? 0 : from[a] < -job.count[a] ? job.count[a] : static_cast<int>(-from[a]);
        end[a] = last < job.count[a] ? static_cast<int>(last) : job.count[a];
        if (begin[a] >= end[a]) return;
    }
    int const n = end[0] - begin[0];
    for (int k = begin[2]; k < end[2]; ++k)
        for (int j = begin[1]; j < end[1]; ++j) {
            std::int64_t const row = (from[2] + k) * brick.dims[1] + from[1] + j;
            load_part(job, brick, row * brick.dims[0] + from[0] + begin[0], n, scratch.cells);
            std::int64_t const at = (std::int64_t{k} * job.count[1] + j) * job.count[0] + begin[0];
            C* __restrict const sum = scratch.sum + at;
            C* __restrict const weight = scratch.weight + at;
            for (int i = 0; i < n; ++i) sum[i] += scratch.cells[i], weight[i] += C(1);
        }
}

template <class C> void run(tile::Job const& job, tile::Scratch<C>& scratch) {
    clear_tile(job, scratch);
    for (int i = 0; i < tile::extent_x * tile::extent_y; ++i) scratch.planes[2][i] = C(0);
    for (std::int64_t i = 0; i < job.id_count; ++i) {
        tile::Source const& brick = job.sources[job.ids[i]];
        if (samples_cells(job, brick)) {
            add_cells(job, brick, scratch);
            continue;
        }
        BrickPass<C> pass(job, brick, scratch);
        if (pass.z.build(job, brick, 2) && pass.y.build(job, brick, 1) && pass.x.build(job, brick, 0)) pass.add();
    }
}

} // namespace

void basis_tile(tile::Job const& job, tile::ScratchFloat& scratch) { run(job, scratch); }
void basis_tile(tile::Job const& job, tile::ScratchDouble& scratch) { run(job, scratch); }

} // namespace vkt::VKT_BACKEND
