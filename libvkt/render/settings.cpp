// Render settings as parameters: declaration, reading, what excludes what.
// SPDX-License-Identifier: MIT
#include "libvkt/render/settings.h"

#include "libvkt/core/collect.h"
#include "libvkt/formats/format.h"
#include "libvkt/render/keyframes.h"
#include "libvkt/render/passes.h"
#include "libvkt/render/refuse.h"
#include "libvkt/render/transfer_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <utility>

namespace vkt::render {

namespace {

/// An environment is all that lights surfaces.
bool lit_by_environment(RenderSettings const& s) {
    return s.environment && !s.light_direction && applies("shade", s.algorithm);
}

/// "R,G,B" or "R,G,B,A", or one number for grey; each in [0,1].
std::vector<double> read_color(std::string const& name, std::string const& words, std::size_t most) {
    std::vector<double> values;
    for (std::string const& part : split(words, ',')) {
        try {
            values.push_back(parse_double(part));
        } catch (Error const& error) {
            refuse(text("--", name, " '", words, "': ", error.what()));
        }
    }
    if (values.size() == 1) values = {values[0], values[0], values[0]};
    bool const fits = values.size() >= 3 && values.size() <= most;
    if (!fits || std::any_of(values.begin(), values.end(), [](double v) { return !(v >= 0 && v <= 1); }))
        refuse(text("--", name, " '", words, "' is no colour"),
               text("give R,G,B", most == 4 ? "[,A]" : "", " with values from 0 to 1"));
    return values;
}

/// "WxH" or "N" for a square.
std::pair<int, int> read_size(std::string const& words) {
    auto const parts = split(lower_case(words), 'x');
    auto const read = [&](std::string const& part) {
        if (part.empty() || part.find_first_not_of("0123456789") != std::string::npos)
            refuse(text("--size '", words, "' is not WxH"), "for example --size 1024x768");
        std::int64_t const n = part.size() > 9 ? 0 : parse_integer(part);
        if (n < 1 || n > 16384) refuse(text("--size '", words, "': an image has 1 to 16384 pixels each way"));
        return static_cast<int>(n);
    };
    if (parts.size() == 1) return {read(parts[0]), read(parts[0])};
    if (parts.size() != 2) refuse(text("--size '", words, "' is not WxH"), "for example --size 1024x768");
    return {read(parts[0]), read(parts[1])};
}

} // namespace

void SettingsParameters::declare(Parameters& list) {
    list_ = &list;
    RenderSettings& s = settings_;
    list.option("render-algo", algorithm_, "ALGORITHM", "how light travels").alias("ra");
    list.option("size", size_, "WxH", "pixels of the picture");
    list.option("background", background_, "R,G,B[,A]",
                "sRGB colour behind the volume, 0 to 1; A below 1 keeps the picture transparent");

    list.option("view", s.camera.view, "VIEW", "side the camera stands on: oblique, x, -x, y, -y, z, -z");
    list.option("azimuth", s.camera.azimuth, "DEGREES", "turn around z; 0 is the -y side, 90 the x side");
    list.option("elevation", s.camera.elevation, "DEGREES", "height above the xy plane, -90 to 90");
    list.option("eye", s.camera.eye, "X,Y,Z", "camera position in world units; overrules view and angles");
    list.option("target", s.camera.target, "X,Y,Z",
                "point to look at in world units (default: centre of what is shown)");
    list.option("up", s.camera.up, "X,Y,Z", "direction that points upwards in the picture");
    list.option("zoom", s.camera.zoom, "FACTOR", "2 shows things twice as large");
    list.option("fov", s.camera.fov, "DEGREES", "vertical field of view");
    list.option("span", s.camera.span, "LENGTH", "orthographic: world length from bottom to top of the picture");
    list.option("orbit", orbit_, "N", "N numbered pictures, once around the z axis; the camera keeps its distance");
    list.option("keyframes", keyframes_file_, "FILE",
                "numbered pictures along a smooth way through these cameras: a JSON file, or the JSON itself");
    list.option("frames", frames_, "N", "how many pictures --keyframes makes (default: one of each camera)");
    list.option("projection", s.camera.projection, "PROJECTION", "how lines in space meet the picture");
    list.option("fit", s.camera.fit, "WHAT", "what the default camera shows: the visible content or the whole volume");

    list.option("rgba-lookup-table", s.lut, "R G B A",
                "transfer function: colour and opacity, 0 to 1, equally spaced over the domain")
        .alias("lut");
    list.option("transfer", transfer_file_, "FILE",
                "transfer function from a JSON file, also one of ParaView's; or the JSON itself");
    auto const maps = collect(colormap_names(), [](std::string const& map) {
        std::string_view const other = other_name(map);
        return other.empty() ? map : text(map, " (or ", other, ")");
    });
    list.option("colormap", s.colormap, "NAME", text(join(maps, ", "), "; append :reverse"));
    list.option("preset", s.preset, "KIND",
                "colours and opacities for a kind of data; ct… expect HU, the others follow the histogram");
    list.option("opacity", s.opacity, "A,A,...", "opacities over the domain, or VALUE:A pairs, or auto");
    list.option("domain", s.domain, "LO:HI", "values that the colours span; also minmax, p1:p99 (percentiles), auto");
    list.option("unit-distance", s.unit, "DISTANCE",
                "world length that opacities hold for (default: smallest spacing); auto is diagonal/256");
    list.option("opacity-scale", s.opacity_scale, "FACTOR", "multiplies all extinctions");
    list.option("labels", s.labels, "WHEN",
                "each label opaque, in a colour of its own: auto (where the header says labels), always, never");
    list.option(
        "tree", s.tree, "WAY",
        "hierarchical volumes: bricks, each at its own level, the same marched through blocks, grid of their finest "
        "cells, or auto: the grid where it is smaller, else blocks");
    list.option("shade", shading_, "SHADING",
                "light at the camera: auto shades iso-surfaces and automatic colours; or a strength, 0 to 1")
        .choices = {"auto", "none", "gradient"};
    list.option("light-direction", s.light_direction, "X,Y,Z",
                "direction towards the light, in world axes, instead of a light at the camera");
    list.option("ambient", s.ambient, "SHARE",
                "share of the light that comes from everywhere, 0 to 1; with --environment alone all of it");
    list.option("specular", s.specular, "SHARE", "strength of highlights, 0 to 1");
    list.flag("shadows", s.shadows, "surfaces, or the marched volume, throw shadows, with --light-direction");
    list.option("ambient-occlusion", s.ambient_occlusion, "N",
                "hold back light from everywhere by what is nearby, in N directions, 6 to 64");
    list.option("occlusion-radius", s.occlusion_radius, "LENGTH",
                "world length that counts as nearby (default: a tenth of the diagonal)");
    list.option("clip-box", s.clip, "REGION", "show only this part, named as --roi of vkt crop names it");
    list.option("clip-plane", s.clip_planes, "NX NY NZ D",
                "show only where NX x + NY y + NZ z >= D, in world units; up to 6 planes, four numbers each");

    list.option(
        "tolerance", tolerance_, "LEVELS",
        "all but multi-scattering: refine steps and edges until the estimated error of each pixel is below, in 255ths");
    list.option("noise", noise_, "LEVELS",
                "multi-scattering: paths until the standard error is below everywhere, in 255ths; --spp is the most");
    list.option("time", seconds_, "SECONDS", "refine the picture for so long, or until it is good enough");

    list.option("step", s.step, "VOXELS", "ray marching: length of a segment");
    list.option("leave-out", s.shortcut, "LEVELS",
                "ray marching: leave out rays and steps that are estimated to change no pixel by more, in 255ths");
    list.flag("exact", s.exact,
              "ray marching: slow reference, exact but for rounding, transfer function without a table");
    list.flag("no-skip", no_skip_, "ray marching: sample empty space too; the picture is the same");

    list.option("iso", s.isos, "VALUE", "implicit-iso: values of the surfaces (default: chosen from the data)");
    list.option("iso-color", s.iso_colors, "R G B", "implicit-iso: colour of each surface, 0 to 1");
    list.option("iso-opacity", s.iso_opacities, "A", "implicit-iso: opacity of each surface, 0 to 1 (default: 1)");

    list.option("spp", s.samples, "N",
                "multi-scattering: paths per pixel; implicit-iso: rays of a pixel at an edge (default: 4; 1: no more)");
    list.option("first-sample", s.first_sample, "N", "multi-scattering: number of the first path, to share work out");
    list.option("seed", seed_, "N", "multi-scattering: seed of the random numbers");
    list.option("albedo", s.albedo, "SHARE", "multi-scattering: multiplies the colours, 0 to 1");
    list.option("anisotropy", s.anisotropy, "G",
                "multi-scattering: mean cosine of the scattering angle, above 0 forwards (Henyey-Greenstein)");
    list.option("light", light_, "R,G,B", "multi-scattering: light from all around, linear");
    list.option(
        "environment", s.environment_file, "FILE",
        "light from everywhere is that of a picture of all directions, equirectangular: .exr, .hdr, .pfm, .png");
    list.option("environment-rotation", s.environment_rotation, "DEGREES",
                "turn it around z, counterclockwise from above; its middle is in the direction of y");
    list.option("environment-strength", s.environment_strength, "FACTOR", "multiplies its light");
    list.flag("denoise", denoise_, "multi-scattering: not there, since Debian has no package of Open Image Denoise");
    list.flag("emission", s.emission, "multi-scattering: colours also glow, as in ray marching");
}

namespace {

struct Use {
    char const* option;
    bool march, iso, scatter, project;
};
constexpr std::array<Use, 32> uses{{{"step", true, false, false, false},
                                    {"leave-out", true, false, false, false},
                                    {"tolerance", true, true, false, true},
                                    {"noise", false, false, true, false},
                                    {"exact", true, false, false, false},
                                    {"no-skip", true, false, false, false},
                                    {"shade", true, true, false, false},
                                    {"light-direction", true, true, true, false},
                                    {"ambient", true, true, true, false},
                                    {"specular", true, true, false, false},
                                    {"shadows", true, true, false, false},
                                    {"ambient-occlusion", true, true, false, false},
                                    {"occlusion-radius", true, true, false, false},
                                    {"iso", false, true, false, false},
                                    {"iso-color", false, true, false, false},
                                    {"iso-opacity", false, true, false, false},
                                    {"unit-distance", true, false, true, false},
                                    {"opacity", true, false, true, false},
                                    {"opacity-scale", true, false, true, false},
                                    {"rgba-lookup-table", true, true, true, true},
                                    {"preset", true, true, true, false},
                                    {"spp", false, true, true, false},
                                    {"first-sample", false, false, true, false},
                                    {"seed", false, false, true, false},
                                    {"albedo", false, false, true, false},
                                    {"anisotropy", false, false, true, false},
                                    {"light", false, false, true, false},
                                    {"environment", true, true, true, false},
                                    {"environment-rotation", true, true, true, false},
                                    {"environment-strength", true, true, true, false},
                                    {"denoise", false, false, true, false},
                                    {"emission", false, false, true, false}}};

/// "auto" is below 0: chosen by the renderer.
double read_shading(std::string const& word) {
    if (word == "auto") return -1;
    if (word == "none") return 0;
    if (word == "gradient") return 1;
    double const strength = is_number(word) ? parse_double(word) : -1;
    if (strength >= 0 && strength <= 1) return strength;
    std::string const near = nearest_name(word, {"auto", "none", "gradient"});
    refuse(text("--shade: '", word, "' is not one of auto, none, gradient and no strength from 0 to 1"),
           near.empty() ? "" : text("did you mean '", near, "'?"));
}

} // namespace

bool applies(std::string_view option, Algorithm algorithm) {
    auto const use = std::find_if(uses.begin(), uses.end(), [&](Use const& u) { return u.option == option; });
    if (use == uses.end()) return true;
    return is_projection(algorithm)               ? use->project
           : algorithm == Algorithm::ray_marching ? use->march
           : algorithm == Algorithm::implicit_iso ? use->iso
                                                  : use->scatter;
}

bool holds_back_light(RenderSettings const& settings, Algorithm algorithm) {
    return (settings.shadows && algorithm == Algorithm::ray_marching) || settings.ambient_occlusion > 0;
}

namespace {

/// "ray-marching, implicit-iso"
std::string takers_of(std::string_view option) {
    std::string names;
    for (Algorithm const algorithm : {Algorithm::ray_marching, Algorithm::implicit_iso, Algorithm::multi_scattering})
        if (applies(option, algorithm)) names += text(names.empty() ? "" : ", ", enum_name(algorithm));
    return names;
}

} // namespace

void SettingsParameters::refuse_misfits() const {
    for (Use const& use : uses)
        if (!applies(use.option, algorithm_) && list_->given(use.option))
            refuse(text("--", use.option, " does not apply to --render-algo ", enum_name(algorithm_)),
                   text("it does to --render-algo ", takers_of(use.option)));
    auto const exclude = [&](std::string_view a, std::string_view b) {
        if (list_->given(a) && list_->given(b)) refuse(text("--", a, " and --", b, " exclude each other"));
    };
    for (char const* other : {"transfer", "colormap", "opacity"}) exclude("rgba-lookup-table", other);
    for (char const* other : {"colormap", "opacity", "domain"}) exclude("transfer", other);
    for (char const* other : {"rgba-lookup-table", "transfer", "opacity", "domain"}) exclude("preset", other);
    for (char const* other : {"view", "azimuth", "elevation", "fit"}) exclude("eye", other);
    exclude("orbit", "eye");
    for (char const* other :
         {"eye", "target", "up", "view", "azimuth", "elevation", "fit", "fov", "span", "projection", "orbit"})
        exclude("keyframes", other);
    if (frames_ && keyframes_file_.empty()) refuse("--frames is for --keyframes");
    if (frames_ && (*frames_ < 1 || *frames_ > 100'000))
        refuse(text("--frames ", *frames_, " is not 1 to 100000 pictures"));
    if (orbit_ && (*orbit_ < 1 || *orbit_ > 100'000)) refuse(text("--orbit ", *orbit_, " is not 1 to 100000 pictures"));
    if (settings_.labels == LabelMode::always) {
        for (char const* other : {"rgba-lookup-table", "transfer", "preset", "colormap", "opacity", "domain", "iso",
                                  "iso-color", "iso-opacity", "exact"})
            if (list_->given(other)) refuse(text("--labels always has colours of its own, and no --", other));
        if (is_projection(algorithm_))
            refuse(text("--labels always: the ", enum_name(algorithm_), " of labels along a ray is no label"),
                   "--render-algo ray-marching draws the nearest one");
        if (algorithm_ == Algorithm::multi_scattering)
            refuse("--labels always: labels are opaque, and nothing is scattered in them",
                   "--render-algo ray-marching with --ambient-occlusion lights them softly");
    }
    if (shading_ != "none") exclude("exact", "shade"); // which has none
    for (char const* other : {"light-direction", "ambient", "specular", "shadows", "ambient-occlusion", "environment"})
        exclude("exact", other);
    exclude("exact", "no-skip");
    exclude("exact", "step");
    exclude("exact", "leave-out");
    if (algorithm_ == Algorithm::implicit_iso)
        for (char const* other : {"tolerance", "time"}) exclude("spp", other);
    exclude("tolerance", "leave-out");
    exclude("time", "leave-out");
    if (settings_.camera.projection == Projection::orthographic && list_->given("fov"))
        refuse("--fov does not apply to --projection orthographic", "--zoom does");
    if (settings_.camera.projection == Projection::perspective && list_->given("span"))
        refuse("--span does not apply to --projection perspective", "--zoom and --fov do");
}

namespace {

/// Calls the body; what it refuses is refused in the name of the option.
template <class Body> void in_name_of(std::string_view option, Body const& body) {
    std::string const name = text("--", option);
    try {
        body();
    } catch (Error const& error) {
        if (std::string_view(error.what()).find(name) != std::string_view::npos) throw;
        throw Error(error.kind(), text(name, ": ", error.what()), error.hint());
    }
}

} // namespace

void SettingsParameters::check() const {
    refuse_misfits();
    // One pixel of a small volume with one setting at a time: the renderer says itself what it cannot use, before
    // anything is read.
    Volume volume(Header{});
    AnyView const voxels = volume.mutable_view();
    std::fill_n(voxels.data, voxels.bytes(), std::byte{0});
    Renderer const renderer(volume, {});
    auto const try_out = [&](std::string_view option, auto const& choose) {
        if (!list_->given(option)) return;
        RenderSettings one;
        one.width = one.height = one.samples = 1;
        choose(one, settings_);
        in_name_of(option, [&] { (void)renderer.render(one); });
    };
    using S = RenderSettings;
    try_out("view", [](S& to, S const& from) { to.camera.view = from.camera.view; });
    try_out("azimuth", [](S& to, S const& from) { to.camera.azimuth = from.camera.azimuth; });
    try_out("elevation", [](S& to, S const& from) { to.camera.elevation = from.camera.elevation; });
    try_out("target", [](S& to, S const& from) { to.camera.target = from.camera.target; });
    try_out("up", [](S& to, S const& from) { to.camera.up = from.camera.up; });
    // Where the target is not given, that of this volume may happen to lie in the eye.
    try_out("eye", [](S& to, S const& from) {
        to.camera.eye = from.camera.eye;
        to.camera.target = from.camera.target ? *from.camera.target : *from.camera.eye + Vec3{1, 1, 1};
    });
    try_out("zoom", [](S& to, S const& from) { to.camera.zoom = from.camera.zoom; });
    try_out("fov", [](S& to, S const& from) { to.camera.fov = from.camera.fov; });
    try_out("span", [](S& to, S const& from) { to.camera.span = from.camera.span; });
    try_out("rgba-lookup-table", [](S& to, S const& from) { to.lut = from.lut; });
    try_out("colormap", [](S& to, S const& from) { to.colormap = from.colormap; });
    try_out("opacity", [](S& to, S const& from) { to.opacity = from.opacity; });
    try_out("domain", [](S& to, S const& from) { to.domain = from.domain; });
    try_out("unit-distance", [](S& to, S const& from) { to.unit = from.unit; });
    try_out("opacity-scale", [](S& to, S const& from) { to.opacity_scale = from.opacity_scale; });
    try_out("leave-out", [](S& to, S const& from) { to.shortcut = from.shortcut; });
    try_out("step", [](S& to, S const& from) { to.step = from.step; });
    try_out("iso", [](S& to, S const& from) { to.isos = from.isos; });
    try_out("iso-color", [](S& to, S const& from) { to.isos = from.isos, to.iso_colors = from.iso_colors; });
    try_out("iso-opacity", [](S& to, S const& from) { to.isos = from.isos, to.iso_opacities = from.iso_opacities; });
    try_out("albedo", [](S& to, S const& from) { to.albedo = from.albedo; });
    try_out("anisotropy", [](S& to, S const& from) { to.anisotropy = from.anisotropy; });
    try_out("light-direction", [](S& to, S const& from) { to.light_direction = from.light_direction; });
    try_out("ambient", [](S& to, S const& from) { to.ambient = from.ambient; });
    try_out("specular", [](S& to, S const& from) { to.specular = from.specular; });
    try_out("first-sample", [](S& to, S const& from) { to.first_sample = from.first_sample; });
    in_name_of("spp", [&] {
        RenderSettings one;
        one.samples = settings_.samples; // which are too many to try
        if (algorithm_ == Algorithm::implicit_iso && list_->given("spp")) one.edge_rays = settings_.samples;
        render::check(one);
    });
    (void)settings();
}

RenderSettings SettingsParameters::settings() const {
    refuse_misfits();
    RenderSettings s = settings_;
    s.algorithm = algorithm_;
    std::tie(s.width, s.height) = read_size(size_);
    s.skip = !no_skip_;
    s.seed = static_cast<std::uint64_t>(seed_);
    s.background = background();
    auto const read_goal = [](char const* name, std::optional<double> const& given, double& to) {
        if (given && !(*given > 0 && std::isfinite(*given))) refuse(text("--", name, " must be greater than 0"));
        to = given.value_or(0);
    };
    read_goal("noise", noise_, s.goal.noise);
    read_goal("tolerance", tolerance_, s.goal.tolerance);
    read_goal("time", seconds_, s.goal.seconds);
    if (s.algorithm == Algorithm::multi_scattering && s.goal.any() && !list_->given("spp")) s.samples = most_paths;
    if (s.algorithm == Algorithm::implicit_iso && list_->given("spp"))
        s.edge_rays = std::exchange(s.samples, RenderSettings().samples);
    if (denoise_)
        refuse("--denoise needs Open Image Denoise, without which this vkt was built: Debian 12 has no package of it",
               "--noise LEVELS traces paths until none is needed");
    if (s.goal.any() && !list_->given("step")) s.step = 1; // it is halved where that is needed
    s.shade = s.exact ? 0 : read_shading(shading_);
    for (char const* const name : {"light-direction", "ambient", "specular", "environment"}) {
        if (!list_->given(name) || !applies("shade", algorithm_)) continue;
        // Without any surface, light is held back all the same.
        if (s.shade == 0 && holds_back_light(s, algorithm_)) continue;
        if (s.shade == 0) refuse(text("--", name, " does not apply to --shade ", shading_));
        if (s.shade < 0) s.shade = 1; // whoever places a light wants to see it
    }
    std::vector<double> const light = read_color("light", light_, 3);
    s.light = {light[0], light[1], light[2]};
    if (!s.colormap.empty()) (void)colormap(s.colormap, 0);
    if (!s.lut.empty()) (void)transfer_from_lut(s.lut, 0, 1);
    if (!transfer_file_.empty()) {
        // Once: a pipe gives it to the first who asks.
        if (!transfer_) transfer_ = transfer_of_word(transfer_file_);
        s.transfer = transfer_;
    }
    if (list_->given("occlusion-radius") && s.ambient_occlusion == 0)
        refuse("--occlusion-radius needs --ambient-occlusion");
    for (char const* const name : {"environment-rotation", "environment-strength"})
        if (list_->given(name) && s.environment_file.empty()) refuse(text("--", name, " needs --environment"));
    if (!s.environment_file.empty()) {
        if (!environment_) environment_ = read_environment(s.environment_file);
        s.environment = environment_;
    }
    if (!list_->given("ambient")) s.ambient = ambient_unless_given(s);
    if (!list_->given("specular")) s.specular = specular_unless_given(s);
    if (s.algorithm == Algorithm::multi_scattering && list_->given("ambient") && !s.light_direction)
        refuse("--ambient needs --light-direction, without which all light comes from everywhere");
    if (!keyframes_file_.empty()) s.camera = cameras().front();
    render::check(s);
    return s;
}

std::vector<CameraRequest> const& SettingsParameters::keyframes() const {
    if (keyframes_.empty()) keyframes_ = keyframes_of_word(keyframes_file_);
    return keyframes_;
}

std::vector<CameraRequest> SettingsParameters::cameras() const {
    CameraRequest camera = settings_.camera;
    if (!keyframes_file_.empty()) {
        std::vector<CameraRequest> path =
            camera_path(keyframes(), frames_.value_or(static_cast<int>(keyframes().size())));
        for (CameraRequest& one : path) one.zoom = camera.zoom;
        return path;
    }
    if (!orbit_) return {camera};
    std::vector<CameraRequest> cameras;
    double const first = azimuth_of(camera);
    camera.steady = true;
    for (int i = 0; i < *orbit_; ++i) {
        camera.azimuth = first + 360.0 * i / *orbit_;
        cameras.push_back(camera);
    }
    return cameras;
}

Background SettingsParameters::background() const {
    std::vector<double> const c = read_color("background", background_, 4);
    return {{c[0], c[1], c[2]}, c.size() == 4 ? c[3] : 1.0};
}

bool SettingsParameters::depends_on_data() const {
    RenderSettings const s = settings();
    bool const surface = s.algorithm == Algorithm::implicit_iso && s.isos.empty();
    if (s.transfer || (s.preset && has_known_values(*s.preset))) return surface;
    bool const fixed = s.domain != "auto" && s.domain != "minmax" && s.domain.find('p') == std::string::npos;
    bool const opacities = s.lut.empty() && s.opacity == "auto" && !is_projection(s.algorithm);
    return surface || !fixed || opacities;
}

double ambient_unless_given(RenderSettings const& s) { return lit_by_environment(s) ? 1 : RenderSettings().ambient; }

double specular_unless_given(RenderSettings const& s) { return lit_by_environment(s) ? 0 : RenderSettings().specular; }

} // namespace vkt::render
