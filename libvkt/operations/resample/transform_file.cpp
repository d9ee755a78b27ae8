// Reading affine transforms.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/transform_file.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <cmath>
#include <vector>

namespace vkt {
namespace {

using Numbers = std::vector<double>;

struct Reader {
    std::string_view name;

    [[noreturn]] void refuse(std::string const& why, std::string const& hint = "") const {
        throw Error(ErrorKind::data, text(name, ": ", why), hint);
    }

    Numbers numbers(std::string_view words) const {
        Numbers result;
        std::string word;
        auto const take = [&] {
            if (word.empty()) return;
            if (!is_number(word)) refuse(text("'", printable(word.substr(0, 40)), "' is not a number"));
            result.push_back(parse_double(word));
            if (!std::isfinite(result.back())) refuse(text(word, " is not finite"));
            if (result.size() > 64) refuse("more than 64 numbers");
            word.clear();
        };
        for (char const c : words) {
            if (c == ' ' || c == '\t' || c == ',' || c == ';' || c == '\n' || c == '\r')
                take();
            else
                word += c;
        }
        take();
        return result;
    }

    Affine matrix(Numbers const& v) const {
        if (v.size() != 12 && v.size() != 16)
            refuse(text(v.size(), " numbers are no affine map"), "give 12, three rows of four, or 16");
        if (v.size() == 16 && !(v[12] == 0 && v[13] == 0 && v[14] == 0 && v[15] == 1))
            refuse("the last of the four rows is not 0 0 0 1");
        Affine map;
        for (std::size_t row = 0; row < 3; ++row) {
            for (std::size_t a = 0; a < 3; ++a) map.column[a][static_cast<int>(row)] = v[4 * row + a];
            map.offset[static_cast<int>(row)] = v[4 * row + 3];
        }
        return map;
    }
};

/// Rows of three.
void set_linear(Affine& map, double const* v) {
    for (int row = 0; row < 3; ++row)
        for (int a = 0; a < 3; ++a) map.column[static_cast<std::size_t>(a)][row] = v[3 * row + a];
}

Affine about_axis(int axis, double angle) {
    Affine map;
    int const b = (axis + 1) % 3, c = (axis + 2) % 3;
    map.column[static_cast<std::size_t>(b)][b] = map.column[static_cast<std::size_t>(c)][c] = std::cos(angle);
    map.column[static_cast<std::size_t>(b)][c] = std::sin(angle);
    map.column[static_cast<std::size_t>(c)][b] = -std::sin(angle);
    return map;
}

/// A rotation by its versor's vector part, as ITK keeps it.
void set_versor(Affine& map, Reader const& reader, double x, double y, double z) {
    double const square = x * x + y * y + z * z;
    if (square > 1 + 1e-9) reader.refuse("the versor is longer than 1");
    double const w = std::sqrt(std::max(0.0, 1 - square));
    double const rows[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),
                            2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
                            2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y)};
    set_linear(map, rows);
}

void scale_columns(Affine& map, double const* by) {
    for (std::size_t a = 0; a < 3; ++a) map.column[a] = map.column[a] * by[a];
}

/// Adds to the entries of the matrix: on the diagonal what is more than 1 of three scales, beside it six skews, row by
/// row. So ITK means them: the rotation that is added to is not scaled.
void add_scale_and_skew(Affine& map, double const* scale, double const* skew) {
    for (int row = 0; row < 3; ++row)
        for (int a = 0; a < 3; ++a) {
            double& entry = map.column[static_cast<std::size_t>(a)][row];
            if (row == a)
                entry += scale[a] - 1;
            else if (skew != nullptr)
                entry += *skew++;
        }
}

/// The name of a transform's class, which must be in three dimensions and linear.
std::string linear_kind(Reader const& reader, std::string const& type) {
    std::string kind = type.substr(0, type.find('_'));
    for (char const* const bent :
         {"BSpline", "DisplacementField", "VelocityField", "ThinPlate", "ElasticBody", "VolumeSpline", "Kernel",
          "AzimuthElevation", "TimeVarying", "ConstantVelocity", "GaussianExponential", "GaussianSmoothing"})
        if (kind.find(bent) != std::string::npos)
            reader.refuse(text(printable(kind), " is not linear: it moves every point of space its own way"),
                          "only linear transforms are matrices; leave it to ITK, or take the linear part alone");
    if (type.size() < 4 || type.substr(type.size() - 4) != "_3_3")
        reader.refuse(text(printable(type), " is not in three dimensions"));
    return kind;
}

