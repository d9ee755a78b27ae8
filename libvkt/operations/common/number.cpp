// Whole numbers beside doubles.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/common/number.h"

#include "libvkt/engine/error_bound.h"
#include "libvkt/kernel/numeric.h"

#include <cmath>

namespace vkt {
namespace {

std::optional<Int128> whole_number(double value) {
    if (value != std::rint(value) || !(std::abs(value) < 0x1p100)) return std::nullopt;
    return static_cast<Int128>(value);
}

/// A sign and at most 30 digits.
std::optional<Int128> whole_number(std::string_view word) {
    bool const negative = word.starts_with('-');
    if (negative || word.starts_with('+')) word.remove_prefix(1);
    if (word.empty() || word.size() > 30 || word.find_first_not_of("0123456789") != word.npos) return std::nullopt;
    Int128 value = 0;
    for (char const digit : word) value = 10 * value + (digit - '0');
    return negative ? -value : value;
}

Number number_of(std::string_view word, double value) {
    Number number(value);
    if (auto const whole = whole_number(word)) number.whole = whole;
    return number;
}

} // namespace

Number::Number(double number) : value(number), whole(whole_number(number)) {}

Number Number::parse(std::string_view word) { return number_of(word, parse_double(word)); }

std::string to_text(Number const& number) {
    if (number.whole && number.whole != whole_number(number.value)) return to_text(*number.whole);
    return to_text(number.value);
}

Number ValueText<Number>::read(std::vector<std::string> const& w, std::string_view name) {
    return number_of(w.front(), ValueText<double>::read(w, name));
}

std::array<std::byte, 8> voxel_bytes(DataType type, Number const& number) {
    if (!is_integer(type) || !number.whole) return baseline::voxel_bytes(type, number.value);
    VoxelBytes voxel{};
    with_type(type, [&]<class T>(T) {
        if constexpr (std::is_integral_v<T>) {
            Int128 const lowest = std::numeric_limits<T>::lowest(), highest = std::numeric_limits<T>::max();
            T const stored = static_cast<T>(std::clamp(*number.whole, lowest, highest));
            std::memcpy(voxel.data(), &stored, sizeof stored);
        }
    });
    return voxel;
}

bool fits(DataType type, Number const& number) {
    bool result = true;
    with_type(type, [&]<class T>(T) {
        result = !baseline::is_clipped<T>(number.value);
        if constexpr (std::is_integral_v<T>)
            if (number.whole)
                result =
                    *number.whole >= std::numeric_limits<T>::lowest() && *number.whole <= std::numeric_limits<T>::max();
    });
    return result;
}

double storing_loss(DataType type, Number const& number) {
    if (!std::isfinite(number.value)) return 0;
    if (is_integer(type)) return number.whole ? 0 : 0.5;
    if (type == DataType::float64 || (type == DataType::float32 && static_cast<float>(number.value) == number.value))
        return 0;
    return storing_error(type) * std::abs(number.value) + storing_floor(type);
}

} // namespace vkt
