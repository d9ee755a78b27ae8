// Knobs: options of an operation that trade error for time, and the values of them that are worth a try.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/view.h"

#include <optional>
#include <string>
#include <vector>

namespace vkt {

struct Knob {
    std::string option;              ///< its name, without dashes
    std::vector<std::string> values; ///< to try besides what is given, the fastest first; of a flag "on"
    std::string best;                ///< the one with the least error; empty: what is given
    /// True if the error bound of a plan tells what a value costs. False where each value is a definition of its own
    /// (an interpolant): a bound is then about that definition.
    bool bounded = true;
};

/// What an operation is besides, if it has knobs. What varies them, `vkt chart`, knows none of them by name.
class Tunable {
public:
    virtual ~Tunable() = default;
    /// Of the volume last begun; values that do not go together with the other options are refused when tried.
    virtual std::vector<Knob> knobs() const = 0;
    /// The stored value of one voxel as the operation is defined, summed directly in more than double precision: a
    /// second opinion on its most exact setting, which shares no code with it. Of the volume last begun, as float64;
    /// none if the operation has no such form. Its values are taken as finite.
    virtual std::optional<double> by_definition(ConstView /*input*/, Index3 /*voxel*/) const { return std::nullopt; }
};

/// A type for the result as a knob: values are stored in it, rounded.
inline Knob type_knob() { return {"dtype", {"float16", "float32"}, "float64"}; }

} // namespace vkt
