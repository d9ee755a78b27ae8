// Camera movements, lines and places in pictures, effort.
// SPDX-License-Identifier: MIT
#include "shell/viewer/interaction.h"

#include "libvkt/core/products.h"
#include "libvkt/core/text.h"
#include "libvkt/render/colormap.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numbers>
#include <string_view>
#include <utility>

namespace vkt::shell::viewer {

namespace {

using render::Algorithm;
using render::Camera;
using render::Projection;
using render::RenderSettings;

/// Rodrigues' formula; the axis has length 1.
Vec3 turned(Vec3 v, Vec3 axis, double angle) {
    double const c = std::cos(angle), s = std::sin(angle);
    return v * c + cross(axis, v) * s + axis * (dot(axis, v) * (1 - c));
}

} // namespace

Axes axes_of(Camera const& camera) {
    Vec3 const forward = unit(camera.target - camera.eye);
    Vec3 side = cross(forward, camera.up);
    // Looking along the up direction: the same choice that the renderer makes.
    if (!(dot(side, side) > 1e-12 * dot(camera.up, camera.up)))
        side = cross(forward, std::abs(forward.z) < 0.9 ? Vec3{0, 0, 1} : Vec3{0, 1, 0});
    Vec3 const right = unit(side);
    return {right, cross(right, forward), forward};
}

double span_of(Camera const& camera) {
    if (camera.projection == Projection::orthographic) return camera.height;
    return 2 * std::tan(camera.fov * std::numbers::pi / 360) * length(camera.target - camera.eye);
}

Camera orbit(Camera const& camera, Movement movement) {
    auto const [right, up, forward] = axes_of(camera);
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
    auto const [right, up, forward] = axes_of(camera);
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

Camera fly(Camera const& camera, double steps) {
    Vec3 const shift = axes_of(camera).forward * (0.05 * steps * span_of(camera));
    Camera result = camera;
    result.eye = camera.eye + shift;
    result.target = camera.target + shift;
    return result;
}

Camera axis_view(Camera const& camera, int axis, bool behind) {
    Camera result = camera;
    double const distance = length(camera.eye - camera.target);
    Vec3 side{0, 0, 0};
    side[axis] = behind ? -distance : distance;
    result.eye = camera.target + side;
    // Along z, the picture is turned as the named views of the command line are.
    result.up = axis == 2 ? Vec3{0, behind ? -1.0 : 1.0, 0} : Vec3{0, 0, 1};
    return result;
}

Camera projected(Camera const& camera, Projection projection) {
    if (camera.projection == projection) return camera;
    Camera result = camera;
    double const span = span_of(camera);
    result.projection = projection;
    if (projection == Projection::orthographic) {
        result.height = span;
    } else {
        double const distance = span / (2 * std::tan(camera.fov * std::numbers::pi / 360));
        result.eye = camera.target - axes_of(camera).forward * distance;
    }
    return result;
}

Camera aimed_at(Camera const& camera, Vec3 point) {
    if (!(length(point - camera.eye) > 0)) return camera;
    Camera result = camera;
    // Without perspective everything is seen along the same direction.
    if (camera.projection == Projection::orthographic) result.eye = camera.eye + (point - camera.target);
    result.target = point;
    return result;
}

Line line_under(Camera const& camera, double x, double y, double aspect) {
    auto const [right, up, forward] = axes_of(camera);
    double const u = 2 * x - 1, v = 1 - 2 * y;
    if (camera.projection == Projection::orthographic)
        return {camera.eye + right * (u * aspect * camera.height / 2) + up * (v * camera.height / 2), forward};
    double const half = std::tan(camera.fov * std::numbers::pi / 360);
    return {camera.eye, unit(forward + right * (u * aspect * half) + up * (v * half))};
}

std::optional<std::array<double, 2>> place_of(Camera const& camera, Vec3 point, double aspect) {
    auto const [right, up, forward] = axes_of(camera);
    Vec3 const to = point - camera.eye;
    double half = camera.height / 2;
    if (camera.projection == Projection::perspective) {
        double const depth = dot(to, forward);
        if (!(depth > 0)) return std::nullopt;
        half = std::tan(camera.fov * std::numbers::pi / 360) * depth;
    }
    return std::array<double, 2>{(dot(to, right) / (half * aspect) + 1) / 2, (1 - dot(to, up) / half) / 2};
}

std::vector<std::array<double, 2>> reprojected(Camera const& from, double from_aspect, Camera const& to,
                                               double to_aspect, int cells) {
    constexpr double least_cosine = 0.2; // beyond, a picture is more edge than picture
    Vec3 const normal = axes_of(from).forward;
    if (dot(normal, axes_of(to).forward) < least_cosine) return {};
    std::vector<std::array<double, 2>> places;
    for (int j = 0; j <= cells; ++j)
        for (int i = 0; i <= cells; ++i) {
            Line const line =
                line_under(from, i / static_cast<double>(cells), j / static_cast<double>(cells), from_aspect);
            double const way = dot(from.target - line.origin, normal) / dot(line.direction, normal);
            auto const place = place_of(to, line.origin + line.direction * way, to_aspect);
            if (!place) return {};
            places.push_back(*place);
        }
    return places;
}

std::optional<Vec3> point_met(Line const& line, render::Renderer const& volume,
                              render::TransferFunction const& transfer, double unit_distance,
                              std::vector<double> const& isos) {
    Geometry const& g = volume.header().geometry;
    Index3 const dims = volume.header().dims;
    // By itself: the world may be so large that a place and the one a unit further are the same.
    Geometry directions = g;
    directions.origin = {0, 0, 0};
    Vec3 const origin = world_to_index(g, line.origin), along = world_to_index(directions, line.direction);
    double near = 0, far = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
        double const low = -0.5, high = static_cast<double>(dims[axis]) - 0.5;
        if (along[axis] == 0) {
            if (origin[axis] < low || origin[axis] > high) return std::nullopt;
            continue;
        }
        double const a = (low - origin[axis]) / along[axis], b = (high - origin[axis]) / along[axis];
        near = std::max(near, std::min(a, b)), far = std::min(far, std::max(a, b));
    }
    if (!(near < far)) return std::nullopt;
    TransferEdit const edit = edit_of(transfer, "");
    constexpr int steps = 1024;
    double depth = 0, before = std::numeric_limits<double>::quiet_NaN();
    for (int i = 0; i < steps; ++i) {
        double const t = std::lerp(near, far, (i + 0.5) / steps);
        double const value = volume.value_at(origin + along * t);
        if (!isos.empty()) {
            for (double const iso : isos)
                if ((before < iso) != (value < iso) && !std::isnan(before) && !std::isnan(value))
                    return line.origin + line.direction * t;
            before = value;
            continue;
        }
        if (std::isnan(value)) continue;
        depth += render::extinction_of(alpha_at(edit, value)) * (far - near) / steps / unit_distance;
        if (depth >= std::numbers::ln2) return line.origin + line.direction * t;
    }
    return std::nullopt;
}

std::optional<Box> part_in_box(Camera const& camera, std::array<double, 4> const& box, double aspect,
                               render::Renderer const& volume, render::RenderReport const& report) {
    double const x0 = std::min(box[0], box[2]), x1 = std::max(box[0], box[2]);
    double const y0 = std::min(box[1], box[3]), y1 = std::max(box[1], box[3]);
    if (!(x1 - x0 > 1e-3 && y1 - y0 > 1e-3) || report.transfer.points.empty()) return std::nullopt;
    // What is seen in the box, on a grid of lines: its middle depth is what the box is about.
    std::vector<double> depths;
    Vec3 const forward = axes_of(camera).forward;
    constexpr int lines = 9;
    for (int j = 0; j < lines; ++j)
        for (int i = 0; i < lines; ++i) {
            Line const line =
                line_under(camera, std::lerp(x0, x1, (i + 0.5) / lines), std::lerp(y0, y1, (j + 0.5) / lines), aspect);
            if (auto const p = point_met(line, volume, report.transfer, report.unit, report.isos))
                depths.push_back(dot(*p - camera.eye, forward));
        }
    if (depths.empty()) return std::nullopt;
    std::nth_element(depths.begin(), depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2), depths.end());
    double const depth = depths[depths.size() / 2];
    Geometry const& g = volume.header().geometry;
    Index3 const dims = volume.header().dims;
    std::array<double, 3> least{1e300, 1e300, 1e300}, greatest{-1e300, -1e300, -1e300};
    std::array<Vec3, 4> corners;
    for (std::size_t c = 0; c < 4; ++c) {
        Line const line = line_under(camera, c % 2 == 0 ? x0 : x1, c < 2 ? y0 : y1, aspect);
        double const to_origin = dot(line.origin - camera.eye, forward);
        corners[c] = line.origin + line.direction * ((depth - to_origin) / dot(line.direction, forward));
    }
    double const half = std::max(length(corners[1] - corners[0]), length(corners[2] - corners[0])) / 2;
    for (Vec3 const& corner : corners)
        for (double const along : {-half, half}) {
            Vec3 const index = world_to_index(g, corner + forward * along);
            for (int axis = 0; axis < 3; ++axis) {
                auto const a = static_cast<std::size_t>(axis);
                least[a] = std::min(least[a], index[axis]), greatest[a] = std::max(greatest[a], index[axis]);
            }
        }
    Box part;
    for (int axis = 0; axis < 3; ++axis) {
        auto const a = static_cast<std::size_t>(axis);
        auto const extent = static_cast<double>(dims[axis]);
        part.lower[axis] = static_cast<std::int64_t>(std::clamp(std::floor(least[a] + 0.5), 0.0, extent));
        part.upper[axis] = static_cast<std::int64_t>(std::clamp(std::ceil(greatest[a] + 0.5), 0.0, extent));
    }
    if (part.empty()) return std::nullopt;
    return part;
}