/// One transform of an ITK file: its matrix and shift about its centre.
Affine itk_transform(Reader const& reader, std::string const& type, Numbers const& p, Numbers const& fixed) {
    std::string const kind = linear_kind(reader, type);
    auto const expect = [&](std::size_t count) {
        if (p.size() != count) reader.refuse(text(kind, " with ", p.size(), " parameters instead of ", count));
    };
    Affine map;
    std::size_t shift = 0, middle = 0; // where the translation is, and the centre, unless that is fixed
    if (kind == "IdentityTransform") return map;
    if (kind == "AffineTransform" || kind == "MatrixOffsetTransformBase" || kind == "Rigid3DTransform" ||
        kind == "ScalableAffineTransform" || kind == "FixedCenterOfRotationAffineTransform") {
        expect(12);
        set_linear(map, p.data());
        shift = 9;
    } else if (kind == "CenteredAffineTransform") {
        expect(15);
        set_linear(map, p.data());
        middle = 9;
        shift = 12;
    } else if (kind == "TranslationTransform") {
        expect(3);
        map.offset = {p[0], p[1], p[2]};
        return map;
    } else if (kind == "ScaleTransform") {
        expect(3);
        scale_columns(map, p.data());
        shift = 3;
    } else if (kind == "ScaleLogarithmicTransform") { // whose parameters are logarithms
        expect(3);
        double const scale[3] = {std::exp(p[0]), std::exp(p[1]), std::exp(p[2])};
        scale_columns(map, scale);
        shift = 3;
    } else if (kind == "ScaleVersor3DTransform" || kind == "ScaleSkewVersor3DTransform") {
        bool const skewed = kind == "ScaleSkewVersor3DTransform";
        expect(skewed ? 15 : 9);
        set_versor(map, reader, p[0], p[1], p[2]);
        add_scale_and_skew(map, p.data() + 6, skewed ? p.data() + 9 : nullptr);
        shift = 3;
    } else if (kind == "ComposeScaleSkewVersor3DTransform") { // a rotation of a scale of a shear
        expect(12);
        set_versor(map, reader, p[0], p[1], p[2]);
        scale_columns(map, p.data() + 6);
        Affine shear;
        shear.column[1][0] = p[9];
        shear.column[2][0] = p[10];
        shear.column[2][1] = p[11];
        map = composed(map, shear);
        shift = 3;
    } else if (kind == "QuaternionRigidTransform") {
        expect(7);
        double const size = std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3]);
        if (!(std::abs(size - 1) < 1e-6)) reader.refuse("the quaternion is not of length 1, and no rotation");
        double const turn = p[3] < 0 ? -1 : 1; // the same rotation, by a versor
        set_versor(map, reader, turn * p[0], turn * p[1], turn * p[2]);
        shift = 4;
    } else if (kind == "Euler3DTransform" || kind == "CenteredEuler3DTransform") {
        expect(kind == "Euler3DTransform" ? 6 : 9);
        bool const zyx = fixed.size() > 3 && fixed[3] != 0;
        Affine const x = about_axis(0, p[0]), y = about_axis(1, p[1]), z = about_axis(2, p[2]);
        map = zyx ? composed(z, composed(y, x)) : composed(z, composed(x, y));
        middle = p.size() == 9 ? 3 : 0;
        shift = p.size() == 9 ? 6 : 3;
    } else if (kind == "VersorTransform" || kind == "VersorRigid3DTransform" || kind == "Similarity3DTransform") {
        expect(kind == "VersorTransform" ? 3 : kind == "VersorRigid3DTransform" ? 6 : 7);
        set_versor(map, reader, p[0], p[1], p[2]);
        if (p.size() == 7)
            for (Vec3& column : map.column) column = column * p[6];
        shift = 3;
    } else {
        reader.refuse(text(printable(kind), " is not one of the transforms that are known here"),
                      "affine, rigid, Euler, versor, quaternion, similarity, scale, skew, translation and identity "
                      "transforms are");
    }
    Vec3 centre, moved;
    if (!fixed.empty() && fixed.size() < 3) reader.refuse(text(kind, " with ", fixed.size(), " fixed parameters"));
    for (int a = 0; a < 3; ++a) {
        if (middle > 0)
            centre[a] = p[middle + static_cast<std::size_t>(a)];
        else if (!fixed.empty())
            centre[a] = fixed[static_cast<std::size_t>(a)];
        if (shift + 3 <= p.size()) moved[a] = p[shift + static_cast<std::size_t>(a)];
    }
    map.offset = {};
    map.offset = centre + moved - map(centre);
    return map;
}

Affine itk_file(Reader const& reader, std::string_view contents) {
    Affine all;
    std::string type;
    Numbers parameters;
    bool composite = false, open = false, has_parameters = false;
    int count = 0;
    auto const close = [&](Numbers const& fixed) {
        if (!open) return;
        open = false;
        if (!has_parameters) reader.refuse("a transform without parameters");
        all = composed(all, itk_transform(reader, type, parameters, fixed)); // the last is applied first
        ++count;
    };
    for (std::string const& raw : split(contents, '\n')) {
        std::string line = raw;
        while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
        if (line.empty() || line.front() == '#') continue;
        std::size_t const colon = line.find(':');
        if (colon == std::string::npos)
            reader.refuse(text("a line that no transform file has: '", printable(line), "'"));
        std::string const key = line.substr(0, colon);
        std::string value = line.substr(colon + 1);
        value.erase(0, value.find_first_not_of(' '));
        if (key == "Transform") {
            close({});
            if (value.rfind("CompositeTransform", 0) == 0) {
                if (composite || count > 0) reader.refuse("a composite inside another");
                composite = true;
                continue;
            }
            if (count > 0 && !composite) reader.refuse("several transforms that are no composite");
            type = value;
            static_cast<void>(linear_kind(reader, type)); // before its parameters, which may be any number
            parameters.clear();
            open = true;
            has_parameters = type.rfind("IdentityTransform", 0) == 0;
        } else if (key == "Parameters") {
            parameters = reader.numbers(value);
            has_parameters = true;
        } else if (key == "FixedParameters") {
            close(reader.numbers(value));
        } else {
            reader.refuse(text("a line that no transform file has: '", printable(line), "'"));
        }
    }
    close({});
    if (count == 0) reader.refuse("no transform in it");
    return all;
}

} // namespace

TransformText parse_transform(std::string_view contents, std::string_view name) {
    Reader const reader{name};
    TransformText result;
    result.itk = contents.rfind("#Insight Transform File", 0) == 0;
    if (result.itk) {
        result.map = itk_file(reader, contents);
    } else {
        std::string numbers;
        for (std::string const& line : split(contents, '\n')) numbers += line.substr(0, line.find('#')) + "\n";
        result.map = reader.matrix(reader.numbers(numbers));
    }
    try {
        inverse(result.map);
    } catch (Error const&) {
        reader.refuse("the matrix cannot be inverted: it makes a plane of space");
    }
    return result;
}

} // namespace vkt
