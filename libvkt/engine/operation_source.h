// One operation as a source: plans per volume, fetches footprints through windows, spools where it must, runs.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/cut.h"
#include "libvkt/engine/line_passes.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/spool.h"
#include "libvkt/engine/tree_run.h"
#include "libvkt/engine/window.h"

namespace vkt {

class OperationSource : public Source {
public:
    OperationSource(std::vector<std::unique_ptr<Source>> inputs, Operation& operation, Execution const& execution,
                    StageInfo info);

    bool next_volume() override;
    Header const& header() const override { return plan_.output; }
    Access access() const override;
    void read(AnyView out) override;
    std::optional<ConstView> borrow(Box const& region) override;
    std::shared_ptr<Lease> lease(Box const& region) override;
    BrickSequence take_bricks() override;
    void expect(Box const& region) override;
    bool divisible(bool ascending) const override;
    void count_only(std::int64_t begin, std::int64_t end) override;
    std::int64_t natural_slab() const override;
    /// What is handed through lies where the input lies, what is spooled on the host.
    Space space() const override {
        return tree_ || made_ || work_.bands ? Space::host
               : plan_.shift                 ? inputs_.front()->space()
                                             : execution_.space();
    }
    void finish() override;

private:
    /// An input as the operation sees it: the source itself, or a spool of its current volume.
    class Input : public Source {
    public:
        explicit Input(std::unique_ptr<Source> source) : source_(std::move(source)) {}
        bool next_volume() override;
        /// After the end of a sequence of one volume: that volume again, if it can be had.
        bool repeat();
        Header const& header() const override { return prepared_ ? *prepared_ : source_->header(); }
        Access access() const override { return spool_ ? Access::random : source_->access(); }
        void read(AnyView out) override;
        std::optional<ConstView> borrow(Box const& region) override;
        std::shared_ptr<Lease> lease(Box const& region) override;
        void expect(Box const& region) override;
        bool divisible(bool ascending) const override { return !spool_ && source_->divisible(ascending); }
        void count_only(std::int64_t begin, std::int64_t end) override { source_->count_only(begin, end); }
        std::int64_t natural_slab() const override { return source_->natural_slab(); }
        Space space() const override { return spool_ ? spool_->space() : source_->space(); }
        BrickSequence take_bricks() override { return source_->take_bricks(); }
        void finish() override;
        /// Reads all of the current volume and keeps it, in memory up to so many bytes.
        void spool(std::size_t in_memory, Execution const& execution, StageInfo const& info);
        /// The current volume becomes what an operation makes of it. It has to be spooled before it is read.
        void prepare(Operation& by, Execution const& execution, StageInfo const& info);
        bool prepared() const { return prepared_.has_value(); }
        /// True if all of the volume lies in memory already.
        bool in_memory();

        Window window;

    private:
        std::unique_ptr<Source> source_;
        std::unique_ptr<Source> preparing_; ///< until it is spooled
        std::optional<Header> prepared_;
        std::unique_ptr<Spool> spool_;
        std::int64_t volumes_ = 0;
    };

    void plan_volume();
    void settle_error(std::vector<Header> const& headers, bool scanned);
    void prepare_inputs(std::vector<Header> const& headers);
    void compute_bands();
    void compute_lines(LinePasses& passes);
    void on_lines(AnyView voxels, LinePasses& passes, Axis axis);
    void run_on_tree(std::vector<Header> const& headers);
    void change_kind(Header const& input);
    void scan();
    void compute(AnyView out);
    void run_in_pieces(AnyView out);
    void run_in_order(AnyView out);
    bool descends(Box const& region) const;
    void run_on_gpu(AnyView out);
    void run(AnyView out);
    void tell_remarks() const;
    void run_counted(AnyView out);
    void run_uncounted(AnyView out);
    void compute_region(AnyView out);
    /// Bytes that a window may hold: it may need a second buffer to slide, and there is a result, too.
    double share_of_memory() const { return static_cast<double>(requested_.memory) / 4; }
    ConstView fetch(std::size_t i, Box const& footprint);
    Box moved(Box const& region) const { return {region.lower + *plan_.shift, region.upper + *plan_.shift}; }

    std::vector<std::unique_ptr<Input>> inputs_;
    Operation& operation_;
    Execution requested_, execution_;
    StageInfo info_;
    Plan plan_;
    std::unique_ptr<TreeRun> tree_; ///< if input and result are hierarchical
    std::optional<Volume> made_;    ///< a result that the operation made as a whole
    bool inputs_used_up_ = false;   ///< they were read as a whole, and finished
    WorkPlan work_;
    std::unique_ptr<Spool> result_;        ///< if it is computed in bands
    Buffer staging_, passed_;              ///< …, and what nobody asked for but what follows needs
    Buffer ahead_;                         ///< on the GPU: what was computed there, of which some was asked for
    Box ahead_box_;                        ///< …, empty if there is none
    bool begins_ = true;                   ///< nothing was read of the volume yet, or of what is expected
    std::int64_t expected_end_ = 0;        ///< no slices are asked for from there on
    std::int64_t done_y_ = 0, done_z_ = 0; ///< if run() keeps what came before: the row that it computes next
    bool generated_ = false;               ///< a source operation yields exactly one volume
    struct Slices {
        std::int64_t begin, end;
    };
    std::optional<Slices> counted_; ///< in remarks, if others compute the rest
    Slices seen_{0, 0};             ///< counted already: several passes over a volume count once
};

} // namespace vkt
