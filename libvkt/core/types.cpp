// Names, sizes and ranges of the voxel types.
// SPDX-License-Identifier: MIT
#include "libvkt/core/types.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <limits>

namespace vkt {
namespace {

struct Traits {
    std::string_view name;
    std::size_t size;
    bool integer, is_signed;
    double lowest, highest;
};

template <class T> constexpr Traits integer_traits(std::string_view name) {
    using Limits = std::numeric_limits<T>;
    return {name,
            sizeof(T),
            true,
            Limits::is_signed,
            static_cast<double>(Limits::min()),
            static_cast<double>(Limits::max())};
}

constexpr std::array<Traits, data_type_count> table{
    integer_traits<std::uint8_t>("uint8"),
    integer_traits<std::int8_t>("int8"),
    integer_traits<std::uint16_t>("uint16"),
    integer_traits<std::int16_t>("int16"),
    integer_traits<std::uint32_t>("uint32"),
    integer_traits<std::int32_t>("int32"),
    integer_traits<std::uint64_t>("uint64"),
    integer_traits<std::int64_t>("int64"),
    Traits{"float16", 2, false, true, -65504.0, 65504.0},
    Traits{"float32", 4, false, true, -static_cast<double>(std::numeric_limits<float>::max()),
           static_cast<double>(std::numeric_limits<float>::max())},
    Traits{"float64", 8, false, true, std::numeric_limits<double>::lowest(), std::numeric_limits<double>::max()},
};

Traits const& traits(DataType type) { return table[static_cast<std::size_t>(type)]; }

struct Alias {
    std::string_view name;
    DataType type;
};

constexpr std::array aliases{
    Alias{"u8", DataType::uint8},       Alias{"uchar", DataType::uint8}, Alias{"byte", DataType::uint8},
    Alias{"i8", DataType::int8},        Alias{"char", DataType::int8},   Alias{"u16", DataType::uint16},
    Alias{"ushort", DataType::uint16},  Alias{"i16", DataType::int16},   Alias{"short", DataType::int16},
    Alias{"u32", DataType::uint32},     Alias{"uint", DataType::uint32}, Alias{"i32", DataType::int32},
    Alias{"int", DataType::int32},      Alias{"u64", DataType::uint64},  Alias{"ulong", DataType::uint64},
    Alias{"i64", DataType::int64},      Alias{"long", DataType::int64},  Alias{"f16", DataType::float16},
    Alias{"half", DataType::float16},   Alias{"f32", DataType::float32}, Alias{"float", DataType::float32},
    Alias{"single", DataType::float32}, Alias{"f64", DataType::float64}, Alias{"double", DataType::float64},
};

} // namespace

std::string_view name_of(DataType type) { return traits(type).name; }
bool is_signed(DataType type) { return traits(type).is_signed; }
double lowest_of(DataType type) { return traits(type).lowest; }
double highest_of(DataType type) { return traits(type).highest; }

DataType parse_data_type(std::string_view word) {
    std::string const name = lower_case(word);
    std::vector<std::string> names;
    for (int i = 0; i < data_type_count; ++i) {
        auto const type = static_cast<DataType>(i);
        if (name == name_of(type)) return type;
        names.emplace_back(name_of(type));
    }
    for (auto const& alias : aliases)
        if (name == alias.name) return alias.type;
    std::string const near = nearest_name(name, names);
    throw Error(ErrorKind::usage, text("'", word, "' is not a data type; known are ", join(names, " ")),
                near.empty() ? "" : text("did you mean '", near, "'?"));
}

} // namespace vkt
