// The rays of one pixel: where they pass it, and what their light adds up to.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/scene.h"

namespace vkt::render {

/// Premultiplied linear colour and what is transmitted from behind.
struct Radiance {
    float red, green, blue, transmittance;
};

/// Where ray i of n (a power of two) passes a pixel, 0 to 1 each way: Hammersley points in the middle of their strata,
/// whose mean is the middle of the pixel, so that what is linear over it comes out exactly.
struct PixelPlace {
    double x, y;
};
VKT_HD PixelPlace place_in_pixel(int i, int n) {
    auto bits = static_cast<std::uint32_t>(i);
    bits = bits << 16 | bits >> 16;
    bits = (bits & 0x00ff00ffU) << 8 | (bits & 0xff00ff00U) >> 8;
    bits = (bits & 0x0f0f0f0fU) << 4 | (bits & 0xf0f0f0f0U) >> 4;
    bits = (bits & 0x33333333U) << 2 | (bits & 0xccccccccU) >> 2;
    bits = (bits & 0x55555555U) << 1 | (bits & 0xaaaaaaaaU) >> 1;
    double const half = 0.5 / n;
    return {(i + 0.5) / n, static_cast<double>(bits) * 0x1p-32 + half};
}

/// Sums of one pixel. In double and one ray after the other, so that many passes give the bits of one.
class PixelSums {
public:
    VKT_HD PixelSums(SceneView const& scene, int x, int y)
        : view_(scene.sums), at_(4 * (y * static_cast<std::int64_t>(scene.frame.width) + x)), count_(scene.before) {
        for (int c = 0; c < 4; ++c) {
            light_[c] = view_.light != nullptr ? view_.light[at_ + c] : 0;
            odd_[c] = view_.odd != nullptr ? view_.odd[at_ + c] : 0;
            squares_[c] = view_.squares != nullptr ? view_.squares[at_ + c] : 0;
        }
    }
    VKT_HD void add(Radiance const& r) {
        double const part[4] = {r.red, r.green, r.blue, r.transmittance};
        for (int c = 0; c < 4; ++c) light_[c] += part[c];
        if ((count_ & 1) != 0)
            for (int c = 0; c < 4; ++c) odd_[c] += part[c];
        if (view_.squares != nullptr)
            for (int c = 0; c < 4; ++c) {
                double const shown = c < 3 ? part[c] + part[3] * static_cast<double>(view_.behind[c]) : part[3];
                squares_[c] += shown * shown;
            }
        ++count_;
    }
    /// Stores the sums; returns the mean of all rays.
    VKT_HD Radiance finish() const {
        for (int c = 0; c < 4; ++c) {
            if (view_.light != nullptr) view_.light[at_ + c] = light_[c];
            if (view_.odd != nullptr) view_.odd[at_ + c] = odd_[c];
            if (view_.squares != nullptr) view_.squares[at_ + c] = squares_[c];
        }
        double const mean = 1.0 / count_;
        return {static_cast<float>(light_[0] * mean), static_cast<float>(light_[1] * mean),
                static_cast<float>(light_[2] * mean), static_cast<float>(light_[3] * mean)};
    }

private:
    SumsView view_;
    std::int64_t at_;
    int count_;
    double light_[4], odd_[4], squares_[4];
};

} // namespace vkt::render
