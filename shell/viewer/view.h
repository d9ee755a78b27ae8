// What a window shows, as a plain value: camera, integrator, transfer function, surfaces. And the command that draws
// it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/render.h"
#include "shell/viewer/transfer_edit.h"

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace vkt::shell::viewer {

/// An iso-surface.
struct Surface {
    double value = 0; ///< physical
    render::Color color{0.9, 0.8, 0.7};
    double opacity = 1;
    friend bool operator==(Surface const&, Surface const&) = default;
};

/// How the volume looks, whatever it is seen from: what undo goes back through.
struct Look {
    render::Algorithm algorithm = render::Algorithm::ray_marching;
    std::string colormap;                 ///< of the automatic transfer function; empty: chosen by the renderer
    std::optional<TransferEdit> transfer; ///< none: the one of the command line
    std::vector<Surface> surfaces;        ///< none: those of the command line
    render::LabelMode labels = render::LabelMode::automatic;
    double step = 0.5;
    bool exact = false;
    double shade = -1; ///< below 0: chosen by the renderer
    int samples = 64;
    double albedo = 1;
    bool emission = false;
    std::string unit; ///< as the option --unit-distance takes it
    double opacity_scale = 1;
    std::string clip;                ///< as the option --clip-box takes it; empty: nothing is cut off
    std::vector<double> clip_planes; ///< as render::RenderSettings has them
    std::optional<Vec3> light_direction;
    double ambient = 0.25, specular = 0.12;
    bool shadows = false;
    int ambient_occlusion = 0;   ///< directions; 0: off
    double occlusion_radius = 0; ///< world length; 0: a tenth of the diagonal
    double environment_rotation = 0, environment_strength = 1;
    friend bool operator==(Look const&, Look const&) = default;
};

/// What the user has changed since the command line.
struct View {
    int width = 0, height = 0;            ///< of the picture
    std::optional<render::Camera> camera; ///< none: the one that the command line asks for
    Look look;
};

View initial_view(render::RenderSettings const& asked);
render::RenderSettings settings_of(render::RenderSettings const& asked, View const& view);
/// The words of a command line (verb, options, inputs) that draws the view: those of the one that was asked for, as far
/// as they still hold.
std::vector<std::string> words_of(std::vector<std::string> const& asked_words, render::RenderSettings const& asked,
                                  View const& view);

/// Draws the volume as labels, or not: colours and surfaces that were edited are in the way of that.
void draw_labels(Look& look, render::LabelMode when);
/// Whether the command line and the algorithm leave a choice whether labels are drawn.
bool may_draw_labels(render::RenderSettings const& asked, Look const& look);

/// The one with this value, of labels in ascending order; null if there is none.
render::ShownLabel const* label_at(std::vector<render::ShownLabel> const& labels, double value);

/// The projection along rays after this one, or the first of them.
render::Algorithm next_projection(render::Algorithm algorithm);

/// True if the colours come from a map and not from a transfer function of the user's own.
bool has_colormap(render::RenderSettings const& asked);
/// The map after the current one: all in turn, then the one that was asked for.
std::string next_colormap(std::string const& current, std::string const& asked);

/// The look with its transfer function as something to edit, which shows what `report` says was shown.
TransferEdit editable_transfer(render::RenderSettings const& asked, Look const& look,
                               render::RenderReport const& report);
/// The same of the surfaces: those that were shown, in the colours of the transfer function.
std::vector<Surface> editable_surfaces(Look const& look, render::RenderReport const& report);

/// Shares of a volume's extent that a clip box leaves, 0 to 1 per axis, and back; all of it is the empty text. Voxels
/// are kept whole.
using Shares = std::array<std::array<double, 2>, 3>;
std::string clip_text(Shares const& shares, Index3 dims);
Shares clip_shares(std::string const& clip, Index3 dims);

/// A direction as angles in degrees, those of --azimuth and --elevation, and back, with six digits behind the point.
/// From straight above or below the azimuth is 0.
struct Angles {
    double azimuth = 0, elevation = 0;
};
Angles angles_of(Vec3 direction);
Vec3 direction_of(Angles const& angles);

/// World length from one corner of a volume to the furthest other one.
double diagonal_of(Header const& header);

/// A plane through the middle of a volume that cuts off what lies before it, seen by a camera.
std::array<double, 4> plane_facing(render::Camera const& camera, Header const& header);
/// The least and the greatest distance of a plane with this normal that cuts the volume.
std::array<double, 2> plane_distances(Vec3 normal, Header const& header);

} // namespace vkt::shell::viewer
