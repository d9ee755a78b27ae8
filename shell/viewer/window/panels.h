// The panels beside the picture: what they show of a view, and what they change in it. No window, no picture.
// SPDX-License-Identifier: MIT
#pragma once

#include "shell/viewer/painter.h"

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace vkt::shell::viewer {

/// A rectangle in the window's points, from its upper left corner.
struct Area {
    float x = 0, y = 0, width = 0, height = 0;
    bool contains(double px, double py) const { return px >= x && py >= y && px < x + width && py < y + height; }
};

/// What panels show besides the view.
struct Shown {
    render::RenderSettings const& asked;
    Frame const* frame = nullptr; ///< none before the first one
    std::shared_ptr<render::Renderer const> volume;
    Area picture;
    double cursor_x = -1, cursor_y = -1; ///< in the picture, 0 to 1
    bool can_undo = false, can_redo = false, magnified = false;
    std::string message;
};

/// What buttons and keys ask for beyond the view itself.
enum class Wish { none, save, command, next, previous, reset_camera, undo, redo, magnify, whole, quit };

class Panels {
public:
    /// Draws all panels within the area; changes in `view` are to be shown. Returns what was asked for.
    Wish draw(View& view, Shown const& shown, Area const& area);
    /// Over the picture, as far as they are switched on: colour bar, scale, axes, slices, help, the box being drawn.
    Wish draw_over_picture(View& view, Shown const& shown);
    /// Whether the pointer is over something of ours that lies over the picture.
    bool covers(double x, double y) const;

    std::string remark; ///< on what was typed, to be told once

    bool help = false, overlays = false, slices = false;
    bool choosing_box = false;                   ///< the next drag draws the box of a part
    std::optional<std::array<double, 4>> box;    ///< x0, y0, x1, y1 in the picture, 0 to 1
    std::array<double, 3> crosshair{.5, .5, .5}; ///< shares of the volume's extent
    std::array<std::optional<render::Camera>, 9> stored;

private:
    void transfer_panel(View& view, Shown const& shown);
    void histogram_canvas(View& view, Shown const& shown, TransferEdit& edit, bool& changed);
    void color_strip(Shown const& shown, TransferEdit& edit, bool& changed);
    void algorithm_panel(View& view, Shown const& shown);
    void surfaces_panel(View& view, Shown const& shown);
    Wish camera_panel(View& view, Shown const& shown);
    void clip_panel(View& view, Shown const& shown);
    void planes_panel(View& view, Shown const& shown);
    void light_panel(View& view, Shown const& shown);
    /// Of what is drawn as a surface.
    void surface_light(View& view, Shown const& shown);
    Wish picture_panel(View& view, Shown const& shown);
    std::array<float, 2> free_column(Area const& picture) const;
    void slice_views(Shown const& shown);
    void help_window(Shown const& shown);

    bool log_values_ = false, log_opacity_ = false;
    int knot_ = -1, color_knot_ = -1, iso_ = -1, handle_ = -1; ///< that is being dragged
    int typed_knot_ = -1, picked_color_ = -1;                  ///< whose values are in a popup
    std::array<char, 512> file_{};
    std::string file_message_;
    std::vector<Area> floating_;
    std::array<float, 2> slices_in_{}; ///< the size of the picture that slices were laid out in
    std::vector<float> columns_;       ///< of the histogram
    ValueAxis columns_axis_;
    void const* columns_of_ = nullptr;
    struct Slice {
        std::vector<float> values;
        int width = 0, height = 0;
        double at = -1;
        void const* of = nullptr;
    };
    std::array<Slice, 3> slices_;
};

/// Every key and what it does, for the help and the manual.
std::vector<std::array<char const*, 2>> const& keys();

} // namespace vkt::shell::viewer
