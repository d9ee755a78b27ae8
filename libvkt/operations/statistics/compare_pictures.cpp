// Comparing two pictures: sums over light, structure and FLIP as displayed.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/compare_pictures.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/core/volume.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/operations/statistics/similarity.h"
#include "libvkt/render/colormap.h"
#include "libvkt/render/flip.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vkt::render {

namespace {

/// One colour as it is displayed, 0 to 1.
std::unique_ptr<Source> displayed(Image const& image, std::size_t channel) {
    Header header;
    header.dims = {image.width, image.height, 1};
    header.dtype = DataType::float64;
    Volume volume(header);
    auto* const values = reinterpret_cast<double*>(volume.mutable_view().data);
    for (std::size_t i = 0; i < image.pixels.size() / 4; ++i)
        values[i] = linear_to_srgb(static_cast<double>(image.pixels[4 * i + channel]));
    auto source = volume_source({std::move(volume)});
    source->next_volume();
    return source;
}

} // namespace

PictureDifference compare_pictures(Image const& reference, Image const& test, Execution const& execution) {
    if (reference.width != test.width || reference.height != test.height)
        throw Error(ErrorKind::usage, text("the pictures differ in size: ", reference.width, " by ", reference.height,
                                           " and ", test.width, " by ", test.height));
    PictureDifference d;
    double squares = 0, relative = 0;
    for (std::size_t i = 0; i < reference.pixels.size(); ++i) {
        double const a = static_cast<double>(reference.pixels[i]), b = static_cast<double>(test.pixels[i]);
        bool const same = a == b; // so that infinities are
        double const apart = same                   ? 0
                             : std::isfinite(a - b) ? std::abs(a - b)
                                                    : std::numeric_limits<double>::infinity();
        double const light = i % 4 == 3 ? 1 - a : a; // the fourth is what passes
        d.max_abs = std::max(d.max_abs, apart);
        squares += apart * apart;
        relative += std::isfinite(light) ? apart * apart / (light * light + 0.01) : apart;
        if (i % 4 != 3) d.levels = std::max(d.levels, 255 * std::abs(linear_to_srgb(a) - linear_to_srgb(b)));
    }
    // Opaque pictures have no alpha that could differ.
    bool alpha = false;
    for (std::size_t i = 3; i < reference.pixels.size(); i += 4)
        alpha = alpha || reference.pixels[i] != 0 || test.pixels[i] != 0;
    double const count = static_cast<double>(reference.pixels.size()) * (alpha ? 1 : 0.75);
    d.rmse = std::sqrt(squares / count);
    d.relmse = relative / count;
    for (std::size_t c = 0; c < 3; ++c)
        d.ssim += structural_similarity(*displayed(reference, c), *displayed(test, c), 1, execution) / 3;
    d.flip = mean_flip(reference, test);
    return d;
}

} // namespace vkt::render
