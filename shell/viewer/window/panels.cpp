// The panels beside the picture: integrator, surfaces, light, camera, clip box and planes; the keys.
// SPDX-License-Identifier: MIT
#include "shell/viewer/window/panels.h"
#include "shell/viewer/window/widgets.h"

#include "libvkt/core/text.h"
#include "libvkt/render/settings.h"

#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace vkt::shell::viewer {

using render::Algorithm;

std::vector<std::array<char const*, 2>> const& keys() {
    static std::vector<std::array<char const*, 2>> const all{
        {"left drag", "turn around the target"},
        {"right or shift drag", "move"},
        {"wheel, middle drag", "enlarge, reduce"},
        {"double click", "turn around the point under the pointer"},
        {"W A D, arrows", "fly ahead and to the sides (down: back)"},
        {"X Y Z", "from the side of an axis (shift: from the other)"},
        {"O", "with or without perspective"},
        {"1 ... 9", "camera that Ctrl+1 ... Ctrl+9 stored"},
        {"R, Home", "camera of the command line"},
        {"M I T", "ray marching, iso-surfaces, multiple scattering"},
        {"K", "greatest, least, mean along rays, in turn"},
        {"[ ]", "shorter, longer steps; fewer, more paths"},
        {"C", "next colour map"},
        {"Ctrl+Z, Ctrl+Y", "undo, redo"},
        {"B, then drag", "box around a part; Enter shows it finer"},
        {"Backspace", "the whole volume again"},
        {"L", "slices"},
        {"V", "colour bar, scale bar, axes"},
        {"G", "hide and show the panels"},
        {"S", "save the picture"},
        {"P", "print the command that draws it"},
        {"N, Space", "next volume"},
        {",", "the volume before"},
        {".", "play the volumes, stop"},
        {"H", "this help"},
        {"Q, Esc", "quit (Esc: first close what is open)"}};
    return all;
}

bool Panels::covers(double x, double y) const {
    if (ImGui::IsPopupOpen("", ImGuiPopupFlags_AnyPopupId | ImGuiPopupFlags_AnyPopupLevel)) return true;
    return std::any_of(floating_.begin(), floating_.end(), [&](Area const& a) { return a.contains(x, y); });
}

Wish Panels::draw(View& view, Shown const& shown, Area const& area) {
    ImGui::SetNextWindowPos({area.x, area.y});
    ImGui::SetNextWindowSize({area.width, area.height});
    ImGui::Begin("panels", nullptr,
                 (ImGuiWindowFlags_NoDecoration & ~ImGuiWindowFlags_NoScrollbar) | ImGuiWindowFlags_NoMove |
                     ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoBringToFrontOnFocus);
    ImGui::PushItemWidth(ImGui::GetContentRegionAvail().x * 0.6F);
    Wish wish = Wish::none;
    auto const take = [&](Wish other) {
        if (other != Wish::none) wish = other;
    };
    if (shown.frame == nullptr) {
        ImGui::TextDisabled("loading ...");
    } else {
        if (ImGui::CollapsingHeader("Transfer function", ImGuiTreeNodeFlags_DefaultOpen)) transfer_panel(view, shown);
        if (ImGui::CollapsingHeader("Integrator", ImGuiTreeNodeFlags_DefaultOpen)) algorithm_panel(view, shown);
        if (view.look.algorithm == Algorithm::implicit_iso &&
            ImGui::CollapsingHeader("Surfaces", ImGuiTreeNodeFlags_DefaultOpen))
            surfaces_panel(view, shown);
        if (!render::is_projection(view.look.algorithm) && ImGui::CollapsingHeader("Light")) light_panel(view, shown);
        if (ImGui::CollapsingHeader("Picture", ImGuiTreeNodeFlags_DefaultOpen)) take(picture_panel(view, shown));
        if (ImGui::CollapsingHeader("Camera")) take(camera_panel(view, shown));
        if (ImGui::CollapsingHeader("Clip box")) clip_panel(view, shown);
        if (ImGui::CollapsingHeader("Clip planes")) planes_panel(view, shown);
    }
    ImGui::PopItemWidth();
    ImGui::End();
    return wish;
}

