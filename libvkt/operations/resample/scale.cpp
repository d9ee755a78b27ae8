// Scale: the content of a volume made larger or smaller on the same grid.
// SPDX-License-Identifier: MIT
#include "libvkt/core/text.h"
#include "libvkt/operations/resample/affine_transform.h"

#include <cmath>

namespace vkt {

namespace {

/// Resizes the content of a volume about its middle, or another point, by a factor for each axis; voxels keep their
/// size. Another number of voxels for the same content is what resample gives.
class Scale : public AffineTransform {
public:
    std::string_view name() const override { return "scale"; }
    Texts texts() const override {
        return {"Make the content of a volume larger or smaller.",
                "Content is resized about the middle of the volume, or --about another point, on the grid as it is: "
                "what grows beyond it is lost, unless --expand makes the grid grow or shrink as well. By default axes "
                "that shrink are averaged and axes that grow interpolated linearly. Another number of voxels for the "
                "same content is what vkt resample gives."
                "\n\n"
                "Accuracy: nearest, and turns that put voxels on voxels, are exact; the other methods are weighted "
                "sums with a bound for their rounding, which --explain prints. Integers are rounded to the nearest, "
                "ties to even.",
                {{"Twice as large, all of it kept", "vkt scale volume.nrrd --factor 2 --expand -o large.nrrd"},
                 {"A region magnified in place",
                  "vkt scale volume.nrrd --roi 25%:75%,25%:75%,: --factor 1.5,1.5,1 -o lens.nrrd"}}};
    }

    void parameters(Parameters& p) override {
        p.option("factor", factor_, "F|FX,FY,FZ", "how many times as large").needed();
        p.option("about", about_, "X,Y,Z",
                 "the point that stays, in voxels; 0,0,0 is the centre of the first (the middle)");
        sampling_parameters(p);
    }

    void check() const override {
        AffineTransform::check();
        for (int a = 0; a < 3; ++a) {
            if (!(factor_[a] >= 1e-12 && factor_[a] <= 1e12))
                throw Error(ErrorKind::usage, text("--factor: ", factor_[a], " is not a factor between 1e-12 and 1e12"),
                            factor_[a] < 0 ? "vkt flip mirrors" : "");
            if (about_ && !std::isfinite((*about_)[a])) throw Error(ErrorKind::usage, "--about: not finite");
        }
    }

protected:
    Affine source_map(Moved const& moved) const override {
        Affine map;
        Vec3 const stays = fixed_point(about_, moved);
        for (int a = 0; a < 3; ++a) {
            map.column[static_cast<std::size_t>(a)][a] = 1 / factor_[a];
            map.offset[a] = stays[a] - stays[a] / factor_[a];
        }
        return map;
    }

private:
    Vec3 factor_{1, 1, 1};
    std::optional<Vec3> about_;
};

} // namespace

VKT_OPERATION(Scale, "scale")

} // namespace vkt
