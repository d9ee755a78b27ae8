// Haar coefficients and their median.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/noise_level.h"

#include "libvkt/amr/cells.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace vkt {
namespace {

/// Calls f(value) for blocks of 2x2x2 voxels that are equal, f(coefficient, touches) for others that hold numbers:
/// touches(value) says whether a voxel has it.
template <class T, class Equal, class Other>
void for_each_block(ConstView view, Equal const& equal, Other const& other) {
    auto const values = view.as<T>();
    Index3 const n = view.dims();
    Index3 step;
    int axes = 0;
    for (int a = 0; a < 3; ++a) {
        step[a] = n[a] > 1 ? 2 : 1;
        axes += n[a] > 1 ? 1 : 0;
    }
    double const norm = std::sqrt(static_cast<double>(std::int64_t{1} << axes));
    auto const count = static_cast<std::size_t>(step.x * step.y * step.z);
    std::array<double, 8> block{};
    for (std::int64_t z = 0; z + step.z <= n.z; z += step.z)
        for (std::int64_t y = 0; y + step.y <= n.y; y += step.y)
            for (std::int64_t x = 0; x + step.x <= n.x; x += step.x) {
                double const first = static_cast<double>(values(x, y, z));
                double sum = 0;
                bool same = true;
                std::size_t at = 0;
                for (std::int64_t k = 0; k < step.z; ++k)
                    for (std::int64_t j = 0; j < step.y; ++j)
                        for (std::int64_t i = 0; i < step.x; ++i) {
                            block[at] = static_cast<double>(values(x + i, y + j, z + k));
                            double const v = block[at++] - first;
                            same = same && v == 0;
                            sum += (i + j + k) % 2 == 0 ? v : -v;
                        }
                auto const touches = [&](double value) {
                    return std::find(block.begin(), block.begin() + static_cast<std::ptrdiff_t>(count), value) !=
                           block.begin() + static_cast<std::ptrdiff_t>(count);
                };
                if (same)
                    equal(first);
                else if (std::isfinite(sum))
                    other(std::abs(sum) / norm, touches);
            }
}

/// Coefficients of blocks that are not equal, and of what is left without padding.
struct Coefficients {
    std::vector<float> unequal, unpadded;
};

template <class T> Coefficients coefficients(ConstView view) {
    // Padding: the value that most of the equal blocks have (R. S. Boyer, J. S. Moore: MJRTY, 1991).
    double padding = 0;
    std::int64_t votes = 0;
    for_each_block<T>(
        view,
        [&](double value) {
            if (votes == 0) padding = value;
            votes += value == padding ? 1 : -1;
        },
        [](double, auto const&) {});
    Coefficients result;
    for_each_block<T>(
        view,
        [&](double value) {
            if (votes == 0 || value != padding) result.unpadded.push_back(0);
        },
        [&](double coefficient, auto const& touches) {
            auto const found = static_cast<float>(coefficient);
            result.unequal.push_back(found);
            if (votes == 0 || !touches(padding)) result.unpadded.push_back(found);
        });
    return result;
}

/// 0 of none.
double median(std::vector<float>& values) {
    if (values.empty()) return 0;
    auto const middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return static_cast<double>(*middle);
}

} // namespace

double noise_level(Volume const& volume) {
    if (volume.header().voxels() == 1) return 0;
    Coefficients found = with_type(volume.header().dtype, [&]<class T>(T) { return coefficients<T>(volume.view()); });
    return std::min(median(found.unequal), median(found.unpadded)) / 0.6745;
}

double noise_extent(std::int64_t voxels) {
    return std::sqrt(2 * std::log(static_cast<double>(std::max<std::int64_t>(voxels, 2))));
}

} // namespace vkt
