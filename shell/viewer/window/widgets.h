// Small parts of panels: numbers to type and to drag, hints, colours.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/transfer.h"

#include <imgui.h>

#include <string>

namespace vkt::shell::viewer {

/// As Dear ImGui draws with it.
ImU32 color_of(render::Color const& c, float alpha = 1);
/// A number to type in; what is no number changes nothing.
bool input(char const* label, double& value, char const* format = "%.6g");
bool slider(char const* label, double& value, double least, double most, bool logarithmic = false,
            char const* format = "%.4g");
/// Said of the last item while the pointer is over it.
void tip(char const* words);
std::string short_number(double v);

} // namespace vkt::shell::viewer
