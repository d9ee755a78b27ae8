// Watershed: a volume flooded from markers, or from its minima, until the floods meet.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/shape/flooding.h"

#include "libvkt/engine/operation.h"

#include <optional>
#include <utility>

namespace vkt {

/// What is flooded.
enum class Relief : std::uint8_t {
    value,    ///< the volume itself
    gradient, ///< the length of its gradient, by central differences in world units, in float32
    distance, ///< minus the distance of its non-zero voxels to the nearest zero one; zero voxels take no part
};

template <> struct EnumNames<Relief> {
    static std::vector<std::pair<Relief, char const*>> all() {
        return {{Relief::value, "value"}, {Relief::gradient, "gradient"}, {Relief::distance, "distance"}};
    }
};

/// Labels in uint32, 0 where no flood came. Exact: see Flooding for the order, which depends on values alone. Without
/// markers the regional minima that are at least `depth` deep are numbered by their first voxel. NaN is above all
/// numbers. Whole volumes, in one thread.
class Watershed : public Operation {
public:
    std::string in = "-";
    std::optional<std::string> markers, mask;
    Relief on = Relief::value;
    double depth = 0; ///< physical values; of distances world units
    int connectivity = 6;
    bool line = false;
    Roi roi; ///< all else takes no part, and is 0

    std::string_view name() const override { return "watershed"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::geometric; }
    int inputs() const override { return 1 + (markers ? 1 : 0) + (mask ? 1 : 0); }
    std::vector<std::string> input_names() const override;
    void parameters(Parameters& parameters) override;
    void check() const override;
    /// Throws Error{usage} if the volumes do not lie on one another or the markers are no integers.
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Box footprint(Box const&, int) const override { return region_; }
    /// Throws Error{data} if there is no marker.
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    std::vector<Remark> remarks() const override;
    bool reports() const override { return true; }
    /// Labels and their sizes.
    Report report() const override;

private:
    /// A byte a voxel: 0 where it takes no part. Empty if all do.
    std::vector<std::uint8_t> taking_part(std::span<ConstView const> inputs) const;
    void mark(Flooding& flooding, ConstView volume) const;

    std::vector<Header> headers_; ///< of the region
    Box region_;
    Flooding::Result result_;
    std::vector<std::pair<std::uint32_t, std::int64_t>> sizes_; ///< labels in ascending order, and their voxels
};

} // namespace vkt
