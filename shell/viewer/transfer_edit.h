// A transfer function as hands edit it: knots of opacity, colours from a map or of one's own. Plain values, no window.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/render.h"

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace vkt::shell::viewer {

struct OpacityKnot {
    double value = 0; ///< physical
    double alpha = 0; ///< of a layer as thick as the unit distance, in [0,1]
    friend bool operator==(OpacityKnot const&, OpacityKnot const&) = default;
};
struct ColorKnot {
    double value = 0;
    render::Color color; ///< sRGB
    friend bool operator==(ColorKnot const&, ColorKnot const&) = default;
};

/// Between knots extinctions run in straight lines, as the renderer has it; beyond them they stay.
struct TransferEdit {
    double lower = 0, upper = 1;      ///< values that the colours span; lower < upper
    std::string colormap = "viridis"; ///< NAME or NAME:reverse
    std::vector<ColorKnot> colors;    ///< of one's own instead of the map, ascending; empty: the map
    std::vector<OpacityKnot> knots;   ///< ascending, never empty
    bool logarithmic = false;         ///< the map is spread over the logarithms of values; needs lower > 0
    friend bool operator==(TransferEdit const&, TransferEdit const&) = default;
};

render::Color color_at(TransferEdit const& edit, double value);
double alpha_at(TransferEdit const& edit, double value);

/// Each returns the index at which the knot lies afterwards.
std::size_t add_knot(TransferEdit& edit, OpacityKnot knot);
/// Knots do not pass one another; opacities stay in [0,1].
std::size_t move_knot(TransferEdit& edit, std::size_t index, OpacityKnot to);
/// The last knot stays.
void remove_knot(TransferEdit& edit, std::size_t index);

/// The colours' span; ignored unless lower < upper and both are finite. `along`: knots and own colours keep their
/// places in it.
void set_domain(TransferEdit& edit, double lower, double upper, bool along);

/// The map as colours of one's own, which may be moved, changed, added and removed.
void own_colors(TransferEdit& edit, std::size_t count = 7);
std::size_t add_color(TransferEdit& edit, double value);
std::size_t move_color(TransferEdit& edit, std::size_t index, double value);
/// The last one stays.
void remove_color(TransferEdit& edit, std::size_t index);

/// The number with the fewest digits that is no further from this one.
double rounded_within(double value, double tolerance);

/// What the settings show then: words of the command line where these suffice (a map over a range, opacities at
/// values), a function of its own otherwise.
void apply(TransferEdit const& edit, render::RenderSettings& settings);
render::TransferFunction function_of(TransferEdit const& edit);

/// The function as something to edit. With the name of a map the colours are its; without, those of the function.
/// Knots that lie on the line between their neighbours, but for a fiftieth of their opacity, are left out.
TransferEdit edit_of(render::TransferFunction const& function, std::string const& colormap);

/// Names of presets, for a menu: shapes first, then kinds of data.
std::vector<std::string> preset_names();
/// Values that the preset places (HU for CT) or the histogram does. Colours are the preset's own where it has some.
/// Throws Error{usage} for unknown names.
TransferEdit preset(std::string const& name, render::Histogram const& histogram, TransferEdit const& now);

/// Where values lie along an axis of length 1, and back.
struct ValueAxis {
    double lower = 0, upper = 1;
    bool logarithmic = false; ///< if lower > 0
    double place(double value) const;
    double value(double place) const;
};
/// The same of opacities: linear, or so that small ones have room (10^-4 to 1, and 0 at the bottom).
struct OpacityAxis {
    bool logarithmic = false;
    double place(double alpha) const;
    double alpha(double place) const;
};

/// Values from black to white in slices: but for a few outliers all of them. lower = upper if there is only one.
ValueAxis grey_axis(render::Histogram const& histogram);

/// Counts of the histogram per column of a picture as wide as the axis, as logarithms, 0 to 1. Where values come in
/// steps, as integers do, each stands for as much: there are no gaps between them.
std::vector<float> log_columns(render::Histogram const& histogram, ValueAxis const& axis, std::size_t columns);

/// States that one can go back to and forth again.
template <class T> class Undo {
public:
    explicit Undo(T first) : states_{std::move(first)} {}
    /// A finished change; does nothing if nothing changed. What was undone is forgotten.
    void record(T const& state) {
        if (state == states_[at_]) return;
        states_.resize(at_ + 1);
        states_.push_back(state);
        if (states_.size() > most) states_.erase(states_.begin());
        at_ = states_.size() - 1;
    }
    bool can_undo() const { return at_ > 0; }
    bool can_redo() const { return at_ + 1 < states_.size(); }
    T const& undo() { return states_[at_ -= can_undo() ? 1 : 0]; }
    T const& redo() { return states_[at_ += can_redo() ? 1 : 0]; }
    /// What is to hold of all states, whichever one goes back to.
    template <class Change> void change_all(Change change) {
        for (T& state : states_) change(state);
    }
    T const& now() const { return states_[at_]; }

private:
    static constexpr std::size_t most = 200;
    std::vector<T> states_;
    std::size_t at_ = 0;
};

/// Writes a transfer function, as text. A file of that name is replaced if it is one, too. Throws Error.
void save_transfer(std::string const& path, std::string const& json);

} // namespace vkt::shell::viewer
