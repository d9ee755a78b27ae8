// What mouse and keys do to a view, and how much work a frame may be: functions without a window.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/render.h"

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

/// What the user has changed since the command line.
struct View {
    int width = 0, height = 0; ///< of the picture
    std::string colormap;
    std::optional<render::Camera> camera; ///< none: the one that the command line asks for
};
View initial_view(render::RenderSettings const& asked);
render::RenderSettings settings_of(render::RenderSettings const& asked, View const& view);
/// The words of a command line (verb, options, inputs) that draws the view.
std::vector<std::string> words_of(std::vector<std::string> const& asked_words, render::RenderSettings const& asked,
                                  View const& view);

/// True if the colours come from a map and not from a transfer function of the user's own.
bool has_colormap(render::RenderSettings const& asked);
/// The map after the current one: all in turn, then the one that was asked for.
std::string next_colormap(std::string const& current, std::string const& asked);

/// Effort is the share of the work of a full picture, in [least_effort, 1]. The least is an eighth of the pixels each
/// way with the longest steps or one path a pixel.
double least_effort(render::RenderSettings const& full);
/// A guess for the first frame: some pixels that any machine draws at once.
double first_effort(render::RenderSettings const& full);

/// The same picture for about this share of the work: longer steps or fewer paths first, then fewer pixels. Effort 1
/// changes nothing.
render::RenderSettings reduced(render::RenderSettings const& full, double effort);
/// The effort for the next frame of a movement, from what the last one took. Stays as it is near the target, so that
/// the picture does not change its sharpness with every frame.
double next_effort(double effort, double seconds, double target, double least);
/// The effort of the next pass over a view that stands still: at once 1 if that is quick, else in steps that together
/// cost a third more and show something on the way.
double refined_effort(double effort, double seconds);

/// "NAME.png" or the first of "NAME-2.png", "NAME-3.png", … that is still free.
std::string free_picture_name(std::string const& input_name);

} // namespace vkt::shell::viewer
