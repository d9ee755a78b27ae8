// CLAHE: contrast-limited adaptive histogram equalisation in three dimensions.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/engine/tunable.h"
#include "libvkt/engine/verifiable.h"
#include "libvkt/operations/filter/kernels/clahe.h"
#include "libvkt/operations/statistics/bins.h"
#include "libvkt/operations/statistics/range_option.h"
#include "libvkt/operations/statistics/voxel_counts.h"

namespace vkt {

template <> struct EnumNames<ClipRule> {
    static std::vector<std::pair<ClipRule, char const*>> all() {
        return {{ClipRule::opencv, "opencv"},
                {ClipRule::skimage, "skimage"},
                {ClipRule::volkit, "volkit"},
                {ClipRule::pizer, "pizer"}};
    }
};

/// Cuts the volume into equal bricks, equalises the histogram of each after limiting it, and maps every voxel by the
/// curves of the eight bricks around it, interpolated trilinearly (Pizer et al., "Adaptive histogram equalization and
/// its variations", 1987; Zuiderveld, "Contrast limited adaptive histogram equalization", 1994).
///
/// The window (by default from the smallest to the largest finite value) is cut into bins, curves are straight within
/// them, and results are in the same window and type: without contrast to gain a voxel keeps its value. Values outside
/// the window count, and become, its nearest end; NaN does not count and stays. Bricks are of equal size whether or not
/// they divide the volume: voxels across a face belong to both sides in proportion. So the result of a mirrored volume
/// is the mirrored result, up to rounding. A window of a single value leaves the volume as it is.
///
/// Two passes, one more for the extremes and up to four more for percentiles of the window. Memory: 12 to 28 bytes a
/// bin and brick. Counts are exact; curves and voxels are computed in float32, of 32- and 64-bit types in float64.
class Clahe : public Operation, public Tunable, public Verifiable {
public:
    std::string_view name() const override { return "clahe"; }
    Shape shape() const override { return Shape::neighbourhood; }
    Texts texts() const override;
    void parameters(Parameters& parameters) override;
    std::vector<Knob> knobs() const override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Box scanned(Box const&) const override { return window_.field.grid.box; }
    void scan(ConstView slab, Execution const& execution) override;
    void scan_end() override;
    bool scans_again() const override { return scans_again_; }
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }
    bool scans_on_gpu() const override { return true; }
    std::vector<std::int64_t*> counters() override { return losses_.counters(); }
    std::vector<Remark> remarks() const override;
    /// For windows from the smallest to the largest value.
    std::optional<WrongVoxel> wrong_voxel(ConstView input, ConstView output) const override;

private:
    /// What voxels are mapped by but the curves.
    struct Window {
        ClaheField field;
        Bins bins;
        bool copies = false; ///< it is a single value: nothing changes
    };
    double clip() const;
    /// Without its ends, unless these are known before.
    Window window_for(Header const& in, RangeScan const& ends) const;
    void set_ends(Window& window, DataType type, StoredValue low, StoredValue high) const;
    void make_curves();

    std::optional<double> clip_;
    ClipRule rule_ = ClipRule::opencv;
    Index3 bricks_{8, 8, 8};
    int bin_count_ = 256;
    RangeOption range_{{true, Number(0)}, {true, Number(100)}};
    Roi roi_;

    Header input_;
    ErrorBound error_; ///< as planned
    std::optional<RangeScan> ends_;
    bool ends_known_ = false, scans_again_ = false;
    Window window_;
    Execution scanned_with_;
    VoxelCounts counts_;
    Buffer curves_;
    Losses losses_;
};

} // namespace vkt
