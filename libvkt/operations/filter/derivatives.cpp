// Derivatives by differences of neighbours: gradient, Sobel, Laplacian.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/linear_filter.h"

namespace vkt {

/// Of a gradient: one of its components, along an axis of the lattice, or its length.
enum class Component : std::uint8_t { magnitude, x, y, z };

template <> struct EnumNames<Component> {
    static std::vector<std::pair<Component, char const*>> all() {
        return {{Component::magnitude, "magnitude"}, {Component::x, "x"}, {Component::y, "y"}, {Component::z, "z"}};
    }
};

namespace {

/// Central differences (v(+1) - v(-1)) / 2h per world unit: a ramp a x gives a.
class Gradient : public LinearFilter {
public:
    std::string_view name() const override { return "filter gradient"; }
    Texts texts() const override {
        return {"The gradient by central differences, in world units.",
                "(v(+1) - v(-1)) / 2h along each axis of the lattice, h being the voxel size: a ramp a x gives a. The "
                "length of the gradient, or one component with --component."
                "\n\n"
                "Accuracy: Bound, known before it runs (--explain prints it): a share of the largest magnitude for the "
                "rounding of sums; integers are rounded once more, to the nearest, ties to even.",
                {{"How steep the volume is", "vkt filter gradient volume.nrrd -o steep.nrrd"},
                 {"The change along z", "vkt filter gradient volume.nrrd --component z -o dz.nrrd"}}};
    }

    void parameters(Parameters& parameters) override {
        parameters.option("component", component_, "WHICH", "length of the gradient, or its component along an axis");
        LinearFilter::parameters(parameters);
    }

protected:
    /// Taps across the direction of the difference.
    virtual AxisTaps across() const { return {}; }
    virtual std::string label() const { return "central differences"; }
    Weights weights(Header const& in, Index3 /*cell_width*/) const override {
        Weights result;
        SeparableSum& sum = result.sum;
        Vec3 const& h = in.geometry.spacing;
        AxisTaps const mean = across();
        // Index 0: the difference; 1: across.
        sum.x = {central_difference(h[0]), mean};
        sum.y = {central_difference(h[1]), mean};
        sum.z = {central_difference(h[2]), mean};
        std::array<SeparableSum::Plane, 3> const planes{{{0, 1}, {1, 0}, {1, 1}}};
        for (int axis = 0; axis < 3; ++axis) {
            bool const wanted = component_ == Component::magnitude || static_cast<int>(component_) == axis + 1;
            if (!wanted) continue;
            sum.terms.push_back(
                {static_cast<int>(sum.planes.size()), axis == 2 ? 0 : 1, static_cast<int>(sum.terms.size())});
            sum.planes.push_back(planes[static_cast<std::size_t>(axis)]);
        }
        sum.parts = static_cast<int>(sum.terms.size());
        result.method = text(label(), component_ == Component::magnitude ? ", length" : ", along ",
                             component_ == Component::magnitude ? "" : enum_name(component_));
        return result;
    }

private:
    Component component_ = Component::magnitude;
};

/// The same, averaged across with [1 2 1] / 4 along the other two axes; the classical weights divided by 32 h.
class Sobel : public Gradient {
public:
    std::string_view name() const override { return "filter sobel"; }
    Texts texts() const override {
        return {"The gradient by Sobel's kernels, in world units.",
                "Central differences averaged across by [1 2 1] / 4 along both other axes: a ramp a x gives a, which "
                "is the classical sum of weights divided by 32 h. The length of the gradient, or one component with "
                "--component."
                "\n\n"
                "Accuracy: Bound, known before it runs (--explain prints it): a share of the largest magnitude for the "
                "rounding of sums; integers are rounded once more, to the nearest, ties to even.",
                {{"Edges", "vkt filter sobel volume.nrrd -o edges.nrrd"},
                 {"The signed change along x", "vkt filter sobel volume.nrrd --component x -o dx.nrrd"}}};
    }

protected:
    AxisTaps across() const override { return {AxisTaps::Kind::even, {0.5, 0.25}}; }
    std::string label() const override { return "Sobel"; }
};

/// Sum over the axes of (v(+1) - 2 v + v(-1)) / h^2: x^2 gives 2, a bright blob a negative value in its middle.
class Laplacian : public LinearFilter {
public:
    std::string_view name() const override { return "filter laplacian"; }
    Texts texts() const override {
        return {"The Laplacian, in world units.",
                "The sum over the axes of (v(+1) - 2 v + v(-1)) / h^2, h being the voxel size: x^2 gives 2, a bright "
                "blob a negative value in its middle."
                "\n\n"
                "Accuracy: Bound, known before it runs (--explain prints it): a share of the largest magnitude for the "
                "rounding of sums; integers are rounded once more, to the nearest, ties to even.",
                {{"Blobs and edges", "vkt filter laplacian volume.nrrd -o curved.nrrd"}}};
    }

protected:
    Weights weights(Header const& in, Index3 /*cell_width*/) const override {
        Weights result;
        SeparableSum& sum = result.sum;
        Vec3 const& h = in.geometry.spacing;
        sum.x = {second_difference(h[0]), AxisTaps{}};
        sum.y = {second_difference(h[1]), AxisTaps{}};
        sum.z = {second_difference(h[2]), AxisTaps{}};
        sum.planes = {{0, 1}, {1, 0}, {1, 1}};
        sum.terms = {{0, 1, 0}, {1, 1, 0}, {2, 0, 0}};
        result.method = "second differences";
        return result;
    }
};

} // namespace

VKT_OPERATION(Gradient, "filter gradient")
VKT_OPERATION(Sobel, "filter sobel")
VKT_OPERATION(Laplacian, "filter laplacian")

} // namespace vkt
