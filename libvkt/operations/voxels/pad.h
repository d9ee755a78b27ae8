// Pad: voxels added around a volume.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/boundary_rule.h"
#include "libvkt/engine/operation.h"
#include "libvkt/operations/common/number.h"

namespace vkt {

/// Numbers of voxels to add below and above each axis: "X0:X1,Y0:Y1,Z0:Z1", "X,Y,Z" (both sides alike) or "N".
struct Padding {
    Index3 below, above;
    friend bool operator==(Padding const&, Padding const&) = default;
};

template <> struct ValueText<Padding> : OneWord {
    static Padding read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(Padding const& v);
};

/// Continues a volume outside its box by a boundary rule, any number of times its extent; the origin moves so that
/// voxels keep their world positions. Bytes are moved; a constant border is rounded half to even into the type once,
/// and what does not fit is reported. Rules that look back (mirror, wrap) read along z in another order.
class Pad : public Operation {
public:
    Padding by;
    BoundaryRule boundary{Boundary::border, 0};
    std::optional<Number> value; ///< of the border, physical

    std::string_view name() const override { return "pad"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::geometric; }
    void parameters(Parameters& parameters) override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Box footprint(Box const& output, int input) const override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }
    std::vector<Remark> remarks() const override;

private:
    /// Of the border, physical and as it is stored.
    Number border() const { return value.value_or(Number(boundary.value)); }
    Number stored_in(Header const& in) const;

    Index3 dims_; ///< of the input
    DataType type_ = DataType::uint8;
    Number stored_;
};

} // namespace vkt
