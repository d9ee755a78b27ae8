// Test fields: constant, ramp, checkerboard, sphere, Marschner-Lobb and noise, the same on every machine.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/operations/common/number.h"
#include "libvkt/operations/common/remarks.h"

namespace vkt {

/// What all test fields share. Values are stored values; regions may be computed in any order and cut. Where a field
/// has a low and a high value they default to 0 and 1 for floating types, 0 and the largest value for integers.
class MakeField : public Operation {
public:
    std::optional<Index3> dims;
    DataType dtype = DataType::float32;
    Vec3 spacing{1, 1, 1};
    Vec3 origin{0, 0, 0};

    std::string_view name() const override { return "make"; }
    Shape shape() const override { return Shape::source; }
    bool runs_on_gpu() const override { return true; }
    void parameters(Parameters& p) override;
    /// Throws Error{usage} for dims, spacing or values that cannot be.
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;

protected:
    /// Throws Error{usage} if the type cannot hold the value. Floating types hold infinities.
    void check_value(double value, std::string_view option) const;
    double low_or_default(std::optional<double> low) const { return low.value_or(0); }
    double high_or_default(std::optional<double> high) const {
        return high.value_or(is_integer(dtype) ? highest_of(dtype) : 1);
    }
};

/// One value everywhere.
class MakeConstant : public MakeField {
public:
    Number value;
    Texts texts() const override;
    void parameters(Parameters& p) override;
    void check() const override;
    void run(std::span<ConstView const>, AnyView out, Execution const& execution) override;
};

/// Linear along an axis, from the first voxel's value to the last one's; by default the voxel's index.
class MakeRamp : public MakeField {
public:
    Axis axis = Axis::x;
    double first = 0;
    std::optional<double> last;
    Texts texts() const override;
    void parameters(Parameters& p) override;
    void check() const override;
    void run(std::span<ConstView const>, AnyView out, Execution const& execution) override;

private:
    double last_value() const;
};

/// Cubes of `period` voxels, alternating between two values, low at the first voxel.
class MakeCheckerboard : public MakeField {
public:
    std::int64_t period = 1;
    std::optional<double> low, high;
    Texts texts() const override;
    void parameters(Parameters& p) override;
    void check() const override;
    void run(std::span<ConstView const>, AnyView out, Execution const& execution) override;
};

enum class SphereEdge : std::uint8_t { hard, coverage, distance };
template <> struct EnumNames<SphereEdge> {
    static std::vector<std::pair<SphereEdge, char const*>> all() {
        return {{SphereEdge::hard, "hard"}, {SphereEdge::coverage, "coverage"}, {SphereEdge::distance, "distance"}};
    }
};

/// A ball: by voxel centres (hard), by the share of each voxel that it covers (to 1e-8), or as the signed distance in
/// voxels to its surface, negative inside. Radius and centre in voxels; voxel (i, j, k) has its centre at (i, j, k).
class MakeSphere : public MakeField {
public:
    std::optional<double> radius; ///< 0.4 of the smallest extent
    std::optional<Vec3> center;   ///< the middle of the volume
    std::optional<double> inside, outside;
    SphereEdge edge = SphereEdge::hard;
    Texts texts() const override;
    void parameters(Parameters& p) override;
    void check() const override;
    void begin(std::span<Header const>, Plan const&) override { counts_ = {}; }
    void run(std::span<ConstView const>, AnyView out, Execution const& execution) override;
    std::vector<std::int64_t*> counters() override { return counts_.counters(); }
    std::vector<Remark> remarks() const override;

private:
    Losses counts_; ///< distances that did not fit
};

/// The test signal of Marschner and Lobb (Visualization 1994) on [-1, 1]^3, sampled at voxel centres, scaled to
/// [low, high].
class MakeMarschnerLobb : public MakeField {
public:
    double frequency = 6, amplitude = 0.25;
    std::optional<double> low, high;
    Texts texts() const override;
    void parameters(Parameters& p) override;
    void check() const override;
    void run(std::span<ConstView const>, AnyView out, Execution const& execution) override;
};

/// White noise, uniform in [low, high] (integers: every value alike). Voxel i of the whole volume takes word i (64-bit
/// types: words 2i and 2i + 1) of the counter-based generator Philox4x32-10 (Salmon et al., SC 2011) with the seed as
/// key.
class MakeNoise : public MakeField {
public:
    std::int64_t seed = 0;
    std::optional<double> low, high;
    Texts texts() const override;
    void parameters(Parameters& p) override;
    void check() const override;
    void run(std::span<ConstView const>, AnyView out, Execution const& execution) override;
};

/// Share of the cube of side 1 around `center` that a ball of this radius around the origin covers.
double ball_coverage(Vec3 center, double radius);

} // namespace vkt
