// map, map_at and reduce on the GPU against one voxel at a time on the host: every pair of types, rows off alignment,
// values at the ends of every type, losses counted.
// SPDX-License-Identifier: MIT
#include "libvkt/core/device.h"
#include "libvkt/core/types.h"
#include "libvkt/kernel/kernel.h"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <vector>

namespace vkt::VKT_BACKEND {
namespace {

constexpr int skipped = 77; ///< exit code by which CTest knows

template <class C> struct Scaled {
    C factor, offset;
    VKT_HD C operator()(C v) const { return v * factor + offset; }
    VKT_HD bool undefined(C v) const { return v == C(3); }
};
template <class C> struct Both {
    VKT_HD C operator()(C a, C b) const { return a - b; }
};
template <class C> struct Slope {
    VKT_HD double operator()(double x, double y, double z, C v) const {
        return x + 100 * y + 10000 * z + static_cast<double>(v);
    }
};
struct Sum {
    double sum = 0;
    std::int64_t count = 0;
    VKT_HD void add(double v) { merge({v, 1}); }
    VKT_HD void merge(Sum const& other) {
        sum += other.sum;
        count += other.count;
    }
};

/// What a volume of a type is filled with: its ends, what lies about the ends of other types, halves, what is no
/// number.
template <class T> std::vector<T> awkward(std::size_t count) {
    std::vector<T> values(count);
    double const ends[] = {
        0,      1,       3,        127,          127.5,        128,          128.5,        255,
        255.5,  256,     -0.5,     -0.5000001,   -1,           -128,         -128.5,       -129,
        32767,  32767.5, 32768,    65504,        65519,        65520,        65535,        65535.5,
        65536,  8388607, 16777217, 2147483647.0, 2147483648.0, 4294967295.0, 4294967296.0, -2147483648.0,
        9.2e18, 1.8e19,  1e30,     -1e30,        3.4e38,       1e39,         1e300,        -1e300};
    std::uint64_t state = 88172645463325252ull;
    for (std::size_t i = 0; i < count; ++i) {
        state ^= state << 13, state ^= state >> 7, state ^= state << 17;
        if (state % 3 == 0) {
            if constexpr (std::is_integral_v<T>)
                values[i] = static_cast<T>(state >> 7);
            else
                values[i] = round_to<T>((static_cast<double>(state >> 40) - 8e6) / 4096.0);
        } else {
            values[i] = round_to<T>(ends[(state >> 8) % (sizeof ends / sizeof ends[0])]);
            if constexpr (!std::is_integral_v<T>)
                if (state % 31 == 1) values[i] = round_to<T>(std::numeric_limits<double>::quiet_NaN());
        }
        // Mostly tame, so that whole packs are in range.
        if (i / 64 % 3 != 0) values[i] = round_to<T>(static_cast<double>(state % 100));
    }
    return values;
}

/// A volume in device memory whose rows have gaps and begin anywhere, and its image on the host.
struct Twin {
    Twin(DataType t, Box const& b, std::int64_t gap) : type(t), box(b) {
        row = b.dims().x + gap;
        slice = row * b.dims().y + gap;
        std::size_t const count = static_cast<std::size_t>(gap + slice * b.dims().z);
        host.resize(count * size_of(t));
        with_type(t, [&]<class T>(T) {
            auto const values = awkward<T>(count);
            std::memcpy(host.data(), values.data(), host.size());
        });
        first = gap;
        device = device_allocate(host.size());
        upload();
    }
    ~Twin() { device_free(device); }
    Twin(Twin const&) = delete;
    Twin& operator=(Twin const&) = delete;
    void upload() { copy_to_device(device, host.data(), host.size()); }
    AnyView view(std::byte* base, Space space) const {
        AnyView v = dense_view(base + static_cast<std::size_t>(first) * size_of(type), type, box, space);
        v.row = row;
        v.slice = slice;
        return v;
    }
    AnyView on_host() { return view(host.data(), Space::host); }
    AnyView on_device() const { return view(device, Space::device); }

