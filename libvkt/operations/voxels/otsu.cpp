// Otsu's threshold: extremes if the type is wide, counts, the best cut.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/otsu.h"

#include "libvkt/core/error.h"
#include "libvkt/operations/common/kernels/convert.h"

#include <algorithm>
#include <cmath>

namespace vkt {
namespace {

constexpr std::int64_t most_bins = 65536;
constexpr std::int64_t float_bins = 256;

bool is_wide_integer(DataType type) { return type == DataType::int64 || type == DataType::uint64; }

/// The last bin of the lower class. Bins are as good as values: classes do not change when values are scaled.
std::size_t best_cut(std::vector<std::int64_t> const& counts) {
    std::int64_t all = 0, below = 0;
    long double sum = 0, sum_below = 0, best = -1; // whole, and exact up to 2^64
    for (std::size_t i = 0; i < counts.size(); ++i) {
        all += counts[i];
        sum += static_cast<long double>(counts[i]) * static_cast<long double>(i);
    }
    std::size_t cut = 0;
    for (std::size_t i = 0; i < counts.size(); ++i) {
        below += counts[i];
        sum_below += static_cast<long double>(counts[i]) * static_cast<long double>(i);
        if (counts[i] == 0 || below == all) continue; // as good as the cut before it; or no cut at all
        auto const n = static_cast<long double>(below), m = static_cast<long double>(all - below);
        long double const between = sum_below / n - (sum - sum_below) / m;
        long double const variance = n * m * between * between;
        if (variance > best) {
            best = variance;
            cut = i;
        }
    }
    if (best >= 0) return cut;
    auto const only = std::find_if(counts.begin(), counts.end(), [](std::int64_t n) { return n > 0; });
    return static_cast<std::size_t>(only - counts.begin());
}

} // namespace

Otsu::Otsu(DataType type, bool falling) : type_(type), falling_(falling) {
    if (!is_integer(type) || size_of(type) > 2) return;
    counts_ = true;
    bins_ = {static_cast<Int128>(lowest_of(type)), 0, 0, 0, std::int64_t{1} << (8 * size_of(type))};
    counters_.assign(static_cast<std::size_t>(bins_.count), 0);
}

void Otsu::add(ConstView slab, Execution const& execution) {
    if (counts_) return count_bins(slab, bins_, counters_.data(), execution);
    FiniteExtremes found;
    find_extremes(slab, found, execution);
    if (!(found.low <= found.high)) return;
    low_ = any_ ? std::min(low_, found.low) : found.low;
    high_ = any_ ? std::max(high_, found.high) : found.high;
    whole_low_ = any_ ? std::min(whole_low_, found.whole_low) : found.whole_low;
    whole_high_ = any_ ? std::max(whole_high_, found.whole_high) : found.whole_high;
    any_ = true;
}

bool Otsu::end_pass() {
    if (counts_) {
        if (std::all_of(counters_.begin(), counters_.end(), [](std::int64_t n) { return n == 0; }))
            throw Error(ErrorKind::data, "the volume holds no voxel to find a threshold of");
        return false;
    }
    if (!any_)
        throw Error(ErrorKind::data, "no voxel is a finite number: there is no threshold to find",
                    "give one: --above T");
    if (!is_wide_integer(type_) && is_integer(type_)) {
        whole_low_ = static_cast<Int128>(low_);
        whole_high_ = static_cast<Int128>(high_);
    }
    double const extent = is_integer(type_) ? static_cast<double>(whole_high_ - whole_low_) : high_ - low_;
    if (!std::isfinite(extent))
        throw Error(ErrorKind::data, text("the values reach from ", low_, " to ", high_, ", too far for bins"),
                    "give a threshold: --above T");
    if (is_integer(type_) && extent < static_cast<double>(most_bins))
        bins_ = {whole_low_, 0, 0, 0, static_cast<std::int64_t>(extent) + 1};
    else if (extent == 0)
        bins_ = {0, low_, 0, 0, 1};
    else
        bins_ = {whole_low_, is_integer(type_) ? 0 : low_, extent / static_cast<double>(float_bins),
                 static_cast<double>(float_bins) / extent, float_bins};
    counters_.assign(static_cast<std::size_t>(bins_.count), 0);
    counts_ = true;
    return true;
}

Number Otsu::threshold() const {
    std::vector<std::int64_t> counts = counters_;
    if (falling_) std::reverse(counts.begin(), counts.end());
    auto bin = static_cast<std::int64_t>(best_cut(counts));
    if (falling_) bin = bins_.count - 1 - bin;
    if (bins_.width == 0 && is_integer(type_)) return Number::parse(to_text(bins_.base + bin));
    if (bins_.width == 0) return Number(bins_.low);
    double const centre = bins_.low + (static_cast<double>(bin) + 0.5) * bins_.width;
    return Number(static_cast<double>(bins_.base) + centre);
}

} // namespace vkt
