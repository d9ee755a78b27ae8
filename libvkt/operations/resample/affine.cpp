// Affine: a volume moved by a matrix, or by what a registration found.
// SPDX-License-Identifier: MIT
#include "libvkt/core/frame.h"
#include "libvkt/core/read_once.h"
#include "libvkt/core/text.h"
#include "libvkt/io/whole_text.h"
#include "libvkt/operations/filter/gaussian.h"
#include "libvkt/operations/resample/affine_transform.h"
#include "libvkt/operations/resample/transform_file.h"

namespace vkt {

namespace {

std::string read_text(std::string const& file) {
    constexpr std::size_t largest = std::size_t{1} << 20;
    return whole_text(file, largest);
}

/// True for what is meant as a matrix: something that begins with a number and goes on, or nothing.
bool is_list(std::string const& word) {
    std::size_t const end = word.find_first_of(" ,;\n\t");
    std::string const first = lower_case(word.substr(0, end));
    return word.empty() || (end != std::string::npos && (is_number(first) || first == "nan" || first == "-nan"));
}

/// The voxel of the result at point p is that of the input at T(p), which is how ITK and SciPy mean it; --inverse turns
/// it round: content at p moves to T(p). World coordinates are those of the volume, of ITK's files left-posterior-
/// superior, which volumes in another anatomical frame are seen from.
class AffineOperation : public AffineTransform {
public:
    std::string_view name() const override { return "affine"; }
    Texts texts() const override {
        return {"Move a volume by a matrix or an ITK transform.",
                "The result at a point p shows the input at T(p), as ITK and SciPy mean it; --inverse moves content "
                "from p to T(p) instead. T is twelve or sixteen numbers, row by row, or a file with them or with ITK's "
                "linear transforms (.tfm), in world coordinates unless --unit voxel is given."
                "\n\n"
                "Accuracy: nearest, and turns that put voxels on voxels, are exact; the other methods are weighted "
                "sums with a bound for their rounding, which --explain prints. Integers are rounded to the nearest, "
                "ties to even.",
                {{"Sheared, in voxels",
                  "vkt affine '1 0.2 0 0  0 1 0 0  0 0 1 0' volume.nrrd --unit voxel -o sheared.nrrd"},
                 {"Content ten millimetres along x",
                  "vkt affine '1 0 0 10 0 1 0 0 0 0 1 0' volume.nrrd --inverse --expand -o moved.nrrd"}}};
    }

    void parameters(Parameters& p) override {
        p.positional("matrix", matrix_, "12 or 16 numbers, row by row, or a file with them or with ITK's transforms");
        p.option("unit", unit_, "UNIT", "what the numbers are about: world (default) or voxel");
        p.flag("inverse", inverse_, "the map says where content goes, not where it comes from");
        sampling_parameters(p);
    }

    void check() const override {
        AffineTransform::check();
        if (!is_list(matrix_)) return;
        try {
            parse_transform(matrix_, "MATRIX");
        } catch (Error const& error) {
            throw Error(ErrorKind::usage, error.what(), error.hint());
        }
    }

protected:
    Affine source_map(Moved const& moved) const override {
        TransformText const transform = this->transform();
        Affine const& t = transform.map;
        Header const& lattice = moved.header;
        Index3 const lower = moved.lower;
        if (unit_ == LengthUnit::voxel) {
            Vec3 const l{static_cast<double>(lower.x), static_cast<double>(lower.y), static_cast<double>(lower.z)};
            Affine map = t;
            map.offset = t(l) - l;
            return map;
        }
        // In voxels around the lattice's own origin, so that a far one costs no digits of the linear part.
        Geometry const geometry = transform.itk ? geometry_in(lps_frame, lattice) : lattice.geometry;
        Geometry linear = geometry;
        linear.origin = {};
        Affine map;
        for (int a = 0; a < 3; ++a) {
            auto const i = static_cast<std::size_t>(a);
            Vec3 const step = geometry.direction[i] * geometry.spacing[a];
            map.column[i] = world_to_index(linear, t(step) - t.offset);
        }
        map.offset = world_to_index(linear, t(geometry.origin) - geometry.origin);
        return map;
    }

private:
    /// As it is given, or its inverse.
    TransformText transform() const {
        TransformText result = is_list(matrix_) ? parse_transform(matrix_, "MATRIX")
                                                : parse_transform(text_.of(matrix_, read_text), matrix_);
        if (result.itk && unit_ == LengthUnit::voxel)
            throw Error(ErrorKind::usage, "ITK's transforms are about the world: --unit voxel does not apply");
        if (inverse_) result.map = inverse(result.map);
        return result;
    }

    std::string matrix_;
    LengthUnit unit_ = LengthUnit::world;
    bool inverse_ = false;
    ReadOnce<std::string> text_; ///< of the file
};

} // namespace

VKT_OPERATION(AffineOperation, "affine")

} // namespace vkt