void Panels::algorithm_panel(View& view, Shown const& shown) {
    Look& look = view.look;
    int which = static_cast<int>(look.algorithm);
    ImGui::RadioButton("march", &which, 0);
    ImGui::SameLine();
    ImGui::RadioButton("surfaces", &which, 1);
    ImGui::SameLine();
    ImGui::RadioButton("scatter", &which, 2);
    ImGui::RadioButton("greatest", &which, static_cast<int>(Algorithm::maximum));
    ImGui::SameLine();
    ImGui::RadioButton("least", &which, static_cast<int>(Algorithm::minimum));
    ImGui::SameLine();
    ImGui::RadioButton("mean", &which, static_cast<int>(Algorithm::mean));
    look.algorithm = static_cast<Algorithm>(which);
    if (look.algorithm == Algorithm::ray_marching) {
        ImGui::Checkbox("exact", &look.exact);
        if (!look.exact) slider("step", look.step, 1.0 / 16, 4, true, "%.3g voxels");
    }
    if (render::applies("shade", look.algorithm) && !(look.exact && look.algorithm == Algorithm::ray_marching)) {
        double shade = shown.frame->report.shade;
        if (slider("shading", shade, 0, 1, false, "%.2f")) look.shade = shade;
    }
    if (may_draw_labels(shown.asked, look)) {
        auto when = static_cast<int>(look.labels);
        if (ImGui::Combo("labels", &when, "where said\0always\0never\0"))
            draw_labels(look, static_cast<render::LabelMode>(when));
        tip("every value opaque and in a colour of its own: where the header says labels, always, or never");
    }
    if (look.algorithm == Algorithm::multi_scattering) {
        auto samples = static_cast<double>(look.samples);
        if (slider("paths a pixel", samples, 1, 4096, true, "%.0f"))
            look.samples = std::max(1, static_cast<int>(samples));
        slider("albedo", look.albedo, 0, 1, false, "%.2f");
        ImGui::Checkbox("emission", &look.emission);
        ImGui::ProgressBar(static_cast<float>(shown.frame->paths) / static_cast<float>(std::max(1, look.samples)),
                           {-1, 0}, text(shown.frame->paths, " of ", look.samples, " paths").c_str());
    }
}

void Panels::surfaces_panel(View& view, Shown const& shown) {
    std::vector<Surface> surfaces = editable_surfaces(view.look, shown.frame->report);
    std::vector<Surface> const before = surfaces;
    double least = 0, greatest = 1;
    if (shown.volume) least = shown.volume->histogram().least, greatest = shown.volume->histogram().greatest;
    std::optional<std::size_t> gone;
    for (std::size_t i = 0; i < surfaces.size(); ++i) {
        ImGui::PushID(static_cast<int>(i));
        Surface& s = surfaces[i];
        std::array<float, 3> rgb{static_cast<float>(s.color.red), static_cast<float>(s.color.green),
                                 static_cast<float>(s.color.blue)};
        if (ImGui::ColorEdit3("##color", rgb.data(), ImGuiColorEditFlags_NoInputs))
            s.color = {static_cast<double>(rgb[0]), static_cast<double>(rgb[1]), static_cast<double>(rgb[2])};
        ImGui::SameLine();
        slider("value", s.value, least, greatest);
        slider("opacity", s.opacity, 0, 1, false, "%.2f");
        if (surfaces.size() > 1) {
            ImGui::SameLine();
            if (ImGui::SmallButton("x")) gone = i;
        }
        ImGui::PopID();
    }
    if (gone) surfaces.erase(surfaces.begin() + static_cast<std::ptrdiff_t>(*gone));
    if (surfaces.size() < static_cast<std::size_t>(render::most_isos) && ImGui::SmallButton("add a surface")) {
        double const value =
            surfaces.empty() ? std::midpoint(least, greatest) : std::midpoint(surfaces.back().value, greatest);
        surfaces.push_back({value, {0.55, 0.7, 0.9}, 1});
        for (Surface& s : surfaces)
            if (&s != &surfaces.back() && s.opacity == 1) s.opacity = 0.4;
    }
    if (surfaces != before) view.look.surfaces = surfaces;
}

