// Choosing pieces by what they would take.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/cut.h"

#include "libvkt/core/device.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/line_passes.h"
#include "libvkt/engine/window.h"

namespace vkt {
namespace {

/// A slab this large for every four threads, up to sixteen, amortises system calls and hand-over and still stays in the
/// caches on its way (measured: on 2 processors 2 MiB are slower than 1, on 16 1 MiB is slower than 4).
constexpr std::size_t slab_bytes = std::size_t{1} << 20;
/// A GPU works on more at once: what neighbouring slabs share is computed, or moved, again for each of them.
constexpr std::size_t slab_bytes_on_gpu = std::size_t{64} << 20;
/// The share of a GPU's memory that what one piece looks at may take: several stages hold some, and some of them more
/// than once.
constexpr std::size_t gpu_share = 32;
constexpr std::size_t least_budget = std::size_t{4} << 20;

std::size_t budget(Execution const& execution) { return std::max(execution.memory, least_budget); }

std::size_t natural_bytes(Execution const& execution) {
    if (execution.device == Device::gpu) return slab_bytes_on_gpu; // what goes there or comes from there waits less
    return static_cast<std::size_t>(std::min(share_of_threads(execution.threads), 4)) * slab_bytes;
}

std::size_t row_bytes(Header const& header) { return static_cast<std::size_t>(header.dims.x) * size_of(header.dtype); }

std::int64_t times(std::size_t bytes, std::size_t unit) { return static_cast<std::int64_t>(bytes / unit); }

[[noreturn]] void beyond(std::string const& what, double bytes, Execution const& execution) {
    std::string const needed = bytes_text(bytes), allowed = bytes_text(static_cast<double>(execution.memory));
    throw Error(ErrorKind::resources,
                text(what, " needs ", needed == allowed ? "a little more than " : "", needed,
                     " of memory at once, the budget is ", allowed),
                "raise --memory, or make the volume smaller with 'vkt crop' or 'vkt resample'");
}

/// Sizes up pieces for one operation on one volume.
class Sizes {
public:
    Sizes(Operation& operation, Plan const& plan, std::span<Header const> inputs, std::vector<bool> const& lent,
          Execution const& execution, bool cuts_along_x = false)
        : operation_(operation), plan_(plan), inputs_(inputs), lent_(lent), execution_(execution),
          cuts_along_x_(cuts_along_x) {}

    Index3 dims() const { return plan_.output.dims; }

    /// What pieces of this cut take at most: pieces at both ends and in the middle are looked at.
    WorkPlan of(Cut cut, int threads) const {
        WorkPlan work;
        work.cut = cut;
        work.threads = threads;
        work.window.assign(inputs_.size(), 0);
        Index3 const n = dims();
        Execution execution = execution_;
        execution.threads = threads;
        work.bytes = plan_.state_bytes + operation_.fit({n.x, cut.rows, cut.slices}, execution);
        if (plan_.shift) return work;
        for (std::int64_t z : {std::int64_t{0}, (n.z - cut.slices) / 2, n.z - cut.slices})
            for (std::int64_t y : {std::int64_t{0}, (n.y - cut.rows) / 2, n.y - cut.rows})
                for (std::size_t i = 0; i < inputs_.size(); ++i)
                    if (!lent(i)) work.window[i] = std::max(work.window[i], wanted(i, piece(cut, y, z)));
        if (cuts_along_x_) {
            Index3 const middle{n.x / 2, n.y / 2, n.z / 2};
            for (std::size_t i = 0; i < inputs_.size(); ++i)
                work.window[i] = std::min(
                    work.window[i], std::max(execution_.memory / 4, wanted(i, {middle, middle + Index3{1, 1, 1}})));
        }
        for (std::size_t const window : work.window) work.bytes += window;
        return work;
    }

