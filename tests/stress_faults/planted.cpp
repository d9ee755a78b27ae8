// A filter with faults to choose from, for the vkt of the tests alone: what vkt stress has to find.
// SPDX-License-Identifier: MIT
#include "libvkt/core/type_dispatch.h"
#include "libvkt/operations/filter/local_filter.h"
#include "shell/command.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace vkt::shell {
namespace {

/// Twice a voxel less the mean of the 27 around it. Without a fault it does what it says, for every slab, thread and
/// type.
class Planted : public LocalFilter {
public:
    std::string_view name() const override { return "planted"; }

    void parameters(Parameters& parameters) override {
        parameters.option("fault", fault_, "NAME", "what is wrong").choices = {
            "none", "halo", "threads", "wraps", "loses-nan", "spreads-nan", "float32"};
        LocalFilter::parameters(parameters);
    }

    /// The fault "halo": a region brings no slices with it from above and below.
    Box footprint(Box const& output, int) const override {
        return grow(output, has("halo") ? Index3{1, 1, 0} : reach_);
    }

protected:
    void prepare(Header const& /*in*/, Index3 /*cell_width*/) override { reach_ = {1, 1, 1}; }

    void describe(Header const& in, Index3 /*cell_width*/, Plan& plan) const override {
        require_border_voxel(in);
        plan.method = "27 voxels in float64";
        plan.cost = 27;
        plan.error.kind = ErrorBound::Kind::bound;
        plan.error.magnitude = 64 * 0x1p-53 + 3 * storing_error(in.dtype);
        plan.error.absolute = std::abs(in.values.slope) * storing_floor(in.dtype);
        if (size_of(in.dtype) == 8) plan.error.magnitude += 4 * 0x1p-53; // integers that float64 does not hold
    }

    void filter(ConstView in, AnyView out, Execution const& execution) override {
        // The fault "threads": rows are cut into as many parts as there are threads, which do not see each other's.
        std::int64_t const rows = out.dims().y,
                           parts = has("threads") ? std::min<std::int64_t>(execution.threads, rows) : 1;
        for (std::int64_t part = 0; part < parts; ++part) {
            AnyView rows_out = out;
            rows_out.box.lower.y = out.box.lower.y + part * rows / parts;
            rows_out.box.upper.y = out.box.lower.y + (part + 1) * rows / parts;
            rows_out = out.part(rows_out.box);
            Box seen = in.box;
            if (part > 0) seen.lower.y = rows_out.box.lower.y;
            if (part + 1 < parts) seen.upper.y = rows_out.box.upper.y;
            with_type(in.type, [&]<class T>(T) {
                if (has("float32") && !std::is_same_v<T, double>) return sharpen<T, float>(in, rows_out, seen);
                sharpen<T, double>(in, rows_out, seen);
            });
        }
    }

private:
    bool has(std::string_view fault) const { return fault_ == fault; }

    template <class T> static double value_of(T stored) {
        if constexpr (std::is_same_v<T, Half>)
            return static_cast<double>(static_cast<float>(stored));
        else
            return static_cast<double>(stored);
    }

    /// Sums of 27 in the type Sum, which for the fault "float32" is float for all but float64.
    template <class T, class Sum> void sharpen(ConstView in, AnyView out, Box const& seen) {
        auto const from = in.as<T>();
        auto const to = out.as<T>();
        bool const narrow = sizeof(T) < sizeof(double) && !std::is_integral_v<T>;
        Box const box = out.box;
        auto const at = [&](std::int64_t x, std::int64_t y, std::int64_t z) {
            return value_of(from(std::clamp(x, seen.lower.x, seen.upper.x - 1),
                                 std::clamp(y, seen.lower.y, seen.upper.y - 1),
                                 std::clamp(z, seen.lower.z, seen.upper.z - 1)));
        };
        auto const column = [&](std::int64_t x, std::int64_t y, std::int64_t z) {
            Sum sum = 0;
            for (std::int64_t k = z - 1; k <= z + 1; ++k)
                for (std::int64_t j = y - 1; j <= y + 1; ++j) {
                    double const value = at(x, j, k);
                    if (has("loses-nan") && narrow && std::isnan(value)) continue;
                    sum += static_cast<Sum>(value);
                }
            return sum;
        };
        for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
            for (std::int64_t y = box.lower.y; y < box.upper.y; ++y) {
                Sum running = 0;
                for (std::int64_t x = box.lower.x; x < box.upper.x; ++x) {
                    Sum sum = column(x - 1, y, z) + column(x, y, z) + column(x + 1, y, z);
                    if (has("spreads-nan") && narrow) { // what enters is added, what leaves is taken away
                        running = x == box.lower.x ? sum : running + column(x + 1, y, z) - column(x - 2, y, z);
                        sum = running;
                    }
                    double const centre = at(x, y, z), mean = static_cast<double>(sum / Sum(27));
                    double const lost = has("loses-nan") && narrow && std::isnan(centre) ? mean : centre;
                    to(x, y, z) = stored<T>(2 * lost - mean);
                }
            }
    }

    template <class T> T stored(double value) {
        if constexpr (std::is_integral_v<T>) {
            double const low = static_cast<double>(std::numeric_limits<T>::lowest());
            double const high = static_cast<double>(std::numeric_limits<T>::max());
            double const whole = std::nearbyint(value);
            if (has("wraps") && sizeof(T) < 8) return static_cast<T>(static_cast<std::int64_t>(whole));
            if (whole < low || whole > high) ++losses_.clipped;
            if (whole >= high) return std::numeric_limits<T>::max();
            return static_cast<T>(std::max(whole, low));
        } else {
            return T(value);
        }
    }

    std::string fault_ = "none";
};

} // namespace

Command planted_command() {
    Command command;
    command.texts = {"Sharpen, with a fault.", "For the tests of vkt stress.", {}};
    command.operation = [] { return std::make_unique<Planted>(); };
    return command;
}

} // namespace vkt::shell
