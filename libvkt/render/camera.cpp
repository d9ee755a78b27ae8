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
/// Whether a direction points upwards in a picture: not if the camera looks along it.
bool is_upwards(Vec3 up, Vec3 forward) {
    Vec3 const side = cross(forward, up);
    return dot(side, side) > 1e-12 * dot(up, up);
}

Basis basis_of(Vec3 way, Vec3 up) {
    if (!(dot(way, way) > 0))
        throw Error(ErrorKind::usage, "the camera's eye lies on its target", "move --eye or --target");
    Basis b{unit(way), {}, {}};
    // Looking along the up direction: any other axis serves.
    if (!is_upwards(up, b.forward)) up = std::abs(b.forward.z) < 0.9 ? Vec3{0, 0, 1} : Vec3{0, 1, 0};
    b.right = unit(cross(b.forward, up));
    b.up = cross(b.right, b.forward);
    return b;
}

void check_finite(std::optional<Vec3> const& v, char const* what) {
    if (v && !(std::isfinite(v->x) && std::isfinite(v->y) && std::isfinite(v->z)))
        throw Error(ErrorKind::usage, text("the camera's ", what, " is not finite"));
}

/// Direction from the target to the eye, and what is upwards unless the user says so.
struct ViewSide {
    Vec3 side, up;
    double azimuth;
};
ViewSide view_of(CameraRequest const& request) {
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
        return elevation > 0 ? ViewSide{{0, 0, 1}, ahead, azimuth}
                             : ViewSide{{0, 0, -1}, Vec3{0, 0, 0} - ahead, azimuth};
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

/// What is shown spans this along a direction of a camera.
struct Extent {
    double low, high;
    double middle() const { return std::midpoint(low, high); }
};

/// The part of a picture that is left, from -1 to 1 across the whole picture, once it is shown `zoom` times as large.
struct Frame {
    double x, y, half_width, half_height; ///< the middle
    Frame(Insets const& insets, double zoom)
        : x(-insets.right / zoom), y(insets.bottom / zoom), half_width(1 - insets.right),
          half_height(1 - insets.bottom) {}
};

/// The eye from which all that is shown is just within a frustum, and as near as can be, in the camera's directions:
/// every side of the frustum touches some of it where it can. `across` and `upward` are tangents of half the angles of
/// the whole picture.
struct Placed {
    double right, up, forward;
};
Placed tightest(Shown const& shown, Basis const& b, double across, double upward, Frame const& frame) {
    auto const furthest = [&](Vec3 way, double tangent) { return shown.reach(way - b.forward * tangent); };
    double const right = furthest(b.right, across * (frame.half_width + frame.x)),
                 left = furthest(b.right * -1.0, across * (frame.half_width - frame.x)),
                 above = furthest(b.up, upward * (frame.half_height + frame.y)),
                 below = furthest(b.up * -1.0, upward * (frame.half_height - frame.y));
    double const forward = std::min(-(right + left) / (2 * across * frame.half_width),
                                    -(above + below) / (2 * upward * frame.half_height));
    return {(right - left) / 2 + frame.x * across * forward, (above - below) / 2 + frame.y * upward * forward, forward};
}

Extent extent_of(Shown const& shown, Vec3 direction) {
    return {-shown.reach(direction * -1.0), shown.reach(direction)};
}

} // namespace

double ShownPoints::reach(Vec3 direction) const {
    double furthest = -std::numeric_limits<double>::infinity();
    for (Vec3 const& p : points_) furthest = std::max(furthest, dot(p, direction));
    return furthest;
}

double ShownPoints::radius(Vec3 from) const {
    double radius = 0;
    for (Vec3 const& p : points_) radius = std::max(radius, length(p - from));
    return radius;
}

bool follows_content(CameraRequest const& request) {
    bool const sized = request.projection == Projection::perspective || request.span;
    return !(request.eye && request.target && sized);
}

