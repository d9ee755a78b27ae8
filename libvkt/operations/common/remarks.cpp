// Wording of losses.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/common/remarks.h"

#include <cmath>
#include <cstdio>

namespace vkt {
namespace {

std::string range_text(DataType type) {
    switch (type) {
    case DataType::uint64:
        return "[0,18446744073709551615]";
    case DataType::int64:
        return "[-9223372036854775808,9223372036854775807]";
    default:
        return text("[", lowest_of(type), ",", highest_of(type), "]");
    }
}

} // namespace

std::string share_text(std::int64_t part, std::int64_t whole) {
    double const percent = 100 * static_cast<double>(part) / static_cast<double>(whole);
    char digits[32];
    if (percent >= 0.01 || percent == 0)
        std::snprintf(digits, sizeof digits, "%.2f", percent);
    else
        std::snprintf(digits, sizeof digits, "%.1g", percent);
    return text(part, " of ", whole, " voxels (", digits, " %)");
}

std::vector<Remark> value_remarks(Number const& value, Number const& stored, DataType type, std::int64_t voxels) {
    std::string const count = text(voxels, " voxels");
    if (is_integer(type) && std::isnan(stored.value))
        return {{text(type, " has no NaN: 0 is stored in ", count), true}};
    if (voxels == 0 || fits(type, stored)) return {};
    bool const low = stored.value < 0;
    double const held = !is_integer(type) ? std::copysign(HUGE_VAL, stored.value)
                        : low             ? lowest_of(type)
                                          : highest_of(type);
    return {{text("the value ", value, " does not fit ", type, ": stored as ", held, " in ", count), true}};
}

std::vector<Remark> store_remarks(Losses const& counts, std::int64_t voxels, DataType type) {
    std::vector<Remark> result;
    if (counts.clipped > 0)
        result.push_back({text(share_text(counts.clipped, voxels),
                               is_integer(type) ? " clipped to " : " infinite beyond ", range_text(type)),
                          true});
    if (counts.nan > 0) result.push_back({text(share_text(counts.nan, voxels), " not a number, stored as 0"), true});
    return result;
}

} // namespace vkt
