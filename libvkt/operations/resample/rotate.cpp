// Rotate: a volume, or a region of it, turned about a point.
// SPDX-License-Identifier: MIT
#include "libvkt/core/text.h"
#include "libvkt/operations/resample/affine_transform.h"

#include <array>
#include <cmath>

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

namespace {

using Matrix = std::array<std::array<double, 3>, 3>; ///< rows

std::vector<double> numbers_of(std::string const& word, std::string_view name, std::size_t count, char const* form) {
    std::vector<std::string> const parts = parts_of({word}, name);
    std::vector<double> result;
    for (std::string const& part : parts)
        if (is_number(part)) result.push_back(parse_double(part));
    bool finite = result.size() == count && parts.size() == count;
    for (double const v : result) finite = finite && std::isfinite(v);
    if (!finite) throw Error(ErrorKind::usage, text(name, ": '", word, "' is not ", form));
    return result;
}

/// Of an angle in degrees; exact at whole quarters of a turn, as sine and cosine of multiples of pi never are.
void sine_and_cosine(double degrees, double& sine, double& cosine) {
    double const turn = std::remainder(degrees, 360.0), quarter = std::nearbyint(turn / 90);
    double const rest = (turn - 90 * quarter) * (std::acos(-1.0) / 180); // at most an eighth of a turn
    double const s = std::sin(rest), c = std::cos(rest);
    switch (static_cast<int>(quarter)) {
    case 0:
        sine = s, cosine = c;
        return;
    case 1:
        sine = c, cosine = -s;
        return;
    case -1:
        sine = -c, cosine = s;
        return;
    default:
        sine = -s, cosine = -c;
    }
}

/// Rodrigues' formula.
Matrix about_axis(Vec3 axis, double degrees) {
    double const largest = std::max({std::abs(axis.x), std::abs(axis.y), std::abs(axis.z)});
    Vec3 n = axis * (1 / largest); // no square overflows
    n = n * (1 / std::sqrt(n.x * n.x + n.y * n.y + n.z * n.z));
    double s = 0, c = 1;
    sine_and_cosine(degrees, s, c);
    double const t = 1 - c;
    return {{{{t * n.x * n.x + c, t * n.x * n.y - s * n.z, t * n.x * n.z + s * n.y}},
             {{t * n.x * n.y + s * n.z, t * n.y * n.y + c, t * n.y * n.z - s * n.x}},
             {{t * n.x * n.z - s * n.y, t * n.y * n.z + s * n.x, t * n.z * n.z + c}}}};
}

Matrix product(Matrix const& a, Matrix const& b) {
    Matrix result{};
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j)
            for (std::size_t k = 0; k < 3; ++k) result[i][j] += a[i][k] * b[k][j];
    return result;
}

Matrix of_quaternion(Quaternion const& q) {
    Vec3 const v = q.vector;
    double const largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z), std::abs(q.scalar)});
    double const x = v.x / largest, y = v.y / largest, z = v.z / largest, w = q.scalar / largest;
    double const unit = 2 / (x * x + y * y + z * z + w * w);
    return {{{{1 - unit * (y * y + z * z), unit * (x * y - z * w), unit * (x * z + y * w)}},
             {{unit * (x * y + z * w), 1 - unit * (x * x + z * z), unit * (y * z - x * w)}},
             {{unit * (x * z - y * w), unit * (y * z + x * w), 1 - unit * (x * x + y * y)}}}};
}

} // namespace

TurnAxis ValueText<TurnAxis>::read(std::vector<std::string> const& w, std::string_view name) {
    if (w.front() == "x") return {{1, 0, 0}};
    if (w.front() == "y") return {{0, 1, 0}};
    if (w.front() == "z") return {{0, 0, 1}};
    std::vector<double> const v = numbers_of(w.front(), name, 3, "x, y, z or three numbers X,Y,Z");
    if (v[0] == 0 && v[1] == 0 && v[2] == 0) throw Error(ErrorKind::usage, text(name, ": 0,0,0 is no direction"));
    return {{v[0], v[1], v[2]}};
}

std::vector<std::string> ValueText<TurnAxis>::write(TurnAxis v) { return ValueText<Vec3>::write(v.direction); }

Quaternion ValueText<Quaternion>::read(std::vector<std::string> const& w, std::string_view name) {
    std::vector<double> const v = numbers_of(w.front(), name, 4, "four numbers X,Y,Z,W");
    if (v[0] == 0 && v[1] == 0 && v[2] == 0 && v[3] == 0)
        throw Error(ErrorKind::usage, text(name, ": 0,0,0,0 is no rotation"));
    return {{v[0], v[1], v[2]}, v[3]};
}