    /// The same with as many threads as fit the limit, but no fewer than `least`; what that takes if they do not fit.
    WorkPlan within(std::size_t limit, Cut cut, int least) const {
        WorkPlan work = of(cut, execution_.threads);
        if (work.bytes <= limit) return work;
        work = of(cut, least);
        if (work.bytes > limit) return work;
        int fits = least, beyond = execution_.threads;
        while (beyond - fits > 1) {
            int const middle = fits + (beyond - fits) / 2;
            (of(cut, middle).bytes <= limit ? fits : beyond) = middle;
        }
        return of(cut, fits);
    }

    /// Bytes of inputs that are read beyond once each, if all pieces of this cut are computed.
    double read_again(Cut cut) const {
        Index3 const n = dims();
        Box const middle = piece(cut, (n.y - cut.rows) / 2, (n.z - cut.slices) / 2);
        double const pieces = static_cast<double>(plan_.output.voxels()) /
                              static_cast<double>(std::max<std::int64_t>(1, middle.voxels()));
        double bytes = 0;
        for (std::size_t i = 0; i < inputs_.size(); ++i)
            bytes += std::max(0.0, pieces * static_cast<double>(wanted(i, middle)) -
                                       static_cast<double>(wanted(i, box_of(n))));
        return bytes;
    }

    /// Bytes of the inputs that a piece in the middle is made of.
    double read_for(Cut cut) const {
        Index3 const n = dims();
        double bytes = 0;
        for (std::size_t i = 0; i < inputs_.size(); ++i)
            bytes += static_cast<double>(wanted(i, piece(cut, (n.y - cut.rows) / 2, (n.z - cut.slices) / 2)));
        return bytes;
    }

    /// True if no piece needs what lies in an input before the end of what the piece before it needed.
    bool ascending(Cut cut) const {
        Index3 const n = dims();
        Box const some{{0, 0, 0}, {n.x, n.y, std::min(n.z, 2 * cut.slices)}};
        std::vector<Box> last(inputs_.size());
        bool result = true;
        for_each_piece(some, cut, [&](Box const& box) {
            for (std::size_t i = 0; i < inputs_.size() && !plan_.shift; ++i) {
                Box const want = operation_.footprint(box, static_cast<int>(i));
                bool const row_wise = want.dims().z == 1 && want.lower.z == last[i].lower.z && last[i].dims().z == 1 &&
                                      want.lower.y >= last[i].upper.y;
                result = result && (row_wise || want.lower.z >= last[i].upper.z);
                last[i] = want;
            }
        });
        return result;
    }

private:
    bool lent(std::size_t i) const { return i < lent_.size() && lent_[i]; }
    Box piece(Cut cut, std::int64_t y, std::int64_t z) const {
        Index3 const n = dims();
        return intersect({{0, y, z}, {n.x, y + cut.rows, z + cut.slices}}, box_of(n));
    }
    std::size_t wanted(std::size_t i, Box const& box) const {
        Box const footprint = operation_.footprint(box, static_cast<int>(i));
        if (footprint.empty()) return 0;
        WindowRule rule{.volume_dims = inputs_[i].dims, .boundary = plan_.boundary};
        if (plan_.access == Access::forward) rule.expect(operation_.footprint(box_of(dims()), static_cast<int>(i)));
        return static_cast<std::size_t>(rule.with_mirrored(footprint).voxels()) * size_of(inputs_[i].dtype);
    }

