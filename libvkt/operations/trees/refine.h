// Refine: a structured volume as a hierarchical one, with fine bricks only where the voxels need them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/refine.h"
#include "libvkt/core/read_once.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/tunable.h"
#include "libvkt/operations/voxels/convert.h"

namespace vkt {

namespace render {
struct TransferFunction;
}

/// A physical value, or as much as the noise of the volume.
struct RefineTolerance {
    double value = 0;
    bool noise = false;
};
template <> struct ValueText<RefineTolerance> : OneWord {
    static RefineTolerance read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(RefineTolerance v) { return {v.noise ? "noise" : to_text(v.value)}; }
};

/// Cells of a block along each axis; or mixed: blocks of 2 cells, joined to larger ones where all of these have one
/// level; or the best of 4, 8, 16 and mixed.
struct BlockSize {
    std::int64_t cells = 8;
    bool mixed = false, best = false;
};
template <> struct ValueText<BlockSize> : OneWord {
    static BlockSize read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(BlockSize v) {
        return {v.best ? "auto" : v.mixed ? "mixed" : to_text(v.cells)};
    }
};

/// What becomes of the type of the cells.
enum class CellType : std::uint8_t {
    keep,
    automatic, ///< the smallest that a quarter of the tolerance allows
};
template <> struct EnumNames<CellType> {
    static std::vector<std::pair<CellType, char const*>> all() {
        return {{CellType::keep, "keep"}, {CellType::automatic, "auto"}};
    }
};

/// What is to differ by no more than the tolerance.
enum class RefineMetric : std::uint8_t {
    value,    ///< physical values
    gradient, ///< each component of the gradient, in physical values per world unit
    transfer, ///< display levels, 0 to 255, of a layer of unit thickness under a transfer function
};
template <> struct EnumNames<RefineMetric> {
    static std::vector<std::pair<RefineMetric, char const*>> all() {
        return {
            {RefineMetric::value, "value"}, {RefineMetric::gradient, "gradient"}, {RefineMetric::transfer, "transfer"}};
    }
};

/// What resampling makes of the result at the voxels' centres differs by no more than the tolerance; see
/// vkt::refine(). With an automatic type voxels are first stored in the smallest type whose error makes no more than a
/// quarter of the tolerance of what the metric looks at, see Convert; what that leaves is for the bricks. Under a
/// transfer function a difference of two values is the way that colour times opacity, or opacity, goes between them
/// (that of the four that goes furthest, at every value): what is interpolated between voxels then differs by no more
/// either. The volume is held whole, since a tree has no slabs: its size and 8/7 doubles for every eighth voxel.
class Refine : public Operation, public Tunable {
public:
    RefineTolerance tolerance;
    std::optional<BlockSize> block; ///< 8; to the noise mixed, since who asks for that asks for the smallest
    int levels = 8;
    Reconstruction method = Reconstruction::basis;
    RefineMetric metric = RefineMetric::value;
    std::string transfer;             ///< a JSON file, or the JSON itself
    std::optional<CellType> dtype;    ///< kept; to the noise the smallest
    std::optional<double> background; ///< physical value

    std::string_view name() const override { return "refine"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::geometric; }
    void parameters(Parameters& p) override;
    void check() const override;
    std::vector<Knob> knobs() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    std::optional<Volume> take_whole(Volume input, Execution const& execution) override;
    void after_scan(Plan& plan) const override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    std::vector<Remark> remarks() const override;

private:
    BlockSize blocks() const;
    bool finds_type() const;
    std::size_t bytes_to_refine(Header const& in) const;
    Volume best(Volume const& volume, RefineOptions options, Execution const& execution) const;
    render::TransferFunction const& function() const;

    Header input_;
    ReadOnce<std::shared_ptr<render::TransferFunction const>> function_;
    double used_ = 0;   ///< the tolerance, a physical value, once it is known
    double noise_ = 0;  ///< that was found, a physical value
    double error_ = 0;  ///< |physical value - reconstruction| is at most this, for the metric of values
    std::string found_; ///< what became of the volume
    std::string grown_; ///< that it became larger
};

} // namespace vkt
