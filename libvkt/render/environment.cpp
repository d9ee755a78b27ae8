// Environments: cumulated brightness, weighted by the solid angle of each row.
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
    for (int v = 0; v < height; ++v) {
        float const* const row = e.pixels.data() + 3 * columns * static_cast<std::size_t>(v);
        float* const ends = e.column_ends.data() + columns * static_cast<std::size_t>(v);
        double whole = 0, part = 0;
        for (std::size_t u = 0; u < columns; ++u) whole += static_cast<double>(brightness_of(row + 3 * u));
        for (std::size_t u = 0; u < columns; ++u) {
            part += static_cast<double>(brightness_of(row + 3 * u));
            ends[u] = whole > 0 ? static_cast<float>(part / whole) : 1.0F;
        }
        double const angle = 2 * half_turn / width *
                             (std::cos(half_turn * v / height) - std::cos(half_turn * (v + 1) / height)); // of a pixel
        rows.push_back(rows.back() + whole * angle);
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