    Operation& operation_;
    Plan const& plan_;
    std::span<Header const> inputs_;
    std::vector<bool> const& lent_;
    Execution const& execution_;
    /// Pieces that look at more than a quarter of the memory are cut on, down to single voxels: the engine does so for
    /// what jumps.
    bool cuts_along_x_;
};

} // namespace

std::size_t piece_limit(Execution const& execution) { return budget(execution) / 16; }

std::size_t spool_limit(std::size_t inputs, Execution const& execution) {
    return execution.memory / 2 / std::max<std::size_t>(1, inputs);
}

Cut cut_of(Header const& header, std::int64_t hint, Execution const& execution) {
    Index3 const n = header.dims;
    std::size_t const row = row_bytes(header), slice = row * static_cast<std::size_t>(n.y),
                      limit = piece_limit(execution);
    if (row > 2 * limit) // several pieces are in flight
        beyond(text("a volume with rows of ", bytes_text(static_cast<double>(row))), 8.0 * static_cast<double>(row),
               execution);
    if (slice > limit) return {1, std::clamp<std::int64_t>(times(limit, row), 1, n.y)};
    std::int64_t const asked = execution.slab > 0 ? execution.slab : hint;
    std::int64_t const slices = asked > 0 ? asked : times(natural_bytes(execution), slice);
    return {std::clamp<std::int64_t>(slices, 1, std::min(n.z, times(limit, slice))), n.y};
}

std::int64_t slab_hint_on(Execution const& execution, Header const& header, std::int64_t hint) {
    std::size_t const slice = row_bytes(header) * static_cast<std::size_t>(header.dims.y);
    if (execution.device != Device::gpu || slice == 0) return hint;
    return std::max(hint, times(slab_bytes_on_gpu, slice));
}

bool PieceOrder::takes(Box const& piece) const {
    if (piece.empty() || piece.lower != Index3{0, y_, z_} || piece.upper.x != dims_.x || piece.upper.y > dims_.y ||
        piece.upper.z > dims_.z)
        return false;
    return piece.upper.z == z_ + 1 || (y_ == 0 && piece.upper.y == dims_.y);
}

void PieceOrder::advance(Box const& piece) {
    y_ = piece.upper.y < dims_.y ? piece.upper.y : 0;
    z_ = y_ == 0 ? piece.upper.z : piece.lower.z;
}

namespace {

/// Pieces of the input and blocks of lines that keep half of the budget, as few as that allows up to a size that makes
/// no more difference.
class LinesPlan {
public:
    LinesPlan(Operation& operation, LinePasses const& passes, Plan const& plan, Execution const& execution)
        : operation_(operation), plan_(plan), execution_(execution), region_(passes.lines().dims()),
          together_(std::min(passes.lines_together(), region_.x)), voxel_(size_of(plan.output.dtype)) {}

    WorkPlan of(Header const& input, bool lent) {
        WorkPlan work;
        work.bands = true; // the result is kept
        work.lines.emplace();
        held_ = choose_threads(work);
        std::size_t const limit = budget(execution_) / 2;
        if (held_ + least() > limit) refuse(least());
        left_ = limit - held_;
        std::size_t const in = lent ? 0 : size_of(input.dtype);
        work.cut = pieces(in + voxel_);
        if (work.cut.rows < plan_.output.dims.y && !region_empty())
            work.lines->along_y = {columns(region_.y), region_.y, 1};
        if (!region_empty()) work.lines->along_z = block_along_z();
        auto const rows = static_cast<std::size_t>(work.cut.rows * work.cut.slices);
        std::size_t const row = static_cast<std::size_t>(plan_.output.dims.x);
        work.window = {row * rows * in};
        work.bytes = held_ + std::max({row * rows * (in + voxel_), bytes_of(work.lines->along_y),
                                       bytes_of(work.lines->along_z)});
        return work;
    }

private:
    bool region_empty() const { return box_of(region_).empty(); }
    std::size_t bytes_of(Index3 n) const { return static_cast<std::size_t>(n.x * n.y * n.z) * voxel_; }

    /// Lines that are worked on together, the longest.
    std::size_t least() const { return bytes_of({together_, 1, std::max(region_.y, region_.z)}); }

    /// What the operation holds itself with as many threads as leave room for voxels.
    std::size_t choose_threads(WorkPlan& work) {
        Execution execution = execution_;
        while (true) {
            std::size_t const held = plan_.state_bytes + operation_.fit(plan_.output.dims, execution);
            work.threads = execution.threads;
            bool const fits = held <= budget(execution_) / 4 && held + least() <= budget(execution_) / 2;
            if (execution.threads <= 1 || fits) return held;
            execution.threads = (execution.threads + 1) / 2;
        }
    }

