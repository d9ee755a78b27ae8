// When a picture is good enough, and what is known about it then.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <functional>

namespace vkt::render {

/// What a picture is refined to; 0: not asked for. Levels are those of 8-bit display, 255 from black to white.
struct Goal {
    double noise = 0;     ///< multi-scattering: standard error of the mean in levels, of each tile of 16 x 16 pixels
    double tolerance = 0; ///< other algorithms: estimated error of each pixel in levels, of step and of edges
    double seconds = 0;   ///< of drawing: then the picture is what it is

    bool any() const { return noise > 0 || tolerance > 0 || seconds > 0; }
    friend bool operator==(Goal const&, Goal const&) = default;
};

/// How far a picture is.
struct Progress {
    double share = 0;  ///< of the work that is known of, 0 to 1
    double error = -1; ///< in levels, as far as it is known; below 0: not
    double seconds = 0;
};

/// Whoever waits for a picture.
struct Watch {
    std::function<bool()> stop;                    ///< asked often, by several threads: true ends it soon
    std::function<void(Progress const&)> progress; ///< told from time to time, by one thread
};

/// What became of a goal. Errors are estimates in levels; below 0: not known.
struct Quality {
    double error = -1;      ///< root mean square over the picture
    double worst = -1;      ///< of the worst tile (paths) or pixel
    double rays = 1;        ///< or paths per pixel, the mean
    double finest = 0;      ///< shortest step of ray marching
    std::int64_t above = 0; ///< pixels whose error is above what was asked for, or tiles: above 5/4 of it
    double edges = 0;       ///< share of the pixels that have more rays, for smooth edges of surfaces
    double undrawn = 0;     ///< share of the pixels that nothing was drawn in, since it was stopped
    bool stopped = false;   ///< by whoever waits
    bool late = false;      ///< the time was up
};

/// Rays and steps that a picture was drawn without.
struct Savings {
    double filled = 0; ///< share of the pixels that were interpolated between rays
    double longer = 0; ///< share of the others whose ray took longer steps
};

} // namespace vkt::render
