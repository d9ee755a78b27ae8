// Cameras: default views, fitting, mapping into the lattice.
// SPDX-License-Identifier: MIT
#include "libvkt/render/camera.h"

#include "libvkt/core/error.h"
#include "libvkt/core/products.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <span>

namespace vkt::render {

namespace {

constexpr double margin = 1.04; // of the picture around the volume

double radians(double degrees) { return degrees * std::numbers::pi / 180; }

struct Basis {
    Vec3 forward, right, up;
};
Basis basis_of(Vec3 way, Vec3 up) {
    if (!(dot(way, way) > 0))
        throw Error(ErrorKind::usage, "the camera's eye lies on its target", "move --eye or --target");
    Basis b{unit(way), {}, {}};
    Vec3 side = cross(b.forward, up);
    // Looking along the up direction: any other axis serves.
    if (!(dot(side, side) > 1e-12 * dot(up, up)))
        side = cross(b.forward, std::abs(b.forward.z) < 0.9 ? Vec3{0, 0, 1} : Vec3{0, 1, 0});
    b.right = unit(side);
    b.up = cross(b.right, b.forward);
    return b;
}

void check_finite(std::optional<Vec3> const& v, char const* what) {
    if (v && !(std::isfinite(v->x) && std::isfinite(v->y) && std::isfinite(v->z)))
        throw Error(ErrorKind::usage, text("the camera's ", what, " is not finite"));
}

/// Direction from the target to the eye, and what is upwards unless the user says so.
struct View {
    Vec3 side, up;
    double azimuth;
};
View view_of(CameraRequest const& request) {
    double azimuth = 32, elevation = 22;
    static constexpr std::array<std::pair<char const*, std::array<double, 2>>, 7> views{{
        {"oblique", {32, 22}},
        {"-y", {0, 0}},
        {"x", {90, 0}},
        {"y", {180, 0}},
        {"-x", {270, 0}},
        {"z", {0, 90}},
        {"-z", {0, -90}},
    }};
    bool known = false;
    std::vector<std::string> names;
    for (auto const& [name, angles] : views) {
        names.emplace_back(name);
        if (request.view != name) continue;
        azimuth = angles[0], elevation = angles[1];
        known = true;
    }
    if (!known) throw Error(ErrorKind::usage, text("view '", request.view, "' is not one of ", join(names, ", ")));
    elevation = request.elevation.value_or(elevation);
    bool const upright = std::abs(elevation) == 90;
    azimuth = request.azimuth.value_or(upright ? 0 : azimuth);
    if (!std::isfinite(azimuth)) throw Error(ErrorKind::usage, "the azimuth is not finite");
    if (!(std::abs(elevation) <= 90)) throw Error(ErrorKind::usage, "the elevation must be between -90 and 90 degrees");
    double const a = radians(azimuth), e = radians(elevation);
    // Sines of multiples of pi are not quite zero, but rays along an axis are to be exactly so.
    auto const clean = [](double v) { return std::abs(v) < 1e-15 ? 0.0 : v; };
    Vec3 const ahead{clean(-std::sin(a)), clean(std::cos(a)), 0}; // what a camera of that azimuth looks along
    // From above and below, the picture is turned as it is just before: that is where the z axis pointed.
    if (upright)
        return elevation > 0 ? View{{0, 0, 1}, ahead, azimuth} : View{{0, 0, -1}, Vec3{0, 0, 0} - ahead, azimuth};
    return {
        {clean(std::sin(a) * std::cos(e)), clean(-std::cos(a) * std::cos(e)), clean(std::sin(e))}, {0, 0, 1}, azimuth};
}

} // namespace

std::array<Vec3, 8> corners_of(Geometry const& geometry, Box const& box) {
    std::array<Vec3, 8> corners;
    for (std::size_t i = 0; i < 8; ++i) {
        auto const at = [&](int axis) {
            return static_cast<double>((i >> axis & 1U) != 0 ? box.upper[axis] : box.lower[axis]) - 0.5;
        };
        corners[i] = index_to_world(geometry, {at(0), at(1), at(2)});
    }
    return corners;
}

double azimuth_of(CameraRequest const& request) { return view_of(request).azimuth; }

namespace {

/// What points span across the directions of a camera.
struct Extent {
    double low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();
    void add(double v) { low = std::min(low, v), high = std::max(high, v); }
    double middle() const { return std::midpoint(low, high); }
    double half() const { return (high - low) / 2; }
};

/// The eye from which all points are just within a frustum, and as near as can be, in the camera's directions: every
/// side of the frustum touches a point where it can. `tangents` are of half its angles.
struct Placed {
    double right, up, forward;
};
Placed tightest(std::span<Vec3 const> points, Basis const& b, double across, double upward) {
    Extent right, left, above, below;
    for (Vec3 const& p : points) {
        double const x = dot(p, b.right), y = dot(p, b.up), z = dot(p, b.forward);
        right.add(x - across * z), left.add(-x - across * z);
        above.add(y - upward * z), below.add(-y - upward * z);
    }
    return {(right.high - left.high) / 2, (above.high - below.high) / 2,
            std::min(-(right.high + left.high) / (2 * across), -(above.high + below.high) / (2 * upward))};
}

} // namespace

Camera make_camera(CameraRequest const& request, std::span<Vec3 const> points, double aspect) {
    if (!(request.fov > 0 && request.fov < 180))
        throw Error(ErrorKind::usage, "the field of view must be between 0 and 180 degrees");
    if (!(request.zoom > 0) || !std::isfinite(request.zoom)) throw Error(ErrorKind::usage, "the zoom must be positive");
    if (request.span && (!(*request.span > 0) || !std::isfinite(*request.span)))
        throw Error(ErrorKind::usage, "the span must be positive");
    check_finite(request.eye, "eye");
    check_finite(request.target, "target");
    check_finite(request.up, "up direction");
    Extent x, y, z;
    for (Vec3 const& p : points) x.add(p.x), y.add(p.y), z.add(p.z);
    Vec3 const centre{x.middle(), y.middle(), z.middle()};

    Camera camera;
    camera.projection = request.projection;
    double const tangent =
        std::tan(radians(request.fov) / 2) / (request.projection == Projection::perspective ? request.zoom : 1);
    camera.fov = 2 * std::atan(tangent) * 180 / std::numbers::pi;
    camera.target = request.target.value_or(centre);
    View const view = view_of(request);
    camera.up = request.up.value_or(view.up);
    if (!(dot(camera.up, camera.up) > 0)) throw Error(ErrorKind::usage, "the camera's up direction has no length");

    // Far enough that every corner is in the picture: for each corner the least distance of the eye along the axis.
    Basis const b = basis_of(request.eye ? camera.target - *request.eye : view.side * -1.0, camera.up);
    double const base = std::tan(radians(request.fov) / 2);
    double distance = 0, half_height = 0, radius = 0;
    for (Vec3 const& point : points) {
        Vec3 const c = point - camera.target;
        double const side = std::abs(dot(c, b.right)) / aspect, height = std::abs(dot(c, b.up)),
                     depth = dot(c, b.forward);
        distance = std::max(distance, std::max(side, height) * margin / base - depth);
        half_height = std::max(half_height, std::max(side, height) * margin);
        radius = std::max(radius, std::sqrt(dot(c, c)));
    }
    if (request.steady) { // and any turn of it
        double const limit = std::sin(std::atan(base * std::min(1.0, aspect)));
        distance = radius * margin / limit;
        half_height = radius * margin / std::min(1.0, aspect);
    } else if (!request.eye && !request.target) {
        if (request.projection == Projection::perspective) {
            Placed const eye = tightest(points, b, base * aspect / margin, base / margin);
            double const depth = dot(centre, b.forward);
            camera.target = b.right * eye.right + b.up * eye.up + b.forward * depth;
            distance = depth - eye.forward;
            half_height = 0; // around the new target, as if that had been asked for
            for (Vec3 const& p : points)
                half_height = std::max({half_height, margin * std::abs(dot(p - camera.target, b.right)) / aspect,
                                        margin * std::abs(dot(p - camera.target, b.up))});
        } else {
            Extent across, upward;
            for (Vec3 const& p : points) across.add(dot(p, b.right)), upward.add(dot(p, b.up));
            camera.target = b.right * across.middle() + b.up * upward.middle() + b.forward * dot(centre, b.forward);
            half_height = margin * std::max(across.half() / aspect, upward.half());
        }
    }
    // A target far in front of the volume must not put the eye behind itself.
    distance = std::max(distance, 1e-3 * radius);
    camera.eye = request.eye.value_or(
        camera.target - b.forward * (request.projection == Projection::perspective ? distance : 2 * radius + distance));
    camera.height = request.span.value_or(2 * half_height) / request.zoom;
    return camera;
}

Matrix3 lattice_to_world(Geometry const& g) {
    auto const column = [&](std::size_t axis, double spacing) {
        Vec3 const d = g.direction[axis] * spacing;
        return Double3{d.x, d.y, d.z};
    };
    return {column(0, g.spacing.x), column(1, g.spacing.y), column(2, g.spacing.z)};
}

Matrix3 world_to_lattice(Geometry const& geometry) {
    Geometry origin = geometry;
    origin.origin = {0, 0, 0};
    auto const column = [&](Vec3 axis) {
        Vec3 const i = world_to_index(origin, axis);
        return Double3{i.x, i.y, i.z};
    };
    return {column({1, 0, 0}), column({0, 1, 0}), column({0, 0, 1})};
}

RayFrame frame_of(Camera const& camera, Geometry const& geometry, double first, int width, int height) {
    Basis const b = basis_of(camera.target - camera.eye, camera.up);
    Matrix3 const to_lattice = world_to_lattice(geometry);
    auto const mapped = [&](Vec3 v) { return to_lattice * Double3{v.x, v.y, v.z}; };
    Vec3 const eye = world_to_index(geometry, camera.eye);
    bool const perspective = camera.projection == Projection::perspective;
    double const half = perspective ? std::tan(radians(camera.fov) / 2) : camera.height / 2;
    double const aspect = static_cast<double>(width) / height;
    RayFrame frame{};
    frame.eye = {eye.x + first, eye.y + first, eye.z + first};
    frame.forward = mapped(b.forward);
    frame.right = mapped(b.right * (half * aspect));
    frame.up = mapped(b.up * half);
    frame.right_length = half * aspect, frame.up_length = half;
    frame.perspective = perspective;
    frame.width = width, frame.height = height;
    return frame;
}

std::string camera_text(Camera const& c) {
    std::string const head = text("eye ", c.eye, " target ", c.target, " up ", c.up);
    return c.projection == Projection::perspective ? text(head, " fov ", c.fov)
                                                   : text(head, " orthographic height ", c.height);
}

} // namespace vkt::render