Wish Panels::picture_panel(View&, Shown const& shown) {
    Wish wish = Wish::none;
    auto const button = [&](char const* name, Wish what, bool enabled, char const* about) {
        if (!enabled) ImGui::BeginDisabled();
        if (ImGui::Button(name)) wish = what;
        if (!enabled) ImGui::EndDisabled();
        tip(about);
        ImGui::SameLine();
    };
    button("undo", Wish::undo, shown.can_undo, "Ctrl+Z");
    button("redo", Wish::redo, shown.can_redo, "Ctrl+Y");
    button("save", Wish::save, true, "the picture, in full quality (S)");
    button("command", Wish::command, true, "prints the command that draws it (P)");
    if (ImGui::Button("help")) help = !help;
    ImGui::Checkbox("slices", &slices);
    ImGui::SameLine();
    ImGui::Checkbox("scales", &overlays);
    ImGui::SameLine();
    if (ImGui::Button(choosing_box ? "drag a box ..." : "part")) choosing_box = !choosing_box;
    tip("draw a box around a part; Enter shows it resampled finer (B)");
    if (shown.magnified) {
        ImGui::SameLine();
        if (ImGui::Button("whole")) wish = Wish::whole;
    }
    render::RenderReport const& r = shown.frame->report;
    ImGui::TextDisabled("%d x %d, %s ms", shown.frame->width, shown.frame->height,
                        short_number(std::round(shown.frame->seconds * 1e3)).c_str());
    ImGui::TextWrapped("%s", r.method.c_str());
    for (std::string const& line : r.lossy) ImGui::TextColored({1, 0.7F, 0.4F, 1}, "%s", line.c_str());
    if (!shown.message.empty()) ImGui::TextWrapped("%s", shown.message.c_str());
    return wish;
}

Wish Panels::camera_panel(View& view, Shown const& shown) {
    Wish wish = Wish::none;
    render::Camera camera = view.camera.value_or(shown.frame->camera);
    bool changed = false;
    for (int axis = 0; axis < 3; ++axis)
        for (bool const behind : {false, true}) {
            if (axis + behind > 0) ImGui::SameLine();
            char const name[] = {behind ? '-' : '+', static_cast<char>('x' + axis), '\0'};
            if (ImGui::Button(name)) camera = axis_view(camera, axis, behind), changed = true;
        }
    ImGui::SameLine();
    if (ImGui::Button("reset")) wish = Wish::reset_camera;
    bool flat = camera.projection == render::Projection::orthographic;
    if (ImGui::Checkbox("orthographic", &flat)) {
        camera = projected(camera, flat ? render::Projection::orthographic : render::Projection::perspective);
        changed = true;
    }
    if (!flat) changed = slider("field of view", camera.fov, 5, 120, false, "%.0f degrees") || changed;
    for (std::size_t i = 0; i < stored.size(); ++i) {
        if (i > 0) ImGui::SameLine();
        bool const there = stored[i].has_value();
        if (!there) ImGui::PushStyleVar(ImGuiStyleVar_Alpha, 0.4F);
        if (ImGui::SmallButton(text(i + 1).c_str())) {
            if (ImGui::GetIO().KeyCtrl || !there)
                stored[i] = camera;
            else
                camera = *stored[i], changed = true;
        }
        if (!there) ImGui::PopStyleVar();
        tip(there ? "recall (Ctrl: store again)" : "store the camera");
    }
    if (changed) view.camera = camera;
    return wish;
}

void Panels::light_panel(View& view, Shown const& shown) {
    Look& look = view.look;
    bool const scattered = look.algorithm == Algorithm::multi_scattering;
    if (look.exact && look.algorithm == Algorithm::ray_marching) {
        ImGui::TextDisabled("exact pictures are not lit");
        return;
    }
    bool lamp = look.light_direction.has_value();
    if (ImGui::Checkbox("from a direction", &lamp)) {
        look.light_direction.reset();
        // To begin with from above, to the left of the camera.
        render::Camera const camera = view.camera.value_or(shown.frame->camera);
        Axes const axes = axes_of(camera);
        if (lamp) look.light_direction = direction_of(angles_of(axes.up - axes.forward - axes.right * 0.6));
        if (!lamp) look.shadows = false;
        if (lamp && look.ambient >= 1) look.ambient = render::RenderSettings().ambient; // or it would not be seen
    }
    tip(scattered ? "else from everywhere" : "else from the camera");
    if (lamp) {
        Angles angles = angles_of(*look.light_direction);
        bool turned = slider("azimuth", angles.azimuth, -180, 180, false, "%.0f degrees");
        turned = slider("elevation", angles.elevation, -89, 89, false, "%.0f degrees") || turned;
        if (turned) look.light_direction = direction_of(angles);
        if (!scattered) ImGui::Checkbox("shadows", &look.shadows);
    }
    if (lamp || !scattered) slider("from everywhere", look.ambient, 0, 1, false, "%.2f");
    if (shown.asked.environment) {
        slider("turned by", look.environment_rotation, -180, 180, false, "%.0f degrees");
        slider("strength", look.environment_strength, 0.01, 100, true, "%.3g");
    }
    if (!scattered) surface_light(view, shown);
    if (shown.asked.environment) return;
    ImGui::PushTextWrapPos(0); // panels are narrower
    ImGui::TextDisabled("the same from everywhere; --environment lights it by a picture");
    ImGui::PopTextWrapPos();
}

