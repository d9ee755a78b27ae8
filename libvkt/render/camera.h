// Cameras: perspective and orthographic, placed in world units, by a named view or by angles.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/geometry.h"
#include "libvkt/render/inner/ray.h"

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace vkt::render {

enum class Projection : std::uint8_t { perspective, orthographic };

/// Seen from eye towards target; up need not be perpendicular. height is what the image spans vertically in the world,
/// in perspective at the target's distance, where it follows from the others.
struct Camera {
    Vec3 eye{0, 0, 1}, target{0, 0, 0}, up{0, 1, 0};
    Projection projection = Projection::perspective;
    double fov = 30;   ///< vertical, in degrees, in (0, 180); perspective only
    double height = 1; ///< world units; decides in orthographic projection only
};

/// What the default camera shows: all that the transfer function lets see, or the whole box of the volume.
enum class Fit : std::uint8_t { content, volume };

/// Shares of a picture, in [0, 1), that what is shown is to leave free at its edges.
struct Insets {
    double right = 0, bottom = 0;
};

/// What the user asks for; the rest follows from the volume.
struct CameraRequest {
    std::string view = "oblique";        ///< x, -x, y, -y, z, -z (the side on which the camera stands) or oblique
    std::optional<double> azimuth;       ///< degrees around z, 0 on the -y side, towards +x
    std::optional<double> elevation;     ///< degrees above the xy plane, in [-90, 90]
    std::optional<Vec3> eye, target, up; ///< world units; an eye overrules view and angles
    Projection projection = Projection::perspective;
    double fov = 30;
    double zoom = 1;            ///< 2 shows things twice as large
    std::optional<double> span; ///< orthographic: world length from bottom to top of the picture; overrules the fit
    Fit fit = Fit::content;
    bool steady = false; ///< the same distance from all sides: what is shown is a ball around its corners
    Insets insets;       ///< of a camera whose eye and target are not given
};

/// World positions of the corners of a box of voxels: outer faces of the outer voxels.
std::array<Vec3, 8> corners_of(Geometry const& geometry, Box const& box);

/// Degrees around z of the view that is asked for.
double azimuth_of(CameraRequest const& request);

/// What a camera is to show, in the world.
class Shown {
public:
    virtual ~Shown() = default;
    /// The greatest dot product of a direction, of any length, with a place in it.
    virtual double reach(Vec3 direction) const = 0;
    /// Of a ball around a place that holds it all.
    virtual double radius(Vec3 from) const = 0;
};

class ShownPoints : public Shown {
public:
    explicit ShownPoints(std::span<Vec3 const> points) : points_(points.begin(), points.end()) {}
    double reach(Vec3 direction) const override;
    double radius(Vec3 from) const override;

private:
    std::vector<Vec3> points_;
};

/// Shows all of it with a small margin unless eye or zoom say otherwise. Throws Error{usage} for unknown
/// views, an eye on the target, or values out of range.
Camera make_camera(CameraRequest const& request, Shown const& shown, double aspect);
inline Camera make_camera(CameraRequest const& request, std::span<Vec3 const> points, double aspect) {
    return make_camera(request, ShownPoints(points), aspect);
}
/// Whether a camera depends on what is to be shown.
bool follows_content(CameraRequest const& request);

/// The camera in the lattice of a volume, in which the centre of the first cell is at (first, first, first).
RayFrame frame_of(Camera const& camera, Geometry const& geometry, double first, int width, int height);

/// Linear maps between world and lattice vectors: columns of direction * spacing, and the inverse.
Matrix3 lattice_to_world(Geometry const& geometry);
Matrix3 world_to_lattice(Geometry const& geometry);

/// "eye x y z target x y z up x y z …", enough to see the same again.
std::string camera_text(Camera const& camera);

} // namespace vkt::render
