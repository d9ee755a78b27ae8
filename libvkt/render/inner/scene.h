// What the inner loops see of a scene: plain structures of numbers and pointers, alike on CPU and GPU.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/environment.h"
#include "libvkt/render/inner/optics.h"
#include "libvkt/render/inner/ray.h"

#include <cstdint>

namespace vkt::render {

/// Macrocells with the range of the stored values in them (their far faces included) and what follows from it.
struct CellGridView {
    float const* lowest;          ///< +inf where there is no data
    float const* majorant;        ///< bound of the extinction per world length; 0 where nothing can be seen
    std::uint8_t const* distance; ///< cells to the nearest one in which something can be seen (itself: 0; at most 255)
    std::uint8_t const* depth;    ///< cells to the nearest one in which nothing can be seen, the same way; of marching
    int nx, ny, nz;

    VKT_HD std::int64_t index(int const* cell) const {
        return (static_cast<std::int64_t>(cell[2]) * ny + cell[1]) * nx + cell[0];
    }
};

/// A knot of the transfer function in stored values: extinction per world length and linear colour, linear between
/// knots; two knots at one value make a step.
struct Knot {
    double value, extinction, red, green, blue;
};

/// Headlight shading: strength 0 turns it off. A gradient of 1 / per_gradient per smallest spacing is shaded half.
struct ShadeView {
    float strength, ambient, specular, per_gradient;
    float spacing;   ///< the smallest one
    float metric[6]; ///< xx, yy, zz, 2xy, 2xz, 2yz: squared length of a lattice gradient, per smallest spacing
};

/// Squared length of a lattice gradient, per smallest spacing.
template <class F> VKT_HD F squared_length(ShadeView const& shade, F x, F y, F z) {
    float const* const m = shade.metric;
    return m[0] * x * x + m[1] * y * y + m[2] * z * z + m[3] * x * y + m[4] * x * z + m[5] * y * z;
}
VKT_HD float squared_length(ShadeView const& shade, Float3 g) { return squared_length(shade, g.x, g.y, g.z); }

/// Diffuse light of an environment, by colour: that on a surface is a polynomial of second order in its normal, as its
/// irradiance is but for small parts (Ramamoorthi and Hanrahan, An Efficient Representation for Irradiance Environment
/// Maps, 2001). All is per that of an environment which is 1 everywhere.
struct IrradianceView {
    bool on = false;
    float mean[3];         ///< of all directions: what arrives where there is no surface
    float constant[3];     ///< part that does not depend on the normal
    Float3 linear[3];      ///< by the gradient over its length
    float quadratic[3][6]; ///< xx, yy, zz, 2xy, 2xz, 2yz: by squares of the same
};

/// A direction of the lattice from which light comes.
struct LightWay {
    Float3 direction; ///< towards it, of unit length
    float world;      ///< world length of one lattice unit along it
    float reach;      ///< lattice units within which things hold light back
};
inline constexpr int most_ways = 64;

/// A light that is far away, instead of the one at the eye.
struct LampView {
    bool on = false, shadows = false;
    Double3 world{};   ///< towards it, of unit length
    Double3 lattice{}; ///< the same in the lattice
    float light[3];    ///< of paths: what arrives per area across it
};

struct IsoView {
    float value;
    float red, green, blue; ///< linear
    float alpha = 1;        ///< share of the light from behind that is held back, in [0,1]
};
inline constexpr int most_isos = 16;

/// Where the rays of a pixel leave their light besides the picture: four numbers per pixel each; null: nowhere.
struct SumsView {
    double* light;   ///< of these rays and of those before them, which it holds already
    double* odd;     ///< the same of rays of odd number
    double* squares; ///< the same: squares of what is displayed, over `behind`, and of what comes from there
    float behind[3];
};

/// Which value along a ray a projection shows.
enum class Projected : std::uint8_t { greatest, least, mean };

struct SceneView {
    RayFrame frame;
    ShownPart shown;    ///< of the volume, in the padded lattice
    Matrix3 to_lattice; ///< world vectors to lattice vectors
    CellGridView cells;
    TableView table;
    Knot const* knots;
    int knot_count;
    Knot const* bends; ///< of these the ones where the extinction bends, which is all that depths depend on
    int bend_count;
    ShadeView shade;
    LampView lamp;
    IrradianceView around; ///< instead of light from everywhere that is the same
    /// The lamp's, if it throws shadows, and then those over which the light from everywhere is measured.
    LightWay ways[1 + most_ways];
    int around_count; ///< of the latter; 0: that light is everywhere the same
    IsoView isos[most_isos];
    int iso_count;
    // Labels: sampled values in ascending order, and what is background; voxels of the padded lattice.
    IsoView const* labels;
    int label_count; ///< 0: the volume is not drawn as labels
    float nothing;
    int voxels[3];
    float step;         ///< lattice units
    bool skip;          ///< leave out what cannot be seen
    float patience = 1; ///< see is_settled()
    Projected projection = Projected::greatest;
    int rays = 1; ///< per pixel, evenly spread over it; of paths there are `samples`
    // Scattering.
    int samples, first_sample, bounces;
    std::uint64_t seed;
    float albedo, light[3];      ///< from all around, or what the environment is multiplied by
    EnvironmentView environment; ///< of paths
    float anisotropy = 0;        ///< mean cosine of the scattering angle
    Matrix3 to_world;            ///< the inverse of to_lattice
    bool emission;
    SumsView sums;
    int before; ///< number of the rays in the sums
};

/// What happened, summed over rays. The report is made of it.
struct Counters {
    std::int64_t rays = 0;     ///< that met the volume
    std::int64_t segments = 0; ///< that lie on these rays
    std::int64_t samples = 0;  ///< values that were looked up
    std::int64_t capped = 0;   ///< paths that were cut
};

} // namespace vkt::render
