// Small parts of panels, by Dear ImGui.
// SPDX-License-Identifier: MIT
#include "shell/viewer/window/widgets.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

namespace vkt::shell::viewer {

ImU32 color_of(render::Color const& c, float alpha) {
    return ImGui::ColorConvertFloat4ToU32(
        {static_cast<float>(c.red), static_cast<float>(c.green), static_cast<float>(c.blue), alpha});
}

bool input(char const* label, double& value, char const* format) {
    double v = value;
    bool const changed = ImGui::InputDouble(label, &v, 0, 0, format, ImGuiInputTextFlags_EnterReturnsTrue) ||
                         (ImGui::IsItemDeactivatedAfterEdit() && v != value);
    if (changed && std::isfinite(v)) value = v;
    return changed;
}

bool slider(char const* label, double& value, double least, double most, bool logarithmic, char const* format) {
    // Values of volumes may be beyond those of float, and sliders of Dear ImGui end at half of what their type holds.
    constexpr double end = std::numeric_limits<double>::max() / 2;
    double const from = std::clamp(least, -end, end), to = std::clamp(most, -end, end);
    return ImGui::SliderScalar(label, ImGuiDataType_Double, &value, &from, &to, format,
                               ImGuiSliderFlags_AlwaysClamp | (logarithmic ? ImGuiSliderFlags_Logarithmic : 0));
}

void tip(char const* words) {
    if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", words);
}

std::string short_number(double v) {
    std::array<char, 32> buffer{};
    std::snprintf(buffer.data(), buffer.size(), "%.4g", v);
    return buffer.data();
}

} // namespace vkt::shell::viewer
