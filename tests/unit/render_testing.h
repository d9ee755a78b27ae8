// Helpers of the rendering tests: volumes with known content, views along an axis, flat transfer functions.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/render.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <string>
#include <vector>

namespace vkt::render::testing {

inline Volume float_volume(Index3 dims, Vec3 spacing) {
    Header header;
    header.dims = dims;
    header.dtype = DataType::float32;
    header.geometry.spacing = spacing;
    return Volume(header);
}

/// Calls f(x, y, z) for every voxel.
template <class F> Volume volume_of(Index3 dims, Vec3 spacing, F f) {
    Volume volume = float_volume(dims, spacing);
    auto const v = volume.mutable_view().as<float>();
    for (std::int64_t z = 0; z < dims.z; ++z)
        for (std::int64_t y = 0; y < dims.y; ++y)
            for (std::int64_t x = 0; x < dims.x; ++x)
                v(x, y, z) =
                    static_cast<float>(f(static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)));
    return volume;
}

inline Volume constant_volume(Index3 dims, float value, Vec3 spacing) {
    return volume_of(dims, spacing, [=](double, double, double) { return value; });
}

/// Two soft blobs on an empty ground, values 0 to about 200, in the given type.
inline Volume blobs(Index3 dims, DataType type) {
    auto const n = [](std::int64_t extent) { return static_cast<double>(extent); };
    auto const value = [&](double x, double y, double z) {
        auto const blob = [&](double cx, double cy, double cz, double r) {
            double const dx = x / n(dims.x) - cx, dy = y / n(dims.y) - cy, dz = z / n(dims.z) - cz;
            return 1 - std::sqrt(dx * dx + dy * dy + dz * dz) / r;
        };
        return std::floor(200 * std::max({0.0, blob(0.3, 0.35, 0.3, 0.22), blob(0.65, 0.6, 0.7, 0.25)}));
    };
    Header header;
    header.dims = dims;
    header.dtype = type;
    Volume volume(header);
    AnyView const view = volume.mutable_view();
    auto const fill = [&](auto* one) {
        using T = std::remove_pointer_t<decltype(one)>;
        auto const v = view.as<T>();
        for (std::int64_t z = 0; z < dims.z; ++z)
            for (std::int64_t y = 0; y < dims.y; ++y)
                for (std::int64_t x = 0; x < dims.x; ++x) v(x, y, z) = static_cast<T>(value(n(x), n(y), n(z)));
    };
    switch (type) {
    case DataType::uint8:
        fill(static_cast<std::uint8_t*>(nullptr));
        break;
    case DataType::uint16:
        fill(static_cast<std::uint16_t*>(nullptr));
        break;
    case DataType::int16:
        fill(static_cast<std::int16_t*>(nullptr));
        break;
    case DataType::float32:
        fill(static_cast<float*>(nullptr));
        break;
    default:
        fill(static_cast<double*>(nullptr));
        break;
    }
    return volume;
}

/// One linear colour and opacity for all values.
inline TransferFunction flat_transfer(Color color, double alpha, double unit) {
    TransferFunction transfer;
    transfer.points = {{0, color, alpha}};
    transfer.linear_colors = true;
    transfer.unit = unit;
    return transfer;
}

inline RenderSettings orthographic(std::string view, int width, int height) {
    RenderSettings s;
    s.tree = TreeDrawing::bricks;
    s.width = width, s.height = height;
    s.camera.view = std::move(view);
    s.camera.projection = Projection::orthographic;
    s.shade = 0;
    return s;
}

struct Picture {
    Image image;
    RenderReport report;
    float const* center() const { return image.at(image.width / 2, image.height / 2); }
};
inline Picture render_one(Volume const& volume, RenderSettings const& settings) {
    Picture picture;
    picture.image = render::render(volume, settings, default_execution(), &picture.report);
    return picture;
}

inline double greatest_difference(Image const& a, Image const& b) {
    double greatest = 0;
    for (std::size_t i = 0; i < a.pixels.size(); ++i)
        greatest = std::max(greatest, static_cast<double>(std::abs(a.pixels[i] - b.pixels[i])));
    return greatest;
}

struct Skipping {
    RenderReport with, without;
};

/// Draws with and without skipping, and with the best instructions on three threads: the same bits.
inline Skipping expect_no_bit_changes(Volume const& volume, RenderSettings s, std::string const& what) {
    Skipping reports;
    Execution const one;
    s.skip = false;
    Image const all = render::render(volume, s, one, &reports.without);
    s.skip = true;
    Image const skipped = render::render(volume, s, one, &reports.with);
    EXPECT_EQ(all.pixels, skipped.pixels) << what;
    Execution best = default_execution();
    best.threads = 3;
    EXPECT_EQ(render::render(volume, s, best).pixels, skipped.pixels) << what;
    return reports;
}

} // namespace vkt::render::testing
