// Environments: cumulated brightness, weighted by the solid angle of each row, and moments.
// SPDX-License-Identifier: MIT
#include "libvkt/render/environment.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/radiance.h"
#include "libvkt/render/picture_file.h"

#include <algorithm>
#include <cmath>

namespace vkt::render {

EnvironmentView Environment::view(double degrees) const {
    double const angle = degrees * half_turn / 180;
    float const per_total = total > 0 ? static_cast<float>(1 / total) : 0.0F;
    return {pixels.data(), row_ends.data(), column_ends.data(), width,
            height,        per_total,       std::cos(angle),    std::sin(angle)};
}

namespace {

/// Integrals over one pixel of a row's columns, of angles a with x = r sin a and y = r cos a: 1, sin, cos, sin^2,
/// cos^2, sin cos.
std::array<double, 6> along_row(double from, double to) {
    double const width = to - from, twice = (std::sin(2 * to) - std::sin(2 * from)) / 4;
    double const sine = std::sin(to), before = std::sin(from);
    return {width,
            std::cos(from) - std::cos(to),
            sine - before,
            width / 2 - twice,
            width / 2 + twice,
            (sine * sine - before * before) / 2};
}

/// Adds the moments of a row between two heights, the lower one first, from sums over its pixels as along_row() has
/// them.
void add_row(std::array<double, 10>& moments, std::array<double, 6> const& sums, double low, double high) {
    auto const between = [&](auto const& f) { return f(high) - f(low); };
    auto const radius = [](double z) { return std::sqrt(std::max(0.0, 1 - z * z)); };
    double const height = high - low, r = between([&](double z) { return (z * radius(z) + std::asin(z)) / 2; }),
                 rr = between([](double z) { return z - z * z * z / 3; }),
                 rz = between([&](double z) { return -std::pow(radius(z), 3) / 3; }),
                 z1 = between([](double z) { return z * z / 2; }), zz = between([](double z) { return z * z * z / 3; });
    auto const [all, sine, cosine, sine2, cosine2, both] = sums;
    std::array<double, 10> const row{all * height, sine * r, cosine * r, all * z1,  sine2 * rr,
                                     cosine2 * rr, all * zz, both * rr,  sine * rz, cosine * rz};
    for (std::size_t i = 0; i < row.size(); ++i) moments[i] += row[i];
}

} // namespace

std::array<double, 10> Environment::moments_of(std::size_t color, double degrees) const {
    auto const [all, x, y, z, xx, yy, zz, xy, xz, yz] = moments[color];
    double const angle = degrees * half_turn / 180, c = std::cos(angle), s = std::sin(angle);
    return {all,
            c * x - s * y,
            s * x + c * y,
            z,
            c * c * xx - 2 * c * s * xy + s * s * yy,
            s * s * xx + 2 * c * s * xy + c * c * yy,
            zz,
            c * s * (xx - yy) + (c * c - s * s) * xy,
            c * xz - s * yz,
            s * xz + c * yz};
}

std::shared_ptr<Environment const> make_environment(int width, int height, std::vector<float> pixels) {
    auto made = std::make_shared<Environment>();
    Environment& e = *made;
    e.width = width, e.height = height;
    e.pixels = std::move(pixels);
    for (float& value : e.pixels) {
        if (!std::isfinite(value))
            throw Error(ErrorKind::data, "an environment has pixels that are infinite or not a number");
        value = std::max(value, 0.0F);
    }
    auto const columns = static_cast<std::size_t>(width);
    e.column_ends.resize(columns * static_cast<std::size_t>(height));
    std::vector<double> rows(1, 0.0);
    std::vector<std::array<double, 6>> parts; // of each column
    parts.reserve(columns);
    for (int u = 0; u < width; ++u)
        parts.push_back(along_row(2 * half_turn * (1.0 * u / width - 0.5), 2 * half_turn * ((u + 1.0) / width - 0.5)));
    for (int v = 0; v < height; ++v) {
        float const* const row = e.pixels.data() + 3 * columns * static_cast<std::size_t>(v);
        float* const ends = e.column_ends.data() + columns * static_cast<std::size_t>(v);
        double whole = 0, part = 0;
        for (std::size_t u = 0; u < columns; ++u) whole += static_cast<double>(brightness_of(row + 3 * u));
        for (std::size_t u = 0; u < columns; ++u) {
            part += static_cast<double>(brightness_of(row + 3 * u));
            ends[u] = whole > 0 ? static_cast<float>(part / whole) : 1.0F;
        }
        double const high = std::cos(half_turn * v / height), low = std::cos(half_turn * (v + 1) / height);
        rows.push_back(rows.back() + whole * (2 * half_turn / width * (high - low)));
        for (std::size_t c = 0; c < 3; ++c) {
            std::array<double, 6> sums{};
            for (std::size_t u = 0; u < columns; ++u)
                for (std::size_t i = 0; i < sums.size(); ++i)
                    sums[i] += static_cast<double>(row[3 * u + c]) * parts[u][i];
            add_row(e.moments[c], sums, low, high);
        }
    }
    e.total = rows.back();
    for (double const end : rows) e.row_ends.push_back(e.total > 0 ? static_cast<float>(end / e.total) : 0.0F);
    return made;
}

std::shared_ptr<Environment const> read_environment(std::string const& path) {
    auto const bytes = open_bytes(path);
    try {
        if (is_radiance(bytes->peek(10))) {
            RadiancePicture picture = read_radiance(*bytes);
            return make_environment(picture.width, picture.height, std::move(picture.values));
        }
        Image const image = read_picture(*bytes).image;
        std::vector<float> pixels;
        pixels.reserve(image.pixels.size() / 4 * 3);
        for (std::size_t i = 0; i < image.pixels.size(); i += 4)
            pixels.insert(pixels.end(), image.pixels.begin() + static_cast<std::ptrdiff_t>(i),
                          image.pixels.begin() + static_cast<std::ptrdiff_t>(i) + 3);
        return make_environment(image.width, image.height, std::move(pixels));
    } catch (Error const& error) {
        throw Error(error.kind(), text("--environment '", path, "': ", error.what()),
                    error.kind() == ErrorKind::data ? "it is a picture of all directions: OpenEXR, Radiance, PFM or PNG"
                                                    : error.hint());
    }
}

} // namespace vkt::render
