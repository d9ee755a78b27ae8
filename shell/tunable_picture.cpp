// Pictures as vkt chart varies them.
// SPDX-License-Identifier: MIT
#include "shell/tunable_picture.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "shell/picture_levels.h"

#include <algorithm>
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

DrawnPictures TunablePicture::pictures(Volume const& volume, PictureRequest const& request,
                                       Execution const& execution) const {
    render::RenderSettings settings = options_.settings();
    auto const part = [&](int pixels) {
        return std::max(1, static_cast<int>(std::lround(request.share * static_cast<double>(pixels))));
    };
    settings.width = part(settings.width);
    settings.height = part(settings.height);
    if (request.reference) make_reference(settings);
    std::vector<render::CameraRequest> const cameras = options_.cameras();
    Header header;
    header.dims = {settings.width, settings.height, 3 * static_cast<std::int64_t>(cameras.size())};
    header.dtype = DataType::float32;
    // What is compared with them, and what is drawn meanwhile.
    if (header.bytes() > execution.memory / 4)
        throw Error(ErrorKind::resources,
                    text(static_cast<std::uint64_t>(cameras.size()), " pictures take ",
                         bytes_text(static_cast<double>(header.bytes())), ", and a quarter of --memory is less"),
                    "raise --memory, or ask for fewer or smaller pictures");
    DrawnPictures drawn{Volume(header)};
    auto* levels = reinterpret_cast<float*>(drawn.levels.mutable_view().data);
    render::Color const background = options_.background().color;
    render::Renderer const renderer(volume, execution, settings.tree);
    for (render::CameraRequest const& camera : cameras) {
        settings.camera = camera;
        render::RenderReport report;
        render::Image const image = renderer.render(settings, &report);
        drawn.seconds += report.render_seconds;
        put_levels(image, background, levels);
        levels += image.pixels.size() / 4 * 3;
    }
    return drawn;
}

Index3 TunablePicture::picture_dims() const {
    render::RenderSettings const settings = options_.settings();
    return {settings.width, settings.height, 3 * static_cast<std::int64_t>(options_.cameras().size())};
}

double TunablePicture::picture_cost(Header const& header) const {
    render::RenderSettings const settings = options_.settings();
    double const rays =
        static_cast<double>(settings.width) * settings.height * static_cast<double>(options_.cameras().size());
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
