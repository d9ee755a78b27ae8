// Camera movements, views as settings and as words, effort.
// SPDX-License-Identifier: MIT
#include "shell/viewer/interaction.h"

#include "libvkt/core/text.h"
#include "libvkt/render/colormap.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>

namespace vkt::shell::viewer {

namespace {

using render::Algorithm;
using render::Camera;
using render::Projection;
using render::RenderSettings;

double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec3 cross(Vec3 a, Vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
double length(Vec3 a) { return std::sqrt(dot(a, a)); }
Vec3 unit(Vec3 a) { return a * (1 / length(a)); }

/// Rodrigues' formula; the axis has length 1.
Vec3 turned(Vec3 v, Vec3 axis, double angle) {
    double const c = std::cos(angle), s = std::sin(angle);
    return v * c + cross(axis, v) * s + axis * (dot(axis, v) * (1 - c));
}

struct Axes {
    Vec3 right, up;
};
Axes axes_of(Camera const& camera) {
    Vec3 const forward = unit(camera.target - camera.eye);
    Vec3 side = cross(forward, camera.up);
    // Looking along the up direction: the same choice that the renderer makes.
    if (!(dot(side, side) > 1e-12 * dot(camera.up, camera.up)))
        side = cross(forward, std::abs(forward.z) < 0.9 ? Vec3{0, 0, 1} : Vec3{0, 1, 0});
    Vec3 const right = unit(side);
    return {right, cross(right, forward)};
}

/// What the picture spans vertically at the target, in the world.
double span_of(Camera const& camera) {
    if (camera.projection == Projection::orthographic) return camera.height;
    return 2 * std::tan(camera.fov * std::numbers::pi / 360) * length(camera.target - camera.eye);
}

} // namespace

Camera orbit(Camera const& camera, Movement movement) {
    auto const [right, up] = axes_of(camera);
    // To the right by hand is to the left for the eye; the camera's up direction goes along.
    auto const turn = [&, right = right, up = up](Vec3 v) {
        return turned(turned(v, up, -movement.x * std::numbers::pi), right, -movement.y * std::numbers::pi);
    };
    Camera result = camera;
    result.eye = camera.target + turn(camera.eye - camera.target);
    result.up = turn(up);
    return result;
}

Camera pan(Camera const& camera, Movement movement) {
    auto const [right, up] = axes_of(camera);
    double const span = span_of(camera);
    Vec3 const shift = right * (-movement.x * span) + up * (movement.y * span);
    Camera result = camera;
    result.eye = camera.eye + shift;
    result.target = camera.target + shift;
    return result;
}

Camera zoom(Camera const& camera, double notches, Camera const& home) {
    double const now = span_of(camera), all = span_of(home);
    double const factor = std::clamp(now * std::pow(0.9, notches), 1e-3 * all, 1e3 * all) / now;
    Camera result = camera;
    if (camera.projection == Projection::orthographic)
        result.height = camera.height * factor;
    else
        result.eye = camera.target + (camera.eye - camera.target) * factor;
    return result;
}

View initial_view(RenderSettings const& asked) { return {asked.width, asked.height, asked.colormap, {}}; }

RenderSettings settings_of(RenderSettings const& asked, View const& view) {
    RenderSettings s = asked;
    s.width = view.width, s.height = view.height;
    s.colormap = view.colormap;
    if (!view.camera) return s;
    render::CameraRequest request;
    request.eye = view.camera->eye, request.target = view.camera->target, request.up = view.camera->up;
    request.projection = view.camera->projection;
    if (request.projection == Projection::perspective)
        request.fov = view.camera->fov;
    else
        request.span = view.camera->height;
    s.camera = request;
    return s;
}

std::vector<std::string> words_of(std::vector<std::string> const& asked_words, RenderSettings const& asked,
                                  View const& view) {
    std::vector<std::string> without, with;
    if (view.width != asked.width || view.height != asked.height) {
        without.emplace_back("--size");
        with.insert(with.end(), {"--size", text(view.width, "x", view.height)});
    }
    if (view.colormap != asked.colormap) {
        without.emplace_back("--colormap");
        if (!view.colormap.empty()) with.insert(with.end(), {"--colormap", view.colormap});
    }
    if (view.camera) {
        auto const triple = [](Vec3 v) { return text(v.x, ",", v.y, ",", v.z); };
        Camera const& c = *view.camera;
        for (char const* name : {"--view", "--azimuth", "--elevation", "--eye", "--target", "--up", "--zoom", "--fov",
                                 "--span", "--projection", "--fit"})
            without.emplace_back(name);
        with.insert(with.end(), {"--eye", triple(c.eye), "--target", triple(c.target), "--up", triple(c.up)});
        if (c.projection == Projection::perspective)
            with.insert(with.end(), {"--fov", to_text(c.fov)});
        else
            with.insert(with.end(), {"--projection", "orthographic", "--span", to_text(c.height)});
    }
    if (asked_words.empty()) return {}; // no history is wanted
    // All of the options left out have one value.
    std::vector<std::string> words{asked_words.front()};
    words.insert(words.end(), with.begin(), with.end());
    for (std::size_t i = 1; i < asked_words.size(); ++i) {
        if (std::find(without.begin(), without.end(), asked_words[i]) != without.end())
            ++i;
        else
            words.push_back(asked_words[i]);
    }
    return words;
}

bool has_colormap(RenderSettings const& asked) { return !asked.transfer && asked.lut.empty(); }

std::string next_colormap(std::string const& current, std::string const& asked) {
    std::vector<std::string> names{asked};
    for (std::string const& name : render::colormap_names())
        if (name != asked) names.push_back(name);
    auto const found = std::find(names.begin(), names.end(), current);
    return found == names.end() || found + 1 == names.end() ? names.front() : *(found + 1);
}

double least_effort(RenderSettings const& full) {
    constexpr double pixels = 1.0 / 64;
    if (full.algorithm == Algorithm::implicit_iso) return pixels;
    if (full.algorithm == Algorithm::multi_scattering) return pixels / full.samples;
    return full.exact ? pixels / 8 : pixels / 2;
}

double first_effort(RenderSettings const& full) {
    double work = static_cast<double>(full.width) * full.height;
    if (full.algorithm == Algorithm::multi_scattering) work *= full.samples;
    return std::clamp(128 * 128 / work, least_effort(full), 1.0);
}

RenderSettings reduced(RenderSettings const& full, double effort) {
    if (effort >= 1) return full;
    RenderSettings s = full;
    double pixels = effort;
    if (full.algorithm == Algorithm::ray_marching) {
        if (full.exact) {
            // The reference does about four times the work of marching, and marching shows the same to the eye.
            s.exact = false;
            pixels *= 4;
        }
        s.step = std::min(4.0, full.step * std::clamp(1 / pixels, 1.0, 2.0));
        pixels *= s.step / full.step;
    } else if (full.algorithm == Algorithm::multi_scattering) {
        s.samples = std::max(1, static_cast<int>(std::ceil(full.samples * effort)));
        pixels *= static_cast<double>(full.samples) / s.samples;
    }
    double const scale = std::sqrt(std::min(1.0, pixels));
    s.width = std::max(1, static_cast<int>(std::lround(full.width * scale)));
    s.height = std::max(1, static_cast<int>(std::lround(full.height * scale)));
    return s;
}

double next_effort(double effort, double seconds, double target, double least) {
    double const room = target / std::max(seconds, 1e-6);
    if (room > 0.7 && room < 1.6) return effort;
    // Not all of a frame's time follows the effort, so that one measurement is trusted only so far.
    return std::clamp(effort * std::clamp(room, 0.125, 4.0), least, 1.0);
}

double refined_effort(double effort, double seconds) {
    constexpr double quick = 0.3;
    double const next = 4 * effort;
    return seconds / effort <= quick || next > 0.5 ? 1 : next;
}

std::string free_picture_name(std::string const& input_name) {
    std::string stem = std::filesystem::path(input_name).stem().string();
    if (stem.empty() || stem == "-") stem = "volume";
    std::string name = stem + ".png";
    // A dangling link is a name in use as well.
    for (int n = 2; std::filesystem::symlink_status(name).type() != std::filesystem::file_type::not_found; ++n)
        name = text(stem, "-", n, ".png");
    return name;
}

} // namespace vkt::shell::viewer