double least_effort(RenderSettings const& full) {
    constexpr double pixels = 1.0 / 64;
    if (full.algorithm == Algorithm::implicit_iso) return pixels;
    if (full.algorithm == Algorithm::multi_scattering) return pixels / full.samples;
    return full.exact ? pixels / 8 : pixels / 2;
}

double most_effort(RenderSettings const& full) { return full.algorithm == Algorithm::ray_marching ? 0.99 : 1; }

namespace {

/// Rays, or paths, of the full picture.
double work_of(RenderSettings const& full) {
    double const pixels = static_cast<double>(full.width) * full.height;
    return full.algorithm == Algorithm::multi_scattering ? pixels * full.samples : pixels;
}

} // namespace

double first_effort(RenderSettings const& full) {
    return std::clamp(128 * 128 / work_of(full), least_effort(full), 1.0);
}

double carried_effort(double effort, RenderSettings const& before, RenderSettings const& now) {
    if (before.algorithm != now.algorithm) return first_effort(now);
    return effort * (work_of(before) / work_of(now));
}

RenderSettings reduced(RenderSettings const& full, double effort) {
    if (effort >= 1) return full;
    RenderSettings s = full;
    s.edge_rays = 1; // larger pixels have larger steps anyway
    double pixels = effort;
    if (full.algorithm == Algorithm::ray_marching) {
        if (full.exact) {
            // The reference does about four times the work of marching, and marching shows the same to the eye.
            s.exact = false;
            pixels *= 4;
        }
        s.shortcut = std::max(full.shortcut, 0.5); // nobody sees half a level
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

double next_effort(double effort, double seconds, double target, double least, double most) {
    double const room = target / std::max(seconds, 1e-6);
    if (room > 0.7 && room < 1.6) return effort;
    // Not all of a frame's time follows the effort, so that one measurement is trusted only so far.
    return std::clamp(effort * std::clamp(room, 0.125, 4.0), least, most);
}

double refined_effort(double effort, double seconds) {
    constexpr double quick = 0.3;
    double const next = 4 * effort;
    return seconds / effort <= quick || next > 0.5 ? 1 : next;
}

int next_paths(int done, int wanted, int last, double seconds) {
    constexpr double pass = 0.25;
    int const left = wanted - done;
    if (last <= 0) return std::min(1, left);
    double const affordable = pass * last / std::max(seconds, 1e-6);
    // One measurement is trusted only so far.
    return std::clamp(static_cast<int>(std::min(affordable, 4.0 * last)), 1, std::max(left, 1));
}

namespace {

/// To nine digits of what `size` has before the point: a grid, so that what is rounded once stays.
double on_grid(double v, double size) {
    if (!(size > 0) || !std::isfinite(size)) return v;
    // Sizes are round numbers rather than three times a power of ten, where a last digit would change the grid.
    double const digits = 9 - std::floor(std::log10(size / 3)), power = std::pow(10.0, std::abs(digits));
    return (digits < 0 ? std::round(v / power) * power : std::round(v * power) / power) + 0.0;
}

Vec3 on_grid(Vec3 const& v, double size) { return {on_grid(v.x, size), on_grid(v.y, size), on_grid(v.z, size)}; }

} // namespace

Camera shortened(Camera const& camera) {
    Vec3 const sight = camera.target - camera.eye;
    double const distance = std::hypot(sight.x, sight.y, sight.z);
    Camera c = camera;
    c.eye = on_grid(c.eye, distance), c.target = on_grid(c.target, distance), c.up = on_grid(c.up, 1);
    c.fov = on_grid(c.fov, 10), c.height = on_grid(c.height, c.height);
    return c;
}

Index3 voxel_at(std::array<double, 3> const& shares, Index3 dims) {
    Index3 voxel;
    for (int axis = 0; axis < 3; ++axis) {
        double const place = std::floor(shares[static_cast<std::size_t>(axis)] * static_cast<double>(dims[axis]));
        voxel[axis] = std::clamp<std::int64_t>(static_cast<std::int64_t>(place), 0, dims[axis] - 1);
    }
    return voxel;
}

namespace {

/// Named after the input, with a number before the tail where the name is in use.
std::string free_name(std::string const& input_name, std::string const& tail) {
    std::filesystem::path const path(input_name);
    std::string stem = path.stem().string();
    if (path.extension() == ".gz") stem = std::filesystem::path(stem).stem().string(); // head.nii.gz
    if (stem.empty() || stem == "-") stem = "volume";
    std::string name = stem + tail;
    // A dangling link is a name in use as well.
    for (int n = 2; std::filesystem::symlink_status(name).type() != std::filesystem::file_type::not_found; ++n)
        name = text(stem, "-", n, tail);
    return name;
}

} // namespace

std::string free_picture_name(std::string const& input_name) { return free_name(input_name, ".png"); }

std::string output_word(std::string const& input_name, bool several) {
    constexpr std::string_view first = "0000.png", any = "%04d.png";
    std::string const name = free_name(input_name, several ? text("-", first) : ".png");
    std::string word; // in which a per cent sign stands for a number's place
    for (char const c : name) word += c == '%' ? std::string("%%") : std::string(1, c);
    if (several) word.replace(word.size() - first.size(), first.size(), any);
    return shell_quoted(word);
}

void DoubleClick::press(double x, double y, double now) {
    constexpr double soon = 0.3;
    bool const near = std::hypot(x - x_, y - y_) <= slack_;
    if (before_ && (!near || now - *before_ >= soon)) before_.reset();
    x_ = x, y_ = y, pressed_ = now;
    still_ = true;
}

void DoubleClick::move(double x, double y) {
    if (std::hypot(x - x_, y - y_) > slack_) still_ = false;
}

bool DoubleClick::release() {
    bool const click = std::exchange(still_, false), second = click && before_;
    before_ = click && !second ? std::optional(pressed_) : std::nullopt;
    return second;
}

} // namespace vkt::shell::viewer
