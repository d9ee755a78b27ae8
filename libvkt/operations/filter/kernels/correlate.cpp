// Correlation on the CPU: weighted sums of rows, four registers at a time.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/correlate.h"

#include "libvkt/kernel/cpu_tiles.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/stencil.h"
#include "libvkt/operations/common/kernels/finite_rows.h"
#include "libvkt/operations/filter/kernels/large_rows.h"

#include <algorithm>
#include <memory>

namespace vkt {

namespace VKT_BACKEND {
namespace {

constexpr int together = 4; ///< registers that a weighted sum is made of at a time, so that additions overlap

static_assert(driver::NeighbourRows<float>::tile_columns % (together * lane_count<float>) == 0,
              "the last block of a row may not reach beyond what there is room for");

/// value - 0 is value for the compiler too, value + 0 is not if it is -0.
template <class C> Lanes<C> all_lanes(C value) { return value - Lanes<C>{}; }

/// Calls f(x) for the first voxels of blocks of `together` registers that cover n voxels.
template <class C, class F> void for_blocks(std::int64_t n, F const& f) {
    for (std::int64_t x = 0; x < n; x += together * lane_count<C>) f(x);
}

/// The sum of weight[k] * value(k, voxel) over first <= k < count, added to what is there or not.
template <class C, class V>
void sum_of(C* to, std::int64_t n, bool add, C const* weight, std::int64_t first, std::int64_t count, V const& value) {
    for_blocks<C>(n, [&](std::int64_t x) {
        Lanes<C> sum[together];
        for (int j = 0; j < together; ++j) sum[j] = add ? load_lanes(to + x + j * lane_count<C>) : Lanes<C>{};
        for (std::int64_t k = first; k < count; ++k) {
            Lanes<C> const w = all_lanes(weight[k]);
            for (int j = 0; j < together; ++j) sum[j] = madd(w, value(k, x + j * lane_count<C>), sum[j]);
        }
        for (int j = 0; j < together; ++j) store_lanes(to + x + j * lane_count<C>, sum[j]);
    });
}

/// Taps of one axis as C.
template <class C> struct Weights {
    AxisTaps::Kind kind;
    std::int64_t radius;
    std::vector<C> taps;

    explicit Weights(AxisTaps const& from) : kind(from.kind), radius(from.radius()) {
        for (double const tap : from.taps) taps.push_back(static_cast<C>(tap));
    }
    /// rows[0] … rows[2 radius] are the voxels from -radius to radius of n voxels.
    void apply(C const* const* rows, C* to, std::int64_t n, bool add) const {
        C const* const w = taps.data();
        C const* const* const middle = rows + radius;
        switch (kind) {
        case AxisTaps::Kind::plain:
            return sum_of(to, n, add, w, 0, 2 * radius + 1,
                          [&](std::int64_t k, std::int64_t x) { return load_lanes(rows[k] + x); });
        case AxisTaps::Kind::even:
            sum_of(to, n, add, w, 0, 1, [&](std::int64_t, std::int64_t x) { return load_lanes(*middle + x); });
            if (radius == 0) return;
            return sum_of(to, n, true, w, 1, radius + 1, [&](std::int64_t k, std::int64_t x) {
                return load_lanes(middle[k] + x) + load_lanes(middle[-k] + x);
            });
        case AxisTaps::Kind::odd:
            return sum_of(to, n, add, w, 1, radius + 1, [&](std::int64_t k, std::int64_t x) {
                return load_lanes(middle[k] + x) - load_lanes(middle[-k] + x);
            });
        case AxisTaps::Kind::zero_sum:
        case AxisTaps::Kind::average:
            sum_of(to, n, add, w, 1, radius + 1, [&](std::int64_t k, std::int64_t x) {
                Lanes<C> const v = load_lanes(*middle + x);
                return (load_lanes(middle[k] + x) - v) + (load_lanes(middle[-k] + x) - v);
            });
            if (kind == AxisTaps::Kind::average)
                for (std::int64_t x = 0; x < n; ++x) to[x] += (*middle)[x];
            return;
        }
    }
};

template <class C> std::vector<Weights<C>> weights_of(std::vector<AxisTaps> const& all) {
    std::vector<Weights<C>> result;
    result.reserve(all.size());
    for (AxisTaps const& taps : all) result.emplace_back(taps);
    return result;
}

/// A thread's tiles.
template <class C> class TermTile {
public:
    /// With a scale, voxels are multiplied by it, and results divided. Flat: what is compiled for newer processors must
    /// not leave functions of the library's vectors for others to link.
    [[gnu::flatten]] TermTile(ConstView in, AnyView out, SeparableSum const& sum, C scale = 1)
        : in_(in), out_(out), sum_(sum), scale_(scale), headroom_(static_cast<C>(sum.headroom())),
          overflows_(scale == 1 && (in.type == DataType::float32 || in.type == DataType::float64)),
          radius_(sum.radius()), x_(weights_of<C>(sum.x)), y_(weights_of<C>(sum.y)), z_(weights_of<C>(sum.z)) {
        Index3 const tile = sum.tile();
        constexpr std::int64_t block = together * lane_count<C>;
        pitch_ = (tile.x + 2 * radius_.x + block - 1) / block * block + block;
        rows_ = tile.y;
        deep_ = 2 * radius_.z + 1;
        auto const sized = [&](std::int64_t rows) { return std::vector<C>(static_cast<std::size_t>(rows * pitch_)); };
        line_ = sized(1);
        lines_ = sized(static_cast<std::int64_t>(x_.size()) * (rows_ + 2 * radius_.y));
        ring_ = sized(static_cast<std::int64_t>(sum.planes.size()) * deep_ * rows_);
        parts_ = sized(sum.parts + 1);
        pointers_.resize(static_cast<std::size_t>(2 * std::max({radius_.x, radius_.y, radius_.z}) + 1));
    }

    void run(Box const& tile, Losses& losses) {
        begin(tile);
        bool reduced = false;
        for (std::int64_t z = tile.lower.z - radius_.z; z < tile.upper.z + radius_.z; ++z) {
            filter_slice(z);
            if (reduced) {
                reduced_->filter_slice(z);
            } else if (large_) {
                reduced = true;
                reduce(z);
            }
            if (z >= tile.lower.z + radius_.z) finish_slice(z - radius_.z, reduced, losses);
        }
    }

private:
    void begin(Box const& tile) {
        tile_ = tile;
        large_ = false;
    }
    /// From now on there are results of smaller voxels beside the others, for where those overflow: the slices up to z
    /// once more.
    void reduce(std::int64_t z) {
        if (reduced_ == nullptr) reduced_ = std::make_unique<TermTile>(in_, out_, sum_, headroom_);
        reduced_->begin(tile_);
        for (std::int64_t k = std::max(tile_.lower.z - radius_.z, z - 2 * radius_.z); k <= z; ++k)
            reduced_->filter_slice(k);
    }

    C* line(std::size_t taps, std::int64_t j) {
        return lines_.data() + (static_cast<std::int64_t>(taps) * (rows_ + 2 * radius_.y) + j) * pitch_;
    }
    C* ring(std::size_t plane, std::int64_t z, std::int64_t j) {
        std::int64_t const slot = (z - tile_.lower.z + radius_.z) % deep_;
        return ring_.data() + ((static_cast<std::int64_t>(plane) * deep_ + slot) * rows_ + j) * pitch_;
    }

    /// One slice along x and y.
    void filter_slice(std::int64_t z) {
        Index3 const n = tile_.dims();
        for (std::int64_t j = 0; j < n.y + 2 * radius_.y; ++j) {
            std::int64_t const x0 = tile_.lower.x - radius_.x, wide = n.x + 2 * radius_.x;
            for (std::int64_t i = 0; i < wide; i += row_piece)
                load_row(in_.type, in_.at(x0 + i, tile_.lower.y - radius_.y + j, z), line_.data() + i,
                         std::min(row_piece, wide - i));
            if (overflows_ && !large_) large_ = any_large(line_.data(), wide, headroom_);
            if (scale_ != 1)
                for (std::int64_t i = 0; i < wide; ++i) line_[static_cast<std::size_t>(i)] *= scale_;
            for (std::size_t t = 0; t < x_.size(); ++t) {
                std::int64_t const r = x_[t].radius;
                for (std::int64_t k = -r; k <= r; ++k)
                    pointers_[static_cast<std::size_t>(k + r)] = line_.data() + radius_.x + k;
                x_[t].apply(pointers_.data(), line(t, j), n.x, false);
            }
        }
        for (std::size_t p = 0; p < sum_.planes.size(); ++p) {
            auto const& weights = y_[static_cast<std::size_t>(sum_.planes[p].y)];
            std::int64_t const r = weights.radius;
            for (std::int64_t j = 0; j < n.y; ++j) {
                for (std::int64_t k = -r; k <= r; ++k)
                    pointers_[static_cast<std::size_t>(k + r)] =
                        line(static_cast<std::size_t>(sum_.planes[p].x), j + radius_.y + k);
                weights.apply(pointers_.data(), ring(p, z, j), n.x, false);
            }
        }
    }

    void finish_slice(std::int64_t z, bool reduced, Losses& losses) {
        Index3 const n = tile_.dims();
        for (std::int64_t j = 0; j < n.y; ++j) {
            C* const result = finished_row(z, j);
            if (reduced) {
                C const* const other = reduced_->finished_row(z, j);
                for (std::int64_t x = 0; x < n.x; ++x) result[x] = is_finite(result[x]) ? result[x] : other[x];
            }
            losses +=
                store_row(out_.type, static_cast<C const*>(result), out_.at(tile_.lower.x, tile_.lower.y + j, z), n.x);
        }
    }

    /// The sums along z of a row, and what is made of them.
    C* finished_row(std::int64_t z, std::int64_t j) {
        std::int64_t const n = tile_.dims().x;
        int before = -1;
        for (auto const& term : sum_.terms) {
            auto const& weights = z_[static_cast<std::size_t>(term.z)];
            std::int64_t const r = weights.radius;
            for (std::int64_t k = -r; k <= r; ++k)
                pointers_[static_cast<std::size_t>(k + r)] = ring(static_cast<std::size_t>(term.plane), z + k, j);
            C* const part = parts_.data() + term.part * pitch_;
            if (term.weight == 1) {
                weights.apply(pointers_.data(), part, n, term.part == before);
            } else {
                C* const unweighted = parts_.data() + sum_.parts * pitch_;
                auto const weight = static_cast<C>(term.weight);
                weights.apply(pointers_.data(), unweighted, n, false);
                if (term.part != before) std::fill(part, part + n, C(0));
                for (std::int64_t x = 0; x < n; ++x) part[x] = madd(weight, unweighted[x], part[x]);
            }
            before = term.part;
        }
        C* const result = parts_.data();
        if (sum_.parts > 1) take_length(n);
        if (scale_ != 1)
            for (std::int64_t x = 0; x < n; ++x) result[x] /= scale_;
        if (sum_.offset != 0)
            for (std::int64_t x = 0; x < n; ++x) result[x] += static_cast<C>(sum_.offset);
        return result;
    }

    /// Of the parts of a row, into the first.
    void take_length(std::int64_t n) {
        C* const result = parts_.data();
        C* const scale = result + sum_.parts * pitch_; // no sum is unweighted any more
        for (std::int64_t x = 0; x < n; ++x) scale[x] = std::abs(result[x]);
        for (int part = 1; part < sum_.parts; ++part) {
            C const* const other = result + part * pitch_;
            for (std::int64_t x = 0; x < n; ++x) {
                C const size = std::abs(other[x]);
                scale[x] = size > scale[x] ? size : scale[x];
            }
        }
        for (std::int64_t x = 0; x < n; ++x) {
            scale[x] = scale_for_squares(scale[x]);
            result[x] = result[x] * scale[x] * (result[x] * scale[x]);
        }
        for (int part = 1; part < sum_.parts; ++part) {
            C const* const other = result + part * pitch_;
            for (std::int64_t x = 0; x < n; ++x) result[x] = madd(other[x] * scale[x], other[x] * scale[x], result[x]);
        }
        for (std::int64_t x = 0; x < n; ++x) result[x] = std::sqrt(result[x]) / scale[x];
    }

    ConstView in_;
    AnyView out_;
    SeparableSum const& sum_;
    C scale_, headroom_;
    bool overflows_;                    ///< voxels are such as may be too large
    bool large_ = false;                ///< some of the tile so far are
    std::unique_ptr<TermTile> reduced_; ///< of voxels times headroom_
    Index3 radius_;
    std::vector<Weights<C>> x_, y_, z_;
    Box tile_;
    std::int64_t pitch_, rows_, deep_;
    std::vector<C> line_, lines_, ring_, parts_;
    std::vector<C const*> pointers_;
};

template <class C>
void correlate_terms(ConstView in, AnyView out, SeparableSum const& sum, Losses& losses, Execution const& execution) {
    if (out.box.empty()) return;
    Index3 tile = sum.tile();
    Index3 const n = out.dims();
    auto const parts = [](std::int64_t a, std::int64_t b) { return (a + b - 1) / b; };
    std::int64_t const across = parts(n.x, tile.x), along = parts(n.y, tile.y);
    // As deep as leaves every thread some.
    tile.z = std::max(tile.z, parts(n.z * across * along, 4 * std::max(1, execution.threads)));
    auto const work = static_cast<std::int64_t>(static_cast<double>(out.box.voxels()) * sum.cost());
    for_each_tile(execution, threads_for(execution, work), out.box, tile, [&](auto const& each) {
        TermTile<C> terms(in, out, sum);
        Losses mine;
        each([&](Box const& part) { terms.run(part, mine); });
        driver::add(losses, mine);
    });
}

/// Output rows that a kernel without gaps computes together, so that a register of the input serves several of them,
/// and registers of each.
constexpr int rows_together = 4, registers_together = register_bytes == 64 ? 4 : 2;

/// R rows of the correlation with a kernel of width * height * depth weights, none of them 0; height >= R - 1, and the
/// width is `fixed` unless that is 0. Additions are in the order of the weights, whatever R is.
template <class C, int R, int fixed> class Block {
public:
    Block(C const* const* rows, std::int64_t x, C const* weights, Index3 dims)
        : rows_(rows), x_(x - dims.x / 2), weight_(weights), dims_(dims) {}

    void store(C offset, C* to) {
        for (std::int64_t k = 0; k < dims_.z; ++k, weight_ += dims_.y * dims_.x) {
            first_rows(std::make_integer_sequence<int, R - 1>{});
            for (std::int64_t j = R - 1; j < dims_.y; ++j) add<0, R>(j);
            last_rows(std::make_integer_sequence<int, R - 1>{});
            rows_ += dims_.y + R - 1;
        }
        for (int r = 0; r < R; ++r)
            for (int j = 0; j < registers_together; ++j)
                store_lanes(to + r * driver::results_pitch<C> + j * lane_count<C>, sum_[r][j] + all_lanes(offset));
    }

private:
    template <int... i> void first_rows(std::integer_sequence<int, i...>) { (add<0, i + 1>(i), ...); }
    template <int... i> void last_rows(std::integer_sequence<int, i...>) { (add<i + 1, R>(dims_.y + i), ...); }

    /// What row j of a slice of the input adds to output rows first <= r < last.
    template <int first, int last> void add(std::int64_t j) {
        std::int64_t const width = fixed > 0 ? fixed : dims_.x;
        C const* const from = rows_[j] + x_;
        C const* const weight = weight_ + j * width;
        for (std::int64_t i = 0; i < width; ++i) {
            Lanes<C> v[registers_together];
            for (int n = 0; n < registers_together; ++n) v[n] = load_lanes(from + i + n * lane_count<C>);
            for (int r = first; r < last; ++r) {
                Lanes<C> const w = all_lanes(weight[i - r * width]);
                for (int n = 0; n < registers_together; ++n) sum_[r][n] = madd(w, v[n], sum_[r][n]);
            }
        }
    }

    C const* const* rows_; ///< those of the slice
    std::int64_t x_;
    C const* weight_; ///< those of the slice
    Index3 dims_;
    Lanes<C> sum_[R][registers_together] = {};
};

/// The weights of a dense kernel as C.
template <class C> struct DenseWeights {
    std::vector<C> weights;
    C offset, headroom;
    bool overflows; ///< voxels are such as may be too large

    DenseWeights(DenseKernel const& kernel, DataType type)
        : offset(static_cast<C>(kernel.offset)), headroom(static_cast<C>(kernel.headroom())),
          overflows(type == DataType::float32 || type == DataType::float64) {
        for (Tap const& tap : kernel.taps) weights.push_back(static_cast<C>(tap.weight));
    }

    /// Makes those of n sums that are not finite for large voxels again, from voxels times the headroom. from(k) are
    /// the voxels of weight k.
    template <class From> void mend(C* sums, std::int64_t n, From const& from) const {
        if (overflows && !all_finite(sums, n)) make_again(sums, n, from);
    }

private:
    template <class From> [[gnu::noinline]] void make_again(C* sums, std::int64_t n, From const& from) const {
        bool large = false;
        for (std::size_t k = 0; k < weights.size() && !large; ++k) {
            bool const seen = k > 0 && from(k) == from(k - 1) + 1; // but for one
            large = seen ? is_large(from(k)[n - 1], headroom) : any_large(from(k), n, headroom);
        }
        if (!large) return;
        for (std::int64_t x = 0; x < n; ++x) {
            if (is_finite(sums[x])) continue;
            C sum = 0;
            for (std::size_t k = 0; k < weights.size(); ++k) sum = madd(weights[k], from(k)[x] * headroom, sum);
            sums[x] = sum / headroom + offset;
        }
    }
};

template <class C, int R, int fixed>
void correlate_box(ConstView in, AnyView out, DenseKernel const& kernel, Losses& losses, Execution const& execution) {
    Index3 const r = kernel.radius, dims{2 * r.x + 1, 2 * r.y + 1, 2 * r.z + 1};
    driver::for_each_row_of_neighbours<C, R>(execution, out, losses, r, in, [&] {
        return [dims, all = DenseWeights<C>(kernel, in.type)](C const* const* rows, std::int64_t n, C* results) {
            for (std::int64_t x = 0; x < n; x += registers_together * lane_count<C>)
                Block<C, R, fixed>(rows, x, all.weights.data(), dims).store(all.offset, results + x);
            for (std::int64_t row = 0; row < R; ++row)
                all.mend(results + row * driver::results_pitch<C>, n, [&](std::size_t tap) {
                    auto const k = static_cast<std::int64_t>(tap);
                    return rows[k / (dims.x * dims.y) * (dims.y + R - 1) + k / dims.x % dims.y + row] + k % dims.x -
                           dims.x / 2;
                });
        };
    });
}

template <class C>
void correlate_taps(ConstView in, AnyView out, DenseKernel const& kernel, Losses& losses, Execution const& execution) {
    std::int64_t const lines = 2 * kernel.radius.y + 1;
    auto const count = static_cast<std::int64_t>(kernel.taps.size());
    driver::for_each_row_of_neighbours<C>(execution, out, losses, kernel.radius, in, [&] {
        return [&kernel, lines, count, all = DenseWeights<C>(kernel, in.type),
                from = std::vector<C const*>(kernel.taps.size())](C const* const* rows, std::int64_t n,
                                                                  C* results) mutable {
            for (std::size_t k = 0; k < from.size(); ++k) {
                Index3 const at = kernel.taps[k].at;
                from[k] = rows[(at.z + kernel.radius.z) * lines + at.y + kernel.radius.y] + at.x;
            }
            C const* const* const of = from.data();
            sum_of(results, n, false, all.weights.data(), 0, count,
                   [of](std::int64_t k, std::int64_t x) { return load_lanes(of[k] + x); });
            if (kernel.offset != 0)
                for (std::int64_t x = 0; x < n; ++x) results[x] += all.offset;
            all.mend(results, n, [of](std::size_t k) { return of[k]; });
        };
    });
}

/// Kernels without gaps take blocks of rows. A weight of 0 is one: it would make NaN of what is not finite.
template <class C>
void correlate_any(ConstView in, AnyView out, DenseKernel const& kernel, Losses& losses, Execution const& execution) {
    Index3 const r = kernel.radius;
    bool const gaps = static_cast<std::int64_t>(kernel.taps.size()) != (2 * r.x + 1) * (2 * r.y + 1) * (2 * r.z + 1);
    if (gaps || r.y == 0 || out.dims().y < rows_together) return correlate_taps<C>(in, out, kernel, losses, execution);
    constexpr int R = rows_together;
    switch (r.x) {
    case 1:
        return correlate_box<C, R, 3>(in, out, kernel, losses, execution);
    case 2:
        return correlate_box<C, R, 5>(in, out, kernel, losses, execution);
    default:
        return correlate_box<C, R, 0>(in, out, kernel, losses, execution);
    }
}

} // namespace

void correlate(ConstView in, AnyView out, SeparableSum const& sum, Losses& losses, Execution const& execution) {
    if (sum.wide)
        correlate_terms<double>(in, out, sum, losses, execution);
    else
        correlate_terms<float>(in, out, sum, losses, execution);
}

void correlate_dense(ConstView in, AnyView out, DenseKernel const& kernel, Losses& losses, Execution const& execution) {
    if (kernel.wide)
        correlate_any<double>(in, out, kernel, losses, execution);
    else
        correlate_any<float>(in, out, kernel, losses, execution);
}

} // namespace VKT_BACKEND

} // namespace vkt
