// Filters that are weighted sums of neighbours, or the length of a vector of such sums.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/tunable.h"
#include "libvkt/operations/filter/kernels/correlate.h"
#include "libvkt/operations/filter/local_filter.h"

namespace vkt {

/// Base of linear filters. They see physical values: the output has no value map. Its type is float32, float64 for
/// float64 and integers of 32 and 64 bits, unless --dtype says else. Sums are in float32 where the input has at most 16
/// bits or is float32, else in float64, to which 64-bit integers are rounded. The error bound is that of rounding.
/// A border value must be a voxel of the input's type. Filters that keep the type keep the value map too, and work on
/// stored values.
class LinearFilter : public LocalFilter, public Tunable {
public:
    explicit LinearFilter(bool keeps_type = false) : keeps_type_(keeps_type) {}
    void parameters(Parameters& parameters) override;
    std::vector<Knob> knobs() const override;
    std::size_t fit(Index3 largest, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }

protected:
    /// A weighted sum, or the length of a vector of such sums.
    struct Weights {
        SeparableSum sum;
        DenseKernel dense;     ///< if there is no sum
        std::string method;    ///< see Plan
        double more_error = 0; ///< share of the largest magnitude times the weights' that is added to the bound
        double cost = 0;       ///< multiply-adds a voxel, of what is not direct
        bool by_fft = false;   ///< a kernel that filter() does not apply here
    };
    /// The filter for physical values, in world units where lengths matter.
    virtual Weights weights(Header const& in, Index3 cell_width) const = 0;
    void describe(Header const& in, Index3 cell_width, Plan& plan) const final;
    void prepare(Header const& in, Index3 cell_width) override;
    void filter(ConstView in, AnyView out, Execution const& execution) override;
    void outside(ConstView in, AnyView out, Execution const& execution) override;

    Weights weights_;

private:
    static bool is_wide(DataType type);
    /// Those of weights(), with the taps along axes that are flat taken together.
    Weights weights_on(Header const& in, Index3 cell_width) const;
    /// Those for stored values.
    Weights stored_weights(Header const& in, Index3 cell_width) const;
    void set_type(Header const& in, Header& output) const;

    bool keeps_type_;
    std::optional<DataType> dtype_;
    bool maps_ = false; ///< the input has a value map
    SeparableSum same_; ///< physical values as they are
};

/// Taps [-1 0 1] / 2 h: central differences for voxels of size h.
AxisTaps central_difference(double spacing);
/// Taps [1 -2 1] / h^2.
AxisTaps second_difference(double spacing);

} // namespace vkt
