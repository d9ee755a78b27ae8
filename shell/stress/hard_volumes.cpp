// Hard volumes: a function of position for each content, stored in each type.
// SPDX-License-Identifier: MIT
#include "shell/stress/hard_volumes.h"

#include "libvkt/core/error.h"
#include "libvkt/core/half.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

namespace vkt::shell {
namespace {

/// A whole number of 32 bits that looks random, of a position (the finaliser of MurmurHash3).
std::uint32_t mixed(std::int64_t i) {
    auto h = static_cast<std::uint32_t>(i) * 2654435761U + 12345U;
    h ^= h >> 16;
    h *= 0x85ebca6bU;
    h ^= h >> 13;
    h *= 0xc2b2ae35U;
    return h ^ (h >> 16);
}

/// Stored value at a voxel, for a type.
using Content = std::function<double(Index3, std::int64_t index, DataType type)>;

double share(std::int64_t i) { return mixed(i) / 4294967296.0; }
double most_of(DataType type) {
    return is_integer(type) ? highest_of(type) : type == DataType::float16 ? 60000.0 : 3e38;
}
double least_of(DataType type) { return is_integer(type) ? lowest_of(type) : -most_of(type); }

bool any(DataType) { return true; }
bool floats(DataType type) { return !is_integer(type); }
bool wide(DataType type) { return size_of(type) >= 4 || !is_integer(type); }
/// The plain ones need not be of every type.
bool two(DataType type) { return type == DataType::uint8 || type == DataType::float32; }

struct Named {
    char const* name;
    bool (*of)(DataType);
    Content content;
};

std::vector<Named> const& contents() {
    static std::vector<Named> const list{
        {"noise", any, [](Index3, std::int64_t i, DataType) { return std::floor(100 * share(i)); }},
        {"constant", two, [](Index3, std::int64_t, DataType) { return 42.0; }},
        {"extremes", any,
         [](Index3, std::int64_t i, DataType t) { return mixed(i) % 2 == 0 ? least_of(t) : most_of(t); }},
        {"checkerboard", any,
         [](Index3 p, std::int64_t, DataType t) {
             return (p.x + p.y + p.z) % 2 == 0 ? 0.0 : is_integer(t) ? highest_of(t) : 1.0;
         }},
        {"impulse", two,
         [](Index3 p, std::int64_t, DataType) {
             return p == Index3{4, 3, 5} ? 100.0 : 0.0;
         }},
        {"nan", floats, [](Index3, std::int64_t i, DataType) { return mixed(i) % 9 == 0 ? std::nan("") : share(i); }},
        {"all-nan", floats, [](Index3, std::int64_t, DataType) { return std::nan(""); }},
        {"infinite", floats,
         [](Index3, std::int64_t i, DataType) {
             double const infinity = std::numeric_limits<double>::infinity();
             return mixed(i) % 9 == 0 ? infinity : mixed(i) % 9 == 1 ? -infinity : share(i);
         }},
        {"offset", wide,
         [](Index3, std::int64_t i, DataType t) {
             return is_integer(t) ? 1e8 + std::floor(100 * share(i)) : (t == DataType::float16 ? 2e4 : 1e8) + share(i);
         }},
        {"denormal", floats, [](Index3, std::int64_t i, DataType t) {
             double const tiny = t == DataType::float16 ? 6e-8 : t == DataType::float32 ? 1e-45 : 5e-324;
             return tiny * std::floor(50 * share(i));
         }}};
    return list;
}

void store(DataType type, std::byte* to, double value) {
    auto const put = [&](auto v) { std::memcpy(to, &v, sizeof v); };
    auto const whole = [&]<class T>(T) {
        // The largest of 64 bits are no doubles.
        if (value >= highest_of(type)) return put(std::numeric_limits<T>::max());
        put(static_cast<T>(std::max(value, lowest_of(type))));
    };
    switch (type) {
    case DataType::uint8:
        return whole(std::uint8_t{});
    case DataType::int8:
        return whole(std::int8_t{});
    case DataType::uint16:
        return whole(std::uint16_t{});
    case DataType::int16:
        return whole(std::int16_t{});
    case DataType::uint32:
        return whole(std::uint32_t{});
    case DataType::int32:
        return whole(std::int32_t{});
    case DataType::uint64:
        return whole(std::uint64_t{});
    case DataType::int64:
        return whole(std::int64_t{});
    case DataType::float16:
        return put(Half(static_cast<float>(value)));
    case DataType::float32:
        return put(static_cast<float>(value));
    case DataType::float64:
        return put(value);
    }
}

struct Odd {
    char const* name;
    Index3 dims;
    void (*change)(Header&);
};

/// Of noise in uint16: single voxels along axes; frames that are mirrored, turned, sheared, of tiny voxels and far
/// away; and a volume that a small budget does not hold.
std::vector<Odd> const& oddities() {
    static std::vector<Odd> const list{{"single", {1, 1, 1}, [](Header&) {}},
                                       {"flat-x", {1, 7, 5}, [](Header&) {}},
                                       {"flat-y", {7, 1, 5}, [](Header&) {}},
                                       {"flat-z", {7, 5, 1}, [](Header&) {}},
                                       {"line", {40, 1, 1}, [](Header&) {}},
                                       {"mirrored",
                                        {9, 8, 11},
                                        [](Header& h) {
                                            h.geometry.direction[0] = {-1, 0, 0};
                                        }},
                                       {"turned",
                                        {9, 8, 11},
                                        [](Header& h) {
                                            h.geometry.direction[0] = {0.96, 0.28, 0};
                                            h.geometry.direction[1] = {-0.28, 0.96, 0};
                                        }},
                                       {"sheared",
                                        {9, 8, 11},
                                        [](Header& h) {
                                            h.geometry.direction[2] = {0, 0.28, 0.96};
                                        }},
                                       {"far",
                                        {9, 8, 11},
                                        [](Header& h) {
                                            h.geometry.origin = {1e12, -1e9, 1e-9};
                                        }},
                                       {"large", {128, 96, 96}, [](Header&) {}},
                                       {"tiny",
                                        {9, 8, 11},
                                        [](Header& h) {
                                            h.geometry.spacing = {1e-9, 1e-3, 1e6};
                                        }},
                                       {"mapped", {9, 8, 11}, [](Header& h) {
                                            h.values = {-0.5, 1000};
                                        }}};
    return list;
}

Volume filled(Header header, Content const& content) {
    Volume volume(header);
    std::byte* to = volume.mutable_view().data;
    std::int64_t i = 0;
    for (std::int64_t z = 0; z < header.dims.z; ++z)
        for (std::int64_t y = 0; y < header.dims.y; ++y)
            for (std::int64_t x = 0; x < header.dims.x; ++x, ++i, to += size_of(header.dtype))
                store(header.dtype, to, content({x, y, z}, i, header.dtype));
    return volume;
}

std::vector<DataType> types() {
    std::vector<DataType> list;
    for (std::size_t i = 0; i < data_type_count; ++i) list.push_back(static_cast<DataType>(i));
    return list;
}

} // namespace

std::vector<std::string> hard_volume_names() {
    std::vector<std::string> names;
    for (auto const& named : contents())
        for (DataType const type : types())
            if (named.of(type)) names.push_back(text(named.name, "-", type));
    for (auto const& odd : oddities()) names.emplace_back(odd.name);
    return names;
}

Volume hard_volume(std::string const& name) {
    Header header;
    for (auto const& odd : oddities()) {
        if (name != odd.name) continue;
        header.dims = odd.dims;
        header.dtype = DataType::uint16;
        odd.change(header);
        return filled(header, contents().front().content);
    }
    header.dims = {9, 8, 11};
    for (auto const& named : contents())
        for (DataType const type : types()) {
            if (name != text(named.name, "-", type) || !named.of(type)) continue;
            header.dtype = type;
            return filled(header, named.content);
        }
    std::string const near = nearest_name(name, hard_volume_names());
    throw Error(ErrorKind::usage, text("--volume: there is no '", name, "'"),
                near.empty() ? "vkt stress --list names them" : text("did you mean '", near, "'?"));
}

} // namespace vkt::shell
