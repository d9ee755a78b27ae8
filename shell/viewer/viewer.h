// A window that shows pictures of a volume: what it needs from a command, and how it is opened.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/render.h"
#include "shell/viewer/interaction.h"

#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>

namespace vkt::shell::viewer {

/// A part of a volume that is still on its way, or has come to its end before all of it was here.
struct Arrival {
    std::int64_t slices = 0, of = 0; ///< that are here
    bool complete = true;            ///< no more will come
    std::string failure = {};        ///< why the rest does not come
};

/// Who draws for the window. All is called on one worker thread, so that the window never waits.
class Scene {
public:
    virtual ~Scene() = default;
    /// What the title says: name and extent of what is shown.
    virtual std::string name() const = 0;
    /// With an accumulation, paths are added to it (render::Renderer).
    virtual render::Image draw(render::RenderSettings const& settings, render::RenderReport& report,
                               std::stop_token const& stop, render::Accumulation* accumulation) = 0;
    /// Writes a finished picture of the view and returns the name of its file.
    virtual std::string save(render::Image const& image, render::RenderReport const& report, View const& view) = 0;
    /// The command line that draws the view without a window.
    virtual std::string command(View const&) { return {}; }
    /// Goes on to the next volume of the input; false if there is none. It may still be on its way then.
    virtual bool next() = 0;
    /// After the last one: goes on to the first one again; false if there is no other or it cannot be had once more.
    virtual bool first_again() { return false; }
    /// Goes back to the volume before; false if there is none or it cannot be had once more.
    virtual bool previous() { return false; }
    /// Looks how much of the volume is there and makes ready what has come; waits a moment for more.
    virtual Arrival arrive() { return {}; }
    /// What is shown, for values under the cursor, slices and histograms; null while nothing is there. It goes when the
    /// next volume is asked for.
    virtual std::shared_ptr<render::Renderer const> volume() { return nullptr; }
    /// Shows a part of the volume, in voxels or finest cells, resampled finer; an empty box: all of it again. Throws
    /// Error{resources} beyond the budget.
    virtual void magnify(Box const&) {}
};

/// Throws Error if no window can be opened here; the message says why and what to do instead.
void require_display();

/// Opens the window and returns when the user closes it. `note` prints one line. Throws Error if there is no window to
/// be had, and what the scene throws.
void show(Scene& scene, render::RenderSettings const& asked, render::Background const& background,
          std::function<void(std::string const&)> const& note);

/// What the module with GLFW and Dear ImGui exports.
struct WindowFunctions {
    void (*show)(Scene& scene, render::RenderSettings const& asked, render::Background const& background,
                 std::function<void(std::string const&)> const& note);
};

} // namespace vkt::shell::viewer
