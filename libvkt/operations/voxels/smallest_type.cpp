// Candidates in order of their bytes; the first that holds the values is taken.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/smallest_type.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>

namespace vkt {
namespace {

constexpr double ulp = 0x1p-53;

class Search {
public:
    Search(TypeFit const& fit, Header const& input, double tolerance)
        : fit_(fit), input_(input), tolerance_(tolerance), slope_(std::abs(input.values.slope)),
          wide_(input.dtype == DataType::int64 || input.dtype == DataType::uint64),
          any_(fit.extremes.low <= fit.extremes.high) {}

    Storage run() const {
        constexpr std::array kinds{std::array{DataType::uint8, DataType::int8, DataType::uint8},
                                   std::array{DataType::uint16, DataType::int16, DataType::float16},
                                   std::array{DataType::uint32, DataType::int32, DataType::float32}};
        for (auto const& types : kinds) {
            if (size_of(types.front()) >= size_of(input_.dtype)) break;
            for (DataType const type : types)
                if (auto found = as_they_are(type)) return *found;
            if (auto found = in_steps(types.front())) return *found;
            if (auto found = spread(types.front())) return *found;
        }
        Storage same;
        same.type = input_.dtype;
        same.values = input_.values;
        return same;
    }

private:
    bool only_floats() const { return fit_.nan || fit_.infinite || !any_; }

    std::optional<Storage> as_they_are(DataType type) const {
        double off = fit_.off_whole;
        if (is_integer(type)) {
            if (only_floats()) return {};
            // Wider than 2^53 doubles are not exact, but no candidate holds what is as large as that.
            double const low = std::rint(fit_.extremes.low), high = std::rint(fit_.extremes.high);
            if (low < lowest_of(type) || high > highest_of(type)) return {};
        } else {
            off = type == DataType::float16 ? fit_.off_half : fit_.off_single;
        }
        double const error = slope_ * off;
        if (!(error <= tolerance_)) return {};
        Storage result;
        result.type = type;
        result.values = input_.values;
        result.error = error;
        return result;
    }

    /// Whole numbers as multiples of their greatest common step.
    std::optional<Storage> in_steps(DataType type) const {
        if (only_floats() || fit_.off_whole > 0 || (fit_.step == 0 && !constant())) return {};
        auto const step = static_cast<double>(std::max<std::uint64_t>(fit_.step, 1));
        double const codes = (high() - low()) / step;
        if (codes > highest_of(type)) return {};
        return mapped(type, codes, input_.values.slope * step, 0);
    }

    std::optional<Storage> spread(DataType type) const {
        double const width = any_ ? high() - low() : 0;
        if (only_floats() || !std::isfinite(width)) return {};
        double const codes = constant() ? 0 : highest_of(type);
        double const slope = constant() ? input_.values.slope : input_.values.slope * (width / codes);
        if (slope == 0 || !std::isfinite(slope)) return {};
        return mapped(type, codes, slope, constant() ? 0 : 0.5 * std::abs(slope));
    }

    std::optional<Storage> mapped(DataType type, double codes, double slope, double half_step) const {
        Storage result;
        result.type = type;
        result.maps = true;
        result.low = low();
        result.high = high();
        result.codes = codes;
        result.values = {slope, input_.values.physical(result.low.value())};
        double const last = input_.values.physical(result.high.value());
        if (!std::isfinite(result.values.intercept) || !std::isfinite(last)) return {};
        double const reach = std::max(std::abs(result.values.intercept), std::abs(last));
        result.error = half_step;
        // Both maps round, and the codes of a range are off a little before they are rounded.
        if (!exact_maps(reach)) result.error += 16 * ulp * (reach + std::abs(input_.values.intercept));
        if (!(result.error <= tolerance_)) return {};
        return result;
    }

    /// True if physical values are the same bit for bit: whole numbers everywhere, that doubles hold, or a constant.
    bool exact_maps(double reach) const {
        auto const whole = [](double v) { return v == std::rint(v); };
        if (constant()) return !wide_ || std::abs(fit_.extremes.low) <= 0x1p53;
        return fit_.off_whole == 0 && whole(input_.values.slope) && whole(input_.values.intercept) && reach <= 0x1p53 &&
               std::abs(input_.values.intercept) <= 0x1p53 &&
               slope_ * std::max(std::abs(fit_.extremes.low), std::abs(fit_.extremes.high)) <= 0x1p53;
    }

    bool constant() const { return any_ && high() - low() == 0; }
    StoredValue low() const {
        return wide_ ? StoredValue{fit_.extremes.whole_low, 0} : StoredValue{0, fit_.extremes.low};
    }
    StoredValue high() const {
        return wide_ ? StoredValue{fit_.extremes.whole_high, 0} : StoredValue{0, fit_.extremes.high};
    }

    TypeFit const& fit_;
    Header const& input_;
    double tolerance_, slope_;
    bool wide_, any_;
};

} // namespace

Storage smallest_storage(TypeFit const& fit, Header const& input, double tolerance) {
    return Search(fit, input, tolerance).run();
}

TypeFit joined(TypeFit const& a, TypeFit const& b) {
    TypeFit result = a;
    result.nan = a.nan || b.nan;
    result.infinite = a.infinite || b.infinite;
    if (!(b.extremes.low <= b.extremes.high)) return result;
    bool const first = !(a.extremes.low <= a.extremes.high);
    if (first) {
        bool const nan = result.nan, infinite = result.infinite;
        result = b;
        result.nan = nan;
        result.infinite = infinite;
        return result;
    }
    FiniteExtremes& all = result.extremes;
    Int128 const apart = a.extremes.whole_low - b.extremes.whole_low;
    all.low = std::min(a.extremes.low, b.extremes.low);
    all.high = std::max(a.extremes.high, b.extremes.high);
    all.whole_low = std::min(a.extremes.whole_low, b.extremes.whole_low);
    all.whole_high = std::max(a.extremes.whole_high, b.extremes.whole_high);
    result.off_whole = std::max(a.off_whole, b.off_whole);
    result.off_half = std::max(a.off_half, b.off_half);
    result.off_single = std::max(a.off_single, b.off_single);
    Int128 const distance = apart < 0 ? -apart : apart;
    bool const steps = a.step != 1 && b.step != 1 && distance <= (Int128{1} << 53);
    result.step = steps ? std::gcd(std::gcd(a.step, b.step), static_cast<std::uint64_t>(distance)) : 1;
    return result;
}

} // namespace vkt
