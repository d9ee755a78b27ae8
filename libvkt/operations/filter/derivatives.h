// Derivatives by differences of neighbours: gradient, Sobel, Laplacian.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/filter/linear_filter.h"

namespace vkt {

/// Of a gradient: one of its components, along an axis of the lattice, or its length.
enum class Component : std::uint8_t { magnitude, x, y, z };
template <> struct EnumNames<Component> {
    static std::vector<std::pair<Component, char const*>> all() {
        return {{Component::magnitude, "magnitude"}, {Component::x, "x"}, {Component::y, "y"}, {Component::z, "z"}};
    }
};

/// Central differences (v(+1) - v(-1)) / 2h per world unit: a ramp a x gives a.
class Gradient : public LinearFilter {
public:
    std::string_view name() const override { return "filter gradient"; }
    Texts texts() const override;
    void parameters(Parameters& parameters) override;

protected:
    /// Taps across the direction of the difference.
    virtual AxisTaps across() const { return {}; }
    virtual std::string label() const { return "central differences"; }
    Weights weights(Header const& in, Index3 cell_width) const override;

private:
    Component component_ = Component::magnitude;
};

/// The same, averaged across with [1 2 1] / 4 along the other two axes; the classical weights divided by 32 h.
class Sobel : public Gradient {
public:
    std::string_view name() const override { return "filter sobel"; }
    Texts texts() const override;

protected:
    AxisTaps across() const override { return {AxisTaps::Kind::even, {0.5, 0.25}}; }
    std::string label() const override { return "Sobel"; }
};

/// Sum over the axes of (v(+1) - 2 v + v(-1)) / h^2: x^2 gives 2, a bright blob a negative value in its middle.
class Laplacian : public LinearFilter {
public:
    std::string_view name() const override { return "filter laplacian"; }
    Texts texts() const override;

protected:
    Weights weights(Header const& in, Index3 cell_width) const override;
};

} // namespace vkt