void Panels::surface_light(View& view, Shown const& shown) {
    Look& look = view.look;
    slider("highlight", look.specular, 0, 1, false, "%.2f");
    bool occluded = look.ambient_occlusion > 0;
    if (ImGui::Checkbox("ambient occlusion", &occluded)) look.ambient_occlusion = occluded ? 16 : 0;
    tip("what is nearby holds back the light from everywhere");
    if (occluded) {
        auto ways = static_cast<double>(look.ambient_occlusion);
        if (slider("directions", ways, 6, render::most_ways, false, "%.0f"))
            look.ambient_occlusion = std::clamp(static_cast<int>(ways), 6, render::most_ways);
        if (shown.volume) {
            double const all = diagonal_of(shown.volume->header());
            double radius = look.occlusion_radius > 0 ? look.occlusion_radius : all / 10;
            if (slider("radius", radius, 1e-3 * all, all, true))
                look.occlusion_radius = parse_double(short_number(radius)); // so that commands stay short
            tip("what is further away holds back nothing");
        }
    }
}

void Panels::planes_panel(View& view, Shown const& shown) {
    if (!shown.volume) return;
    Header const& header = shown.volume->header();
    std::vector<double> planes = view.look.clip_planes;
    std::optional<std::size_t> gone;
    for (std::size_t i = 0; i + 4 <= planes.size(); i += 4) {
        ImGui::PushID(static_cast<int>(i));
        double* const plane = &planes[i];
        Vec3 normal{plane[0], plane[1], plane[2]};
        Angles angles = angles_of(normal);
        bool turned = slider("azimuth", angles.azimuth, -180, 180, false, "%.0f degrees");
        turned = slider("elevation", angles.elevation, -90, 90, false, "%.0f degrees") || turned;
        if (turned) {
            // Around the middle of what it cuts.
            auto const [from, to] = plane_distances(normal, header);
            double const share = to > from ? (plane[3] - from) / (to - from) : 0.5;
            normal = direction_of(angles);
            auto const [least, greatest] = plane_distances(normal, header);
            plane[0] = normal.x, plane[1] = normal.y, plane[2] = normal.z;
            plane[3] = std::lerp(least, greatest, share);
        }
        auto const [least, greatest] = plane_distances(normal, header);
        slider("distance", plane[3], least, greatest);
        if (ImGui::SmallButton("other side"))
            for (int k = 0; k < 4; ++k) plane[k] = -plane[k];
        ImGui::SameLine();
        if (ImGui::SmallButton("x")) gone = i;
        ImGui::PopID();
    }
    if (gone) {
        auto const first = planes.begin() + static_cast<std::ptrdiff_t>(*gone);
        planes.erase(first, first + 4);
    }
    if (planes.size() < 4 * std::size_t{render::most_planes} && ImGui::SmallButton("add a plane")) {
        auto const plane = plane_facing(view.camera.value_or(shown.frame->camera), header);
        planes.insert(planes.end(), plane.begin(), plane.end());
    }
    view.look.clip_planes = std::move(planes);
}

void Panels::clip_panel(View& view, Shown const& shown) {
    if (!shown.volume) return;
    Index3 const dims = shown.volume->header().dims;
    Shares shares = clip_shares(view.look.clip, dims);
    bool changed = false;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        auto lower = static_cast<float>(shares[axis][0] * 100), upper = static_cast<float>(shares[axis][1] * 100);
        std::array<char const*, 3> const names{"x", "y", "z"};
        if (ImGui::DragFloatRange2(names[axis], &lower, &upper, 0.5F, 0, 100, "%.1f %%", nullptr,
                                   ImGuiSliderFlags_AlwaysClamp)) {
            shares[axis] = {static_cast<double>(lower) / 100, static_cast<double>(upper) / 100};
            changed = true;
        }
    }
    if (ImGui::SmallButton("all of it")) shares = {{{0, 1}, {0, 1}, {0, 1}}}, changed = true;
    if (!changed) return;
    // What is cut off is not to move the camera.
    if (!view.camera) view.camera = shown.frame->camera;
    view.look.clip = clip_text(shares, dims);
}

} // namespace vkt::shell::viewer
