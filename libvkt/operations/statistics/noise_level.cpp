// Haar coefficients and their median.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/noise_level.h"

#include "libvkt/amr/cells.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace vkt {
namespace {

template <class T> std::vector<float> coefficients(ConstView view) {
    auto const values = view.as<T>();
    Index3 const n = view.dims();
    Index3 step;
    int axes = 0;
    for (int a = 0; a < 3; ++a) {
        step[a] = n[a] > 1 ? 2 : 1;
        axes += n[a] > 1 ? 1 : 0;
    }
    double const norm = std::sqrt(static_cast<double>(std::int64_t{1} << axes));
    std::vector<float> result;
    result.reserve(static_cast<std::size_t>((n.x / step.x) * (n.y / step.y) * (n.z / step.z)));
    for (std::int64_t z = 0; z + step.z <= n.z; z += step.z)
        for (std::int64_t y = 0; y + step.y <= n.y; y += step.y)
            for (std::int64_t x = 0; x + step.x <= n.x; x += step.x) {
                double const first = static_cast<double>(values(x, y, z));
                double sum = 0;
                bool equal = true;
                for (std::int64_t k = 0; k < step.z; ++k)
                    for (std::int64_t j = 0; j < step.y; ++j)
                        for (std::int64_t i = 0; i < step.x; ++i) {
                            double const v = static_cast<double>(values(x + i, y + j, z + k)) - first;
                            equal = equal && v == 0;
                            sum += (i + j + k) % 2 == 0 ? v : -v;
                        }
                if (!equal && std::isfinite(sum)) result.push_back(static_cast<float>(std::abs(sum) / norm));
            }
    return result;
}

} // namespace

double noise_level(Volume const& volume) {
    std::vector<float> found =
        with_type(volume.header().dtype, [&]<class T>(T) { return coefficients<T>(volume.view()); });
    if (found.empty() || volume.header().voxels() == 1) return 0;
    auto const middle = found.begin() + static_cast<std::ptrdiff_t>(found.size() / 2);
    std::nth_element(found.begin(), middle, found.end());
    return static_cast<double>(*middle) / 0.6745;
}

double noise_extent(std::int64_t voxels) {
    return std::sqrt(2 * std::log(static_cast<double>(std::max<std::int64_t>(voxels, 2))));
}

} // namespace vkt
