// Connected components of a volume whose rows come in order, once to be joined and again to be named.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/large_vector.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/shape/kernels/component_facts.h"
#include "libvkt/operations/shape/kernels/touching_runs.h"
#include "libvkt/operations/voxels/kernels/bits.h"

#include <optional>
#include <span>
#include <vector>

namespace vkt {

/// Joins runs (neighbouring voxels of a row that belong together) by union-find. What is kept of a volume is one number
/// a run, a few a component, and the runs of one slice and a row. Components are numbered by their first voxel in
/// x-fastest order: slabs and threads make no difference.
class Components {
public:
    struct Rules {
        int connectivity = 6;              ///< 6: faces, 18: faces and edges, 26: corners as well
        bool by_value = false;             ///< only equal values belong together
        BitRule members = BitRule::object; ///< which voxels form components
        std::optional<double> zero;        ///< the stored zero
        bool keeps_value_before = false;   ///< ComponentFacts::value_before is wanted
    };

    using Component = ComponentFacts;

    /// Bytes that are held whatever the voxels are.
    static std::size_t table_bytes(Index3 dims);

    /// Starts a volume. Throws Error{resources} for extents from 2^31 on.
    void begin(Index3 dims, Rules const& rules);
    /// The next rows of the volume: whole slices, or rows of one. Throws Error{resources} where tables outgrow the
    /// budget.
    void add(ConstView rows, Execution const& execution);
    /// All rows have come: components are numbered from 0.
    void end();

    LargeVector<Component> const& found() const { return components_; }
    /// Gives every component a name, which for_each_row() tells. Once, after end().
    void rename(std::vector<std::uint32_t> const& names, int threads);

    /// Calls visit(y, z, edges, names) for each of these rows, in any order and from several threads. They must be as
    /// wide as the volume and hold what they held in add(). Run i begins at edges[2 i], ends before edges[2 i + 1] and
    /// belongs to the component of the name names[i].
    template <class Visit> void for_each_row(ConstView rows, Execution const& execution, Visit const& visit) const;

private:
    void add_piece(ConstView rows, Execution const& execution);
    /// Runs of neighbouring rows, and how they are joined.
    struct Runs {
        LargeVector<std::int32_t> edges;      ///< first and beyond the last voxel, of all runs
        LargeVector<std::uint64_t> bits;      ///< of rows, unless values matter
        LargeVector<std::uint64_t> values;    ///< of runs, if they matter
        LargeVector<std::uint32_t> component; ///< provisional, of runs
        std::vector<std::size_t> begin;       ///< first run of each row, and one beyond the last
        std::int64_t first_row = 0;           ///< in x-fastest order

        std::int64_t rows() const { return static_cast<std::int64_t>(begin.size()) - 1; }
        std::size_t bytes() const;
        void clear(std::int64_t row);
        void drop_before(std::int64_t row, std::int64_t words);
        void append(Runs const& next, std::uint32_t components);
    };
    struct Chunk {
        Runs runs;
        LargeVector<std::uint32_t> parent;
        LargeVector<Component> components;
        std::vector<std::uint64_t> bits;
        std::vector<std::int32_t> row; ///< edges
        std::vector<RunPair> pairs;    ///< of two rows
    };

    void find_runs(ConstView rows, std::int64_t begin, std::int64_t end, Execution const& execution,
                   Chunk& chunk) const;
    VoxelBytes voxel_before(ConstView rows, std::int64_t x, std::int64_t y, std::int64_t z) const;
    void join_within(ConstView rows, Chunk& chunk, Execution const& execution) const;
    void join_across(std::int64_t row, std::int64_t beyond, Execution const& execution);
    template <class Join>
    void join_rows(Runs const& runs, std::int64_t row, std::int64_t least, std::int64_t beyond,
                   std::vector<RunPair>& pairs, Execution const& execution, Join const& join) const;
    template <class Join>
    void join_values(Runs const& runs, std::int64_t row, std::int64_t other, std::int32_t reach,
                     Join const& join) const;
    std::size_t edges_of(std::uint64_t const* bits, std::uint64_t const* changed, std::int32_t* edges) const;

    Index3 dims_;
    Rules rules_;
    Runs kept_;                         ///< the rows that the next ones may touch
    std::vector<RunPair> pairs_;        ///< of two of them
    VoxelBytes last_voxel_{};           ///< of the rows so far
    LargeVector<std::uint32_t> parent_; ///< of provisional components
    LargeVector<Component> components_;
    LargeVector<std::uint32_t> run_names_; ///< of all runs of the volume
    std::vector<std::uint32_t> row_begin_; ///< first run of each row, from that of its slice on
    std::vector<std::uint64_t> slice_begin_;
    std::vector<Chunk> chunks_;
};

template <class Visit>
void Components::for_each_row(ConstView rows, Execution const& execution, Visit const& visit) const {
    Index3 const n = rows.dims();
    Execution alone = execution;
    alone.threads = 1;
    VKT_BACKEND::for_each_item(
        VKT_BACKEND::threads_for(execution, rows.box.voxels()), n.y * n.z, [&](std::int64_t begin, std::int64_t end) {
            std::int64_t const words = bit_words(n.x);
            std::vector<std::uint64_t> bits(static_cast<std::size_t>(words * (rules_.by_value ? 2 : 1)));
            std::vector<std::int32_t> edges(2 * static_cast<std::size_t>(n.x) + 2);
            for (std::int64_t r = begin; r < end; ++r) {
                VKT_BACKEND::tell_progress(execution, begin, r, end);
                std::int64_t const y = rows.box.lower.y + r % n.y, z = rows.box.lower.z + r / n.y;
                ConstView const row = rows.part({{rows.box.lower.x, y, z}, {rows.box.upper.x, y + 1, z + 1}});
                pack_bits(row, rules_.members, rules_.zero, bits.data(), alone);
                if (rules_.by_value) pack_bits(row, BitRule::changed, {}, bits.data() + words, alone);
                std::size_t const count =
                    edges_of(bits.data(), rules_.by_value ? bits.data() + words : nullptr, edges.data());
                std::uint32_t const* name = run_names_.data() + slice_begin_[static_cast<std::size_t>(z)] +
                                            row_begin_[static_cast<std::size_t>(y + z * dims_.y)];
                visit(y, z, std::span<std::int32_t const>(edges.data(), count), name);
            }
            VKT_BACKEND::stream_fence(); // for visitors that write around the caches
        });
}

} // namespace vkt
