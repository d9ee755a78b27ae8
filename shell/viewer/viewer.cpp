// Whether there is a display, and the module that shows a window on it.
// SPDX-License-Identifier: MIT
#include "shell/viewer/viewer.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/module.h"

#include <cstdlib>

#ifdef VKT_STATIC_WINDOW
extern "C" vkt::ModuleExport const vkt_module_window;
#endif

namespace vkt::shell::viewer {

namespace {

constexpr char const* instead = "vkt render -o FILE writes the picture";

[[maybe_unused]] bool set(char const* variable) {
    char const* const value = std::getenv(variable);
    return value != nullptr && *value != '\0';
}

} // namespace

#ifndef VKT_HAVE_VIEWER

void require_display() {
    throw Error(ErrorKind::usage, "no window: this vkt was built without the viewer (GLFW, Dear ImGui)", instead);
}

void show(Scene&, render::RenderSettings const&, render::Background const&,
          std::function<void(std::string const&)> const&) {
    require_display();
}

#else

void require_display() {
    if (set("DISPLAY") || set("WAYLAND_DISPLAY")) return;
    throw Error(ErrorKind::usage, "no window: there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set)",
                instead);
}

namespace {

/// Loaded when a window is opened: linked, every vkt process would need GLFW and pay for it.
WindowFunctions const& functions() {
#ifdef VKT_STATIC_WINDOW
    return *static_cast<WindowFunctions const*>(vkt_module_window.functions);
#else
    try {
        return *static_cast<WindowFunctions const*>(module_functions("window", "no window"));
    } catch (Error const& error) {
        throw Error(ErrorKind::resources,
                    text(error.what(), " (on Debian, windows need the packages libglfw3 and libstb0)"), instead);
    }
#endif
}

} // namespace

void show(Scene& scene, render::RenderSettings const& asked, render::Background const& background,
          std::function<void(std::string const&)> const& note) {
    require_display();
    functions().show(scene, asked, background, note);
}

#endif

} // namespace vkt::shell::viewer