Camera make_camera(CameraRequest const& request, Shown const& shown, double aspect) {
    if (!(request.fov > 0 && request.fov < 180))
        throw Error(ErrorKind::usage, "the field of view must be between 0 and 180 degrees");
    if (!(request.zoom > 0) || !std::isfinite(request.zoom)) throw Error(ErrorKind::usage, "the zoom must be positive");
    if (request.span && (!(*request.span > 0) || !std::isfinite(*request.span)))
        throw Error(ErrorKind::usage, "the span must be positive");
    check_finite(request.eye, "eye");
    check_finite(request.target, "target");
    check_finite(request.up, "up direction");
    auto const middle = [&](Vec3 direction) { return extent_of(shown, direction).middle(); };
    Vec3 const centre =
        request.target ? *request.target : Vec3{middle({1, 0, 0}), middle({0, 1, 0}), middle({0, 0, 1})};

    Camera camera;
    camera.projection = request.projection;
    double const tangent =
        std::tan(radians(request.fov) / 2) / (request.projection == Projection::perspective ? request.zoom : 1);
    camera.fov = 2 * std::atan(tangent) * 180 / std::numbers::pi;
    camera.target = centre;
    ViewSide const view = view_of(request);
    camera.up = request.up.value_or(view.up);
    if (!(dot(camera.up, camera.up) > 0)) throw Error(ErrorKind::usage, "the camera's up direction has no length");

    Basis const b = basis_of(request.eye ? camera.target - *request.eye : view.side * -1.0, camera.up);
    if (request.up && !is_upwards(*request.up, b.forward))
        throw Error(ErrorKind::usage, "the camera looks along its up direction", "choose another --up, or none");
    double const base = std::tan(radians(request.fov) / 2);
    bool const free = !request.eye && !request.target;
    Frame const frame(free ? request.insets : Insets{}, request.zoom);
    Vec3 const across = b.right * (1 / (aspect * frame.half_width)), upward = b.up * (1 / frame.half_height);
    bool const centred = !request.steady && free, perspective = request.projection == Projection::perspective;
    double const radius = shown.radius(camera.target);
    double distance = 0, half_height = 0;
    if (!request.eye && !request.steady && !(centred && perspective)) // far enough that all is in the picture
        for (Vec3 const& way : {across, across * -1.0, upward, upward * -1.0}) {
            Vec3 const side = way * (margin / base) - b.forward;
            distance = std::max(distance, shown.reach(side) - dot(camera.target, side));
        }
    if (request.steady) { // and any turn of it
        double const room = std::min(frame.half_height, aspect * frame.half_width);
        distance = radius * margin / std::sin(std::atan(base * room));
        half_height = radius * margin / room;
    } else {
        if (centred) {
            double const depth = dot(centre, b.forward);
            if (perspective) {
                Placed const eye = tightest(shown, b, base * aspect / margin, base / margin, frame);
                camera.target = b.right * eye.right + b.up * eye.up + b.forward * depth;
                distance = depth - eye.forward;
            } else {
                camera.target = b.right * middle(b.right) + b.up * middle(b.up) + b.forward * depth;
            }
        }
        if (!perspective && !request.span) // around the target
            for (Vec3 const& way : {across, across * -1.0, upward, upward * -1.0})
                half_height = std::max(half_height, margin * (shown.reach(way) - dot(camera.target, way)));
    }
    // A target far in front of the volume must not put the eye behind itself.
    distance = std::max(distance, 1e-3 * radius);
    double const span = request.span.value_or(2 * half_height) / request.zoom; // orthographic
    if (free && !(centred && perspective)) { // what is in the middle of the picture is to be in that of the frame
        double const half = perspective ? tangent * distance : span / 2;
        camera.target = camera.target - (b.right * (frame.x * aspect) + b.up * frame.y) * (half * request.zoom);
    }
    camera.eye = request.eye.value_or(camera.target - b.forward * (perspective ? distance : 2 * radius + distance));
    camera.height = perspective ? 2 * tangent * length(camera.target - camera.eye) : span;
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
