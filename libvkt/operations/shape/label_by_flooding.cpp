// Components once more, one flood after the other: what vkt stress compares labels with.
// SPDX-License-Identifier: MIT
#include "libvkt/core/type_dispatch.h"
#include "libvkt/operations/shape/label.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <type_traits>
#include <vector>

namespace vkt {

std::optional<WrongVoxel> Label::wrong_voxel(ConstView input, ConstView output) const {
    Index3 const whole = input.box.dims(), n = region_.dims();
    auto const index_of = [](Index3 p, Index3 dims) {
        return static_cast<std::size_t>((p.z * dims.y + p.y) * dims.x + p.x);
    };
    auto const lies_in = [](Index3 p, Box const& box) { return !intersect(box, Box{p, p + Index3{1, 1, 1}}).empty(); };
    std::vector<std::uint32_t> component(static_cast<std::size_t>(region_.voxels()), 0); // from 1 on; 0: none
    std::vector<std::int64_t> sizes;
    with_type(input.type, [&]<class T>(T) {
        View<T const> const voxels = input.as<T>();
        auto const value = [&](Index3 p) {
            return voxels(p.x + region_.lower.x, p.y + region_.lower.y, p.z + region_.lower.z);
        };
        auto const counts = [&](Index3 p) {
            auto const v = static_cast<double>(value(p));
            return !std::isnan(v) && !(zero_ && v == *zero_);
        };
        auto const alike = [&](Index3 a, Index3 b) {
            if constexpr (std::is_integral_v<T>)
                return value(a) == value(b);
            else
                return static_cast<double>(value(a)) == static_cast<double>(value(b));
        };
        std::vector<Index3> front;
        auto const flood = [&](Index3 first) {
            sizes.push_back(0);
            auto const number = static_cast<std::uint32_t>(sizes.size());
            component[index_of(first, n)] = number;
            front.assign(1, first);
            while (!front.empty()) {
                Index3 const p = front.back();
                front.pop_back();
                ++sizes.back();
                for (std::int64_t z = -1; z <= 1; ++z)
                    for (std::int64_t y = -1; y <= 1; ++y)
                        for (std::int64_t x = -1; x <= 1; ++x) {
                            Index3 const q = p + Index3{x, y, z};
                            std::int64_t const steps = std::abs(x) + std::abs(y) + std::abs(z);
                            if (steps > (connectivity == 6 ? 1 : connectivity == 18 ? 2 : 3)) continue;
                            if (!lies_in(q, box_of(n)) || component[index_of(q, n)] != 0) continue;
                            if (!counts(q) || (by_value && !alike(p, q))) continue;
                            component[index_of(q, n)] = number;
                            front.push_back(q);
                        }
            }
        };
        for (std::int64_t z = 0; z < n.z; ++z)
            for (std::int64_t y = 0; y < n.y; ++y)
                for (std::int64_t x = 0; x < n.x; ++x)
                    if (component[index_of({x, y, z}, n)] == 0 && counts({x, y, z})) flood({x, y, z});
    });
    std::vector<std::size_t> chosen;
    for (std::size_t i = 0; i < sizes.size(); ++i)
        if (sizes[i] >= min_size) chosen.push_back(i);
    std::stable_sort(chosen.begin(), chosen.end(), [&](std::size_t a, std::size_t b) { return sizes[a] > sizes[b]; });
    if (keep_largest && static_cast<std::size_t>(*keep_largest) < chosen.size())
        chosen.resize(static_cast<std::size_t>(*keep_largest));
    std::sort(chosen.begin(), chosen.end()); // by their first voxels
    std::vector<double> names(sizes.size() + 1, 0);
    for (std::size_t i = 0; i < chosen.size(); ++i) names[chosen[i] + 1] = static_cast<double>(i + 1);
    std::optional<WrongVoxel> wrong;
    with_type(output.type, [&]<class T>(T) {
        View<T const> const labels = output.as<T>();
        for (std::int64_t z = 0; z < whole.z && !wrong; ++z)
            for (std::int64_t y = 0; y < whole.y && !wrong; ++y)
                for (std::int64_t x = 0; x < whole.x && !wrong; ++x) {
                    Index3 const p{x, y, z};
                    double const expected = lies_in(p, region_) ? names[component[index_of(p - region_.lower, n)]] : 0;
                    auto const found = static_cast<double>(labels(x, y, z));
                    if (found != expected)
                        wrong = WrongVoxel{static_cast<std::int64_t>(index_of(p, whole)), found, expected, 0};
                }
    });
    return wrong;
}

} // namespace vkt
