// A picture as vkt chart varies it.
// SPDX-License-Identifier: MIT
#include "shell/tunable_picture.h"

#include "libvkt/core/text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace vkt::shell {
namespace {

/// Shading has no exact form: there the steps are short.
void make_reference(render::RenderSettings& settings) {
    if (settings.algorithm == render::Algorithm::multi_scattering) {
        settings.first_sample += 1 << 20;
        settings.samples = std::max(1024, 4 * settings.samples);
    } else if (settings.algorithm == render::Algorithm::ray_marching && !settings.exact) {
        settings.exact = settings.shade == 0;
        if (settings.exact)
            settings.skip = true;
        else
            settings.step = 1.0 / 32;
    }
}

} // namespace

std::vector<Knob> TunablePicture::knobs() const {
    render::RenderSettings const settings = options_.settings();
    if (settings.algorithm == render::Algorithm::multi_scattering) return {{"spp", {"4", "16", "64", "256"}, "256"}};
    if (settings.algorithm != render::Algorithm::ray_marching || settings.exact) return {};
    return {{"step", {"4", "2", "1", "0.5", "0.25", "0.125"}, "0.125"}};
}

DrawnPicture TunablePicture::picture(Volume const& volume, PictureRequest const& request,
                                     Execution const& execution) const {
    render::RenderSettings settings = options_.settings();
    auto const part = [&](int pixels) {
        return std::max(1, static_cast<int>(std::lround(request.share * static_cast<double>(pixels))));
    };
    settings.width = part(settings.width);
    settings.height = part(settings.height);
    if (request.reference) make_reference(settings);
    render::RenderReport report;
    render::Image const image = render::render(volume, settings, execution, &report);
    render::Background const background = options_.background();
    Header header;
    header.dims = {settings.width, settings.height, 3};
    header.dtype = DataType::float32;
    DrawnPicture drawn{Volume(header), report.render_seconds};
    auto* const levels = reinterpret_cast<float*>(drawn.levels.mutable_view().data);
    auto const pixels = static_cast<std::size_t>(settings.width) * static_cast<std::size_t>(settings.height);
    std::array<double, 3> const behind{background.color.red, background.color.green, background.color.blue};
    for (std::size_t i = 0; i < pixels; ++i)
        for (std::size_t c = 0; c < 3; ++c) {
            float const* const p = image.pixels.data() + 4 * i;
            double const light =
                static_cast<double>(p[c]) + static_cast<double>(p[3]) * render::srgb_to_linear(behind[c]);
            levels[c * pixels + i] = static_cast<float>(255 * render::linear_to_srgb(std::clamp(light, 0.0, 1.0)));
        }
    return drawn;
}

Index3 TunablePicture::picture_dims() const {
    render::RenderSettings const settings = options_.settings();
    return {settings.width, settings.height, 3};
}

double TunablePicture::picture_cost(Header const& header) const {
    render::RenderSettings const settings = options_.settings();
    double const rays = static_cast<double>(settings.width) * settings.height;
    auto const length = [&](int axis) { return static_cast<double>(header.dims[axis]); };
    if (settings.algorithm == render::Algorithm::multi_scattering) return rays * settings.samples;
    if (settings.algorithm != render::Algorithm::ray_marching || settings.exact) return 0;
    return rays * std::hypot(length(0), length(1), length(2)) / settings.step;
}

std::string TunablePicture::reference_method() const {
    render::RenderSettings settings = options_.settings();
    make_reference(settings);
    return settings.algorithm == render::Algorithm::multi_scattering ? text(settings.samples, " other paths a pixel")
           : settings.algorithm != render::Algorithm::ray_marching   ? "exact cubic per voxel"
           : settings.exact                                          ? "--exact"
                                                                     : text("--step ", settings.step);
}

} // namespace vkt::shell