    [[noreturn]] void refuse(std::size_t bytes) const {
        beyond(text(operation_.name(), " on these volumes"), 2 * static_cast<double>(bytes + held_), execution_);
    }

    /// Slabs, or rows of a slice that is too large, of so many bytes a voxel.
    Cut pieces(std::size_t voxel) const {
        Index3 const n = plan_.output.dims;
        std::size_t const row = static_cast<std::size_t>(n.x) * voxel, slice = row * static_cast<std::size_t>(n.y);
        Cut cut = cut_of(plan_.output, slab_hint_on(execution_, plan_.output, 0), execution_);
        if (slice <= left_) return {std::clamp<std::int64_t>(times(left_, slice), 1, cut.slices), n.y};
        if (row > left_) refuse(row);
        return {1, std::min(cut.rows, times(left_, row))};
    }

    /// How many neighbouring lines of this length come at once.
    std::int64_t columns(std::int64_t length) const {
        std::size_t const line = static_cast<std::size_t>(length) * voxel_;
        std::int64_t const fit = times(left_, line);
        if (fit >= region_.x) return region_.x;
        return fit / together_ * together_;
    }

    Index3 block_along_z() const {
        constexpr std::size_t read_at_once = std::size_t{256} << 10; // more at a time is no faster
        std::size_t const row = static_cast<std::size_t>(region_.x) * voxel_;
        std::int64_t const fit = times(left_, row * static_cast<std::size_t>(region_.z));
        if (fit == 0) return {columns(region_.z), 1, region_.z};
        std::int64_t const most = std::max<std::int64_t>(1, times(read_at_once, row));
        return {region_.x, std::min({fit, most, region_.y}), region_.z};
    }

