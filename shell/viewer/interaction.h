// What mouse and keys do to a view, and how much work a frame may be: functions without a window.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/annotate.h"
#include "libvkt/render/render.h"
#include "shell/viewer/view.h"

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace vkt::shell::viewer {

/// Movements are fractions of the picture's height, x to the right and y downwards as screens count.
struct Movement {
    double x = 0, y = 0;
};

/// Turns the camera around its target: half a turn for a movement as long as the picture is high. Things follow the
/// hand, and no direction is a pole where that would end.
render::Camera orbit(render::Camera const& camera, Movement movement);
/// Moves eye and target together, so that what is at the target's distance stays under the hand.
render::Camera pan(render::Camera const& camera, Movement movement);
/// Notches of the wheel: positive ones enlarge. Stays within a thousandth and a thousand times what `home` spans.
render::Camera zoom(render::Camera const& camera, double notches, render::Camera const& home);

/// The camera with as few digits as show the same, so that commands stay short.
render::Camera shortened(render::Camera const& camera);

/// Both together forwards, a share of what the picture spans per step; through things, if need be.
render::Camera fly(render::Camera const& camera, double steps);
/// From the side of an axis (0 to 2), `behind`: from its lower end; as far away and with the same lens.
render::Camera axis_view(render::Camera const& camera, int axis, bool behind);
/// The same picture in the middle, with or without perspective.
render::Camera projected(render::Camera const& camera, render::Projection projection);
/// The camera turned so that it looks at the point, from where it stands; what is turned around then.
render::Camera aimed_at(render::Camera const& camera, Vec3 point);

/// A line in the world. direction has length 1.
struct Line {
    Vec3 origin, direction;
};
/// What lies under a place of the picture: x and y in [0,1] from the upper left corner; aspect is width by height.
Line line_under(render::Camera const& camera, double x, double y, double aspect);
/// Where a point of the world is in the picture; none behind the camera.
std::optional<std::array<double, 2>> place_of(render::Camera const& camera, Vec3 point, double aspect);
/// What a picture looks like from a camera that has moved, until that has a picture of its own: where it sees the
/// corners of cells x cells equal parts of the picture, row by row from the upper left one, as if all of it lay in the
/// plane through the target that faces the first camera. Exact at the target's depth; empty where the plane is seen
/// from its edge or its back, or reaches behind the camera.
std::vector<std::array<double, 2>> reprojected(render::Camera const& from, double from_aspect, render::Camera const& to,
                                               double to_aspect, int cells);
/// World length from the bottom to the top of the picture at the target.
double span_of(render::Camera const& camera);
using render::round_length; // of a scale bar
/// Directions of the picture in the world, of length 1.
struct Axes {
    Vec3 right, up, forward;
};
Axes axes_of(render::Camera const& camera);

/// The first place along the line where light is held back by half, by the transfer function and the values that
/// `value_at` tells (NaN: none); none if there is none.
std::optional<Vec3> point_met(Line const& line, render::Renderer const& volume,
                              render::TransferFunction const& transfer, double unit, std::vector<double> const& isos);

/// The part of a volume, in voxels or finest cells, that lies behind a box x0, y0, x1, y1 of the picture (0 to 1):
/// across as far as the box reaches at the depth of what is seen in it, and as deep as it is wide. None if nothing is
/// seen there.
std::optional<Box> part_in_box(render::Camera const& camera, std::array<double, 4> const& box, double aspect,
                               render::Renderer const& volume, render::RenderReport const& report);

/// Effort is the share of the work of a full picture, in [least_effort, 1]. The least is an eighth of the pixels each
/// way with the longest steps or one path a pixel.
double least_effort(render::RenderSettings const& full);
/// The most for a frame of a movement. Ray marching stays below 1, because what is not the full picture leaves out rays
/// and steps within half a level of a display, and a frame without that could take several times as long.
double most_effort(render::RenderSettings const& full);
/// A guess for the first frame: some pixels that any machine draws at once.
double first_effort(render::RenderSettings const& full);
/// The effort for the first frame of `now`, where that of `before` was `effort`: the same pixels and paths. Of another
/// algorithm nothing is known.
double carried_effort(double effort, render::RenderSettings const& before, render::RenderSettings const& now);

/// The same picture for about this share of the work, or less: longer steps or fewer paths first, then fewer pixels; in
/// ray marching rays and steps are left out besides, as --leave-out 0.5 does. Effort 1 changes nothing.
render::RenderSettings reduced(render::RenderSettings const& full, double effort);
/// The effort for the next frame of a movement, from what the last one took. Stays as it is near the target, so that
/// the picture does not change its sharpness with every frame.
double next_effort(double effort, double seconds, double target, double least, double most = 1);
/// The effort of the next pass over a view that stands still: at once 1 if that is quick, else in steps that together
/// cost a third more and show something on the way.
double refined_effort(double effort, double seconds);
/// Paths a pixel of the next pass that adds to those there are: a few at once, then as many as take a quarter of a
/// second. `seconds` is what the last pass of `last` paths took.
int next_paths(int done, int wanted, int last, double seconds);

/// The voxel that a point lies in, given as shares of the volume's extent.
Index3 voxel_at(std::array<double, 3> const& shares, Index3 dims);

/// "NAME.png" or the first of "NAME-2.png", "NAME-3.png", … that is still free.
std::string free_picture_name(std::string const& input_name);
/// The same as a word of a command line; of `several` volumes with a place for their number, as in "NAME-%04d.png".
std::string output_word(std::string const& input_name, bool several);

/// Tells a double click from drags: two clicks at one place, soon after each other, between whose press and release the
/// pointer rests. Seconds and points of the screen.
class DoubleClick {
public:
    /// `slack`: how far a hand at rest may move.
    explicit DoubleClick(double slack = 3) : slack_(slack) {}
    void press(double x, double y, double now);
    void move(double x, double y);
    /// Whether this was the second one.
    bool release();

private:
    double slack_;
    double x_ = 0, y_ = 0, pressed_ = 0; ///< of the last press
    std::optional<double> before_;       ///< when the button was pressed for the click before
    bool still_ = false;
};

} // namespace vkt::shell::viewer
