// A window that shows pictures of a volume: what it needs from a command, and how it is opened.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/render.h"
#include "shell/viewer/interaction.h"

#include <functional>
#include <stop_token>
#include <string>

namespace vkt::shell::viewer {

/// Who draws for the window. All is called on one worker thread, so that the window never waits.
class Scene {
public:
    virtual ~Scene() = default;
    /// What the title says: name and extent of what is shown.
    virtual std::string name() const = 0;
    virtual render::Image draw(render::RenderSettings const& settings, render::RenderReport& report,
                               std::stop_token const& stop) = 0;
    /// Writes a finished picture of the view and returns the name of its file.
    virtual std::string save(render::Image const& image, render::RenderReport const& report, View const& view) = 0;
    /// Goes on to the next volume of the input; false if there is none.
    virtual bool next() = 0;
};

/// Throws Error if no window can be opened here; the message says why and what to do instead.
void require_display();

/// Opens the window and returns when the user closes it. `note` prints one line. Throws Error if there is no window to
/// be had, and what the scene throws.
void show(Scene& scene, render::RenderSettings const& asked, render::Background const& background,
          std::function<void(std::string const&)> const& note);

} // namespace vkt::shell::viewer
