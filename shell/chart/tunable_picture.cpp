// Pictures as vkt chart varies them.
// SPDX-License-Identifier: MIT
#include "shell/chart/tunable_picture.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "shell/picture/picture_levels.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace vkt::shell {
namespace {

constexpr char finest_tolerance[] = "0.25"; ///< display levels

/// Of ray marching: shading and shadows have no exact form. Where colours are chosen from the data they are shaded.
bool has_exact_form(render::RenderSettings const& settings) {
    bool const chosen = !settings.transfer && settings.lut.empty() && settings.opacity == "auto";
    bool const shaded = settings.shade > 0 || (settings.shade < 0 && chosen);
    return !shaded && !render::holds_back_light(settings, settings.algorithm);
}

void make_reference(render::RenderSettings& settings) {
    bool const in_time = std::exchange(settings.goal.seconds, 0) > 0;
    settings.shortcut = 0;
    if (settings.algorithm == render::Algorithm::multi_scattering) {
        settings.first_sample += 1 << 20;
        if (settings.goal.noise > 0)
            settings.goal.noise /= 2; // the paths that it takes are as many as there are to be
        else
            settings.samples = in_time ? 1024 : std::max(1024, 4 * settings.samples);
        return;
    }
    if (in_time && !(settings.goal.tolerance > 0)) settings.goal.tolerance = parse_double(finest_tolerance);
    if (settings.algorithm != render::Algorithm::ray_marching || settings.exact) return;
    settings.exact = has_exact_form(settings);
    if (settings.exact)
        settings.skip = true;
    else
        settings.step = 1.0 / 32;
}

} // namespace

/// Without a tolerance a ray through the middle of a pixel is what the picture is, and marching it is what can be less
/// exact; with one the picture is the mean over the pixel. Surfaces are met exactly by every ray, and only the rays can
/// be more.
std::vector<Knob> TunablePicture::knobs() const {
    render::RenderSettings const settings = options_.settings();
    if (settings.algorithm == render::Algorithm::multi_scattering) {
        if (settings.goal.noise > 0) return {{"noise", {"8", "4", "2", "1"}, "1", false}};
        return {{"spp", {"4", "16", "64", "256"}, "256"}};
    }
    if (settings.algorithm != render::Algorithm::ray_marching || settings.goal.tolerance > 0)
        return {{"tolerance", {"16", "8", "4", "2", "1"}, finest_tolerance, false}};
    if (settings.exact) return {};
    std::vector<Knob> knobs{{"step", {"4", "2", "1", "0.5", "0.25", "0.125"}, "0.125"}};
    if (!settings.goal.any()) knobs.push_back({"leave-out", {"2", "0.5"}, "0"});
    if (has_exact_form(settings)) knobs.push_back({"exact", {"on"}, ""});
    return knobs;
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
        drawn.on_gpu = drawn.on_gpu || report.gpu_seconds > 0;
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
    if (settings.goal.any() || settings.shortcut > 0) return 0; // as many as it takes
    if (settings.algorithm == render::Algorithm::multi_scattering) return rays * settings.samples;
    if (settings.algorithm != render::Algorithm::ray_marching || settings.exact) return 0;
    return rays * std::hypot(length(0), length(1), length(2)) / settings.step;
}

std::string TunablePicture::reference_method() const {
    render::RenderSettings settings = options_.settings();
    make_reference(settings);
    if (settings.algorithm == render::Algorithm::multi_scattering)
        return settings.goal.noise > 0 ? text("other paths to --noise ", settings.goal.noise)
                                       : text(settings.samples, " other paths a pixel");
    std::string const all_over =
        settings.goal.tolerance > 0 ? text(" and --tolerance ", settings.goal.tolerance) : std::string();
    return settings.algorithm != render::Algorithm::ray_marching ? "exact cubic per voxel" + all_over
           : settings.exact                                      ? "--exact" + all_over
                                                                 : text("--step ", settings.step, all_over);
}

} // namespace vkt::shell