    DataType type;
    Box box;
    std::int64_t row = 0, slice = 0, first = 0;
    std::vector<std::byte> host;
    std::byte* device = nullptr;
};

template <class C> C value_at(ConstView v, std::int64_t x, std::int64_t y, std::int64_t z) {
    C value{};
    with_type(v.type, [&]<class T>(T) {
        T stored;
        std::memcpy(&stored, v.at(x, y, z), sizeof stored);
        if constexpr (!std::is_same_v<C, Int128> || std::is_integral_v<T>) value = static_cast<C>(stored);
    });
    return value;
}
template <class R> void store_at(AnyView v, std::int64_t x, std::int64_t y, std::int64_t z, R value, Losses& losses) {
    with_type(v.type, [&]<class T>(T) {
        T const stored = round_to<T>(value);
        losses.clipped += is_clipped<T>(value);
        losses.nan += is_lost_nan<T>(value);
        std::memcpy(const_cast<std::byte*>(v.at(x, y, z)), &stored, sizeof stored);
    });
}
template <class F> void each(Box const& box, F&& f) {
    for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
        for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
            for (std::int64_t x = box.lower.x; x < box.upper.x; ++x) f(x, y, z);
}

int failures = 0, checks = 0;

/// NaN is NaN, whatever its bits.
bool same(DataType type, std::vector<std::byte> const& a, std::vector<std::byte> const& b) {
    bool equal = true;
    with_type(type, [&]<class T>(T) {
        for (std::size_t i = 0; i < a.size(); i += sizeof(T)) {
            T p, q;
            std::memcpy(&p, &a[i], sizeof p);
            std::memcpy(&q, &b[i], sizeof q);
            if constexpr (!std::is_integral_v<T>) {
                auto const x = static_cast<double>(p), y = static_cast<double>(q);
                if (x != x && y != y) continue;
            }
            equal = equal && std::memcmp(&p, &q, sizeof p) == 0;
        }
    });
    return equal;
}

template <class Host, class Gpu> void check(char const* what, Twin& in, Twin& out, Host const& host, Gpu const& gpu) {
    out.upload();
    Losses want, got;
    host(want);
    gpu(got);
    std::vector<std::byte> result(out.host.size());
    copy_to_host(result.data(), out.device, result.size());
    ++checks;
    bool const voxels = same(out.type, result, out.host);
    bool const losses = want.clipped == got.clipped && want.nan == got.nan && want.undefined == got.undefined;
    if (voxels && losses) return;
    ++failures;
    std::printf("FAILED %s %s -> %s%s%s\n", what, std::string(name_of(in.type)).c_str(),
                std::string(name_of(out.type)).c_str(), voxels ? "" : ": voxels differ",
                losses ? "" : ": losses differ");
}

template <class C> void pair(DataType from, DataType to, Box const& box, std::int64_t gap, std::int64_t other_gap) {
    Twin in(from, box, gap), second(from, box, other_gap), out(to, box, other_gap);
    Execution const execution;
    for (C const factor : {C(1), C(2)}) {
        Scaled<C> const f{factor, C(1)};
        check(
            "map", in, out,
            [&](Losses& losses) {
                each(box, [&](auto x, auto y, auto z) {
                    C const v = value_at<C>(in.on_host(), x, y, z);
                    losses.undefined += f.undefined(v);
                    store_at(out.on_host(), x, y, z, f(v), losses);
                });
            },
            [&](Losses& losses) { map<C>(execution, out.on_device(), losses, f, ConstView(in.on_device())); });
    }
    check(
        "map of two", in, out,
        [&](Losses& losses) {
            each(box, [&](auto x, auto y, auto z) {
                store_at(out.on_host(), x, y, z,
                         value_at<C>(in.on_host(), x, y, z) - value_at<C>(second.on_host(), x, y, z), losses);
            });
        },
        [&](Losses& losses) {
            map<C>(execution, out.on_device(), losses, Both<C>{}, ConstView(in.on_device()),
                   ConstView(second.on_device()));
        });
    if constexpr (!std::is_same_v<C, Int128>)
        check(
            "map_at", in, out,
            [&](Losses& losses) {
                each(box, [&](auto x, auto y, auto z) {
                    store_at(out.on_host(), x, y, z,
                             Slope<C>{}(static_cast<double>(x), static_cast<double>(y), static_cast<double>(z),
                                        value_at<C>(in.on_host(), x, y, z)),
                             losses);
                });
            },
            [&](Losses& losses) {
                map_at<C>(execution, out.on_device(), losses, Slope<C>{}, ConstView(in.on_device()));
            });
}

void sums(DataType type, Box const& box, std::int64_t gap) {
    Twin in(type, box, gap);
    with_type(type, [&]<class T>(T) { // small numbers, whose sum is exact
        for (std::size_t i = 0; i < in.host.size(); i += sizeof(T)) {
            T const v = round_to<T>(static_cast<double>(i / sizeof(T) % 101));
            std::memcpy(&in.host[i], &v, sizeof v);
        }
    });
    in.upload();
    Sum want;
    each(box, [&](auto x, auto y, auto z) { want.add(value_at<double>(in.on_host(), x, y, z)); });
    Sum const got = reduce<double>(Execution{}, ConstView(in.on_device()), Sum{});
    ++checks;
    if (got.sum == want.sum && got.count == want.count) return;
    ++failures;
    std::printf("FAILED reduce %s: %.17g of %lld, not %.17g of %lld\n", std::string(name_of(type)).c_str(), got.sum,
                static_cast<long long>(got.count), want.sum, static_cast<long long>(want.count));
}

int run() {
    if (device_count() == 0) {
        std::printf("skipped: no CUDA device\n");
        return skipped;
    }
    std::vector<DataType> const types{DataType::uint8,   DataType::int8,    DataType::uint16, DataType::int16,
                                      DataType::uint32,  DataType::int32,   DataType::uint64, DataType::int64,
                                      DataType::float16, DataType::float32, DataType::float64};
    struct Shape {
        Box box;
        std::int64_t gap, other_gap;
    };
    std::vector<Shape> const shapes{{{{3, 2, 1}, {3 + 1300, 2 + 3, 1 + 2}}, 0, 0}, // dense
                                    {{{0, 0, 0}, {75, 5, 3}}, 16, 32},             // gaps of whole packs
                                    {{{1, 0, 2}, {1 + 203, 7, 5}}, 3, 5},          // nothing aligned
                                    {{{0, 0, 0}, {5, 40, 3}}, 1, 0}};              // shorter than a pack
    for (DataType const type : types)
        for (Shape const& shape : shapes) sums(type, shape.box, shape.gap);
    for (DataType const in : types)
        for (DataType const out : types)
            for (Shape const& s : shapes) {
                pair<double>(in, out, s.box, s.gap, s.other_gap);
                if (size_of(in) <= 2 || in == DataType::float32) pair<float>(in, out, s.box, s.gap, s.other_gap);
                if (is_integer(in)) pair<Int128>(in, out, s.box, s.gap, s.other_gap);
            }
    std::printf("drivers: %d checks, %d failed\n", checks, failures);
    return failures == 0 ? 0 : 1;
}

} // namespace
} // namespace vkt::VKT_BACKEND

int main() { return vkt::VKT_BACKEND::run(); }
