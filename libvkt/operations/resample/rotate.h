// Rotate: a volume, or a region of it, turned about a point.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/resample/affine_transform.h"

namespace vkt {

/// "x", "y", "z" or "X,Y,Z": a direction along the volume's own axes.
struct TurnAxis {
    Vec3 direction{0, 0, 1};
};
template <> struct ValueText<TurnAxis> : OneWord {
    static TurnAxis read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(TurnAxis v);
};

/// "X,Y,Z,W": cos(angle / 2) = W, the axis times sin(angle / 2) = X,Y,Z, up to a common factor.
struct Quaternion {
    Vec3 vector;
    double scalar = 1;
};
template <> struct ValueText<Quaternion> : OneWord {
    static Quaternion read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(Quaternion v);
};

/// Turns the content of a volume about its middle, or another point, by the right hand: a positive angle turns counter-
/// clockwise for who looks at the origin from the tip of the axis. Axes are the volume's own, lengths along them world
/// units, so that nothing is distorted by unequal spacings. Angles in degrees; those of quarter turns are exact.
class Rotate : public AffineTransform {
public:
    std::string_view name() const override { return "rotate"; }
    Texts texts() const override;
    void parameters(Parameters& p) override;
    void check() const override;

protected:
    Affine source_map(Moved const& moved) const override;

private:
    std::optional<TurnAxis> axis_;
    std::optional<double> angle_;
    std::optional<Vec3> euler_;
    std::optional<Quaternion> quaternion_;
    std::optional<Vec3> about_;
};

} // namespace vkt