std::vector<std::string> ValueText<Quaternion>::write(Quaternion v) {
    return {text(v.vector.x, ",", v.vector.y, ",", v.vector.z, ",", v.scalar)};
}

namespace {

/// Turns the content of a volume about its middle, or another point, by the right hand: a positive angle turns counter-
/// clockwise for who looks at the origin from the tip of the axis. Axes are the volume's own, lengths along them world
/// units, so that nothing is distorted by unequal spacings. Angles in degrees; those of quarter turns are exact.
class Rotate : public AffineTransform {
public:
    std::string_view name() const override { return "rotate"; }
    Texts texts() const override {
        return {
            "Turn a volume, or a region of it, about an axis.",
            "A positive angle turns the content counter-clockwise for who looks from the tip of the axis towards the "
            "origin: about z from x to y. Axes are the volume's own; unequal spacings distort nothing. The grid stays, "
            "unless --expand or --like asks for another; quarter turns that put voxels on voxels move bytes."
            "\n\n"
            "Accuracy: nearest, and turns that put voxels on voxels, are exact; the other methods are weighted sums "
            "with a bound for their rounding, which --explain prints. Integers are rounded to the nearest, ties to "
            "even.",
            {{"By 30 degrees about z, all of it kept",
              "vkt rotate volume.nrrd --axis z --angle 30 --expand -o turned.nrrd"},
             {"A region turned in place", "vkt rotate volume.nrrd --roi 25%:75%,25%:75%,: --angle 45 -o region.nrrd"},
             {"A quarter turn is exact", "vkt rotate volume.nrrd --angle 90 --expand | vkt rotate --angle -90 --expand "
                                         "| vkt diff volume.nrrd -"}}};
    }

    void parameters(Parameters& p) override {
        p.option("axis", axis_, "AXIS", "x, y, z (default) or a direction X,Y,Z along the volume's axes");
        p.option("angle", angle_, "DEGREES", "angle about --axis, counter-clockwise seen from its tip");
        p.option("euler", euler_, "A,B,C", "angles in degrees about x, then y, then z, all axes fixed");
        p.option("quaternion", quaternion_, "X,Y,Z,W", "the rotation as a quaternion, the scalar last");
        p.option("about", about_, "X,Y,Z",
                 "the point that stays, in voxels; 0,0,0 is the centre of the first (the middle)");
        sampling_parameters(p);
    }

    void check() const override {
        AffineTransform::check();
        int const given = (angle_ ? 1 : 0) + (euler_ ? 1 : 0) + (quaternion_ ? 1 : 0);
        if (given == 0) throw Error(ErrorKind::usage, "by how much?", "say for example --axis z --angle 30");
        if (given > 1) throw Error(ErrorKind::usage, "only one of --angle, --euler and --quaternion can be followed");
        if (axis_ && !angle_) throw Error(ErrorKind::usage, "--axis goes with --angle");
        if (angle_ && !std::isfinite(*angle_))
            throw Error(ErrorKind::usage, text("--angle: ", *angle_, " is not finite"));
        for (int a = 0; a < 3; ++a) {
            if (euler_ && !std::isfinite((*euler_)[a])) throw Error(ErrorKind::usage, "--euler: not finite");
            if (about_ && !std::isfinite((*about_)[a])) throw Error(ErrorKind::usage, "--about: not finite");
        }
    }

protected:
    Affine source_map(Moved const& moved) const override {
        Matrix m = quaternion_ ? of_quaternion(*quaternion_)
                               : about_axis(axis_.value_or(TurnAxis{}).direction, angle_.value_or(0));
        if (euler_)
            m = product(about_axis({0, 0, 1}, euler_->z),
                        product(about_axis({0, 1, 0}, euler_->y), about_axis({1, 0, 0}, euler_->x)));
        // The inverse is the transpose; from voxels to lengths and back.
        Affine map;
        Vec3 const spacing = moved.header.geometry.spacing, stays = fixed_point(about_, moved);
        for (int a = 0; a < 3; ++a)
            for (int b = 0; b < 3; ++b)
                map.column[static_cast<std::size_t>(a)][b] =
                    m[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)] * (spacing[a] / spacing[b]);
        map.offset = stays - map(stays);
        return map;
    }

private:
    std::optional<TurnAxis> axis_;
    std::optional<double> angle_;
    std::optional<Vec3> euler_;
    std::optional<Quaternion> quaternion_;
    std::optional<Vec3> about_;
};

} // namespace

VKT_OPERATION(Rotate, "rotate")

} // namespace vkt