    Operation& operation_;
    Plan const& plan_;
    Execution const& execution_;
    Index3 region_;
    std::int64_t together_;
    std::size_t voxel_;
    std::size_t held_ = 0; ///< bytes for what the operation holds itself
    std::size_t left_ = 0; ///< … and for voxels
};

/// All at once, with as many threads as fit; what works on lines goes through the spool, and all else is refused.
WorkPlan whole_plan(Operation& operation, Plan const& plan, std::span<Header const> inputs,
                    std::vector<bool> const& lent, Execution const& execution) {
    auto const is_lent = [&](std::size_t i) { return i < lent.size() && lent[i]; };
    WorkPlan work;
    work.cut = {plan.output.dims.z, plan.output.dims.y};
    work.bands = true; // the result is kept
    std::size_t volumes = 0;
    for (std::size_t i = 0; i < inputs.size(); ++i) {
        work.window.push_back(inputs[i].bytes());
        if (!is_lent(i)) volumes += inputs[i].bytes();
    }
    double needed = 0;
    Execution with = execution;
    for (;; with.threads = (with.threads + 1) / 2) {
        work.threads = with.threads;
        work.bytes = plan.state_bytes + operation.fit(plan.output.dims, with) + volumes;
        needed = static_cast<double>(work.bytes) + static_cast<double>(plan.output.bytes());
        if (needed <= static_cast<double>(budget(execution))) return work;
        if (with.threads <= 1) break;
    }
    if (auto const* const passes = dynamic_cast<LinePasses const*>(&operation))
        return LinesPlan(operation, *passes, plan, execution).of(inputs[0], is_lent(0));
    beyond(text(operation.name(), ", which works on whole volumes,"), needed, execution);
}

/// Slabs for a GPU: higher as long as what neighbours share is most of what they are made of, since all of it is moved
/// and computed again for each.
Cut higher_slabs(Sizes const& sizes, Cut cut, Index3 dims, Execution const& execution) {
    if (execution.device != Device::gpu || execution.slab > 0 || cut.rows < dims.y || gpu_count() <= execution.gpu)
        return cut;
    auto const most =
        static_cast<double>(std::min(piece_limit(execution), device_facts(execution.gpu).memory / gpu_share));
    for (Cut twice = cut; cut.slices < dims.z; cut = twice) {
        twice.slices = std::min(2 * cut.slices, dims.z);
        double const bytes = sizes.read_for(twice);
        if (bytes > most || bytes > 1.5 * sizes.read_for(cut)) break;
    }
    return cut;
}

} // namespace

WorkPlan work_plan(Operation& operation, Plan const& plan, std::span<Header const> inputs,
                   std::vector<bool> const& lent, std::size_t spooled, Execution const& execution) {
    if (plan.whole) return whole_plan(operation, plan, inputs, lent, execution);
    std::size_t const limit = budget(execution) / (spooled > 0 ? 4 : 2);
    Sizes const sizes(operation, plan, inputs, lent, execution);
    Index3 const n = plan.output.dims;
    Cut cut = cut_of(plan.output, slab_hint_on(execution, plan.output, plan.slab_hint), execution);
    if (!plan.shift && !inputs.empty()) cut = higher_slabs(sizes, cut, n, execution);
    if (cut.rows == n.y) {
        // Slices as they come are worth threads, but not most of them.
        int const share = share_of_threads(execution.threads);
        for (int least = execution.threads;; least = share) {
            for (Cut slab = cut;; slab.slices = (slab.slices + 1) / 2) {
                WorkPlan work = sizes.within(limit, slab, least);
                if (work.bytes <= limit) return work;
                if (slab.slices == 1) break;
            }
            if (least == share) break;
        }
    }
    std::size_t const row = row_bytes(plan.output);
    std::size_t const most = std::min(piece_limit(execution), natural_bytes(execution));
    auto const in_pieces_of = [&](Sizes const& of, int least, std::size_t allowed) {
        Cut piece = cut;
        for (bool first = true;; first = false) {
            // At first the rows of a slice that is too large itself, then ever fewer.
            if (!first || piece.rows == n.y) {
                if (piece.rows == 1) return of.of({1, 1}, least);
                piece.rows = (piece.rows + 1) / 2;
            }
            piece.slices = std::clamp<std::int64_t>(times(most, row * static_cast<std::size_t>(piece.rows)), 1, n.z);
            if (plan.slab_hint > 0) piece.slices = std::min(piece.slices, plan.slab_hint);
            for (std::int64_t const slices : {piece.slices, std::int64_t{1}}) {
                piece.slices = slices;
                WorkPlan work = of.within(allowed, piece, least);
                if (work.bytes <= allowed) return work;
            }
        }
    };
    auto const in_pieces = [&](int least, std::size_t allowed) { return in_pieces_of(sizes, least, allowed); };
    // Half is left to pieces in flight, three at each end. Where nothing else does, the rest is what these leave.
    std::size_t const in_flight = 3 * (inputs.size() + 1) * piece_limit(execution);
    std::size_t const rest =
        spooled > 0 ? limit : std::max(limit, budget(execution) - std::min(budget(execution), in_flight));
    WorkPlan work = in_pieces(execution.threads, limit);
    if (work.bytes > limit) work = in_pieces(1, limit);
    if (work.bytes > limit) work = in_pieces(1, rest);
    if (work.bytes > rest && plan.access == Access::random)
        work = in_pieces_of(Sizes(operation, plan, inputs, lent, execution, true), 1, rest);
    if (work.bytes > rest)
        beyond(text(operation.name(), " on these volumes"), static_cast<double>(work.bytes + budget(execution) - rest),
               execution);
    cut = work.cut;
    // Going through all slices band by band needs the result twice on its way; going slice by slice, what the pieces
    // have in common again and again.
    work.bands = plan.access == Access::forward && cut.slices < n.z &&
                 sizes.read_again(cut) > 2 * static_cast<double>(plan.output.bytes());
    if (work.bands) {
        work.jumps = true;
    } else if (sizes.ascending({1, cut.rows})) {
        work = sizes.of({1, cut.rows},
                        work.threads); // whatever is asked for, it is computed row by row through its slices
    } else {
        work.jumps = true;
    }
    return work;
}

} // namespace vkt
