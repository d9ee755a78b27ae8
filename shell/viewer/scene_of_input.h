// The window on the volumes of an input, as they arrive.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/render.h"
#include "shell/command.h"

namespace vkt::shell::viewer {

/// Opens a window on the first volume and returns when the user closes it. Throws as show() does, and what the input
/// throws.
void show_input(Source& source, Context& context, render::RenderSettings const& asked,
                render::Background const& background);

} // namespace vkt::shell::viewer
