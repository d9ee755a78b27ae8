// Panels with Dear ImGui: transfer function, integrator, surfaces, light, camera, clip box and planes, slices, help.
// SPDX-License-Identifier: MIT
#include "shell/viewer/window/panels.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/format.h"
#include "libvkt/io/byte_source.h"
#include "libvkt/io/output_file.h"

#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

namespace vkt::shell::viewer {

namespace {

using render::Algorithm;
using render::Color;

constexpr float knot_reach = 9;

ImU32 color_of(Color const& c, float alpha = 1) {
    return ImGui::ColorConvertFloat4ToU32(
        {static_cast<float>(c.red), static_cast<float>(c.green), static_cast<float>(c.blue), alpha});
}

bool input(char const* label, double& value, char const* format = "%.6g") {
    double v = value;
    bool const changed = ImGui::InputDouble(label, &v, 0, 0, format, ImGuiInputTextFlags_EnterReturnsTrue) ||
                         (ImGui::IsItemDeactivatedAfterEdit() && v != value);
    if (changed && std::isfinite(v)) value = v;
    return changed;
}

bool slider(char const* label, double& value, double least, double most, bool logarithmic = false,
            char const* format = "%.4g") {
    auto v = static_cast<float>(value);
    bool const changed = ImGui::SliderFloat(label, &v, static_cast<float>(least), static_cast<float>(most), format,
                                            (logarithmic ? ImGuiSliderFlags_Logarithmic : 0));
    if (changed) value = static_cast<double>(v);
    return changed;
}

void tip(char const* words) {
    if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", words);
}

std::string short_number(double v) {
    std::array<char, 32> buffer{};
    std::snprintf(buffer.data(), buffer.size(), "%.4g", v);
    return buffer.data();
}

void combo_of_maps(TransferEdit& edit, bool& changed) {
    std::string const name = edit.colors.empty() ? edit.colormap : "own colours";
    if (!ImGui::BeginCombo("map", name.c_str(), ImGuiComboFlags_HeightLargest)) return;
    bool const reversed = edit.colormap.ends_with(":reverse");
    for (std::string const& map : render::colormap_names()) {
        ImVec2 const at = ImGui::GetCursorScreenPos();
        std::string const full = reversed ? map + ":reverse" : map;
        if (ImGui::Selectable(("          " + map).c_str(), edit.colors.empty() && edit.colormap == full)) {
            edit.colormap = full;
            edit.colors.clear();
            changed = true;
        }
        float const width = ImGui::CalcTextSize("         ").x, height = ImGui::GetTextLineHeight();
        for (int i = 0; i < 24; ++i)
            ImGui::GetWindowDrawList()->AddRectFilled(
                {at.x + width * static_cast<float>(i) / 24, at.y + 1},
                {at.x + width * static_cast<float>(i + 1) / 24, at.y + height - 1},
                color_of(render::colormap(full, (i + 0.5) / 24)));
    }
    ImGui::EndCombo();
}

} // namespace

std::vector<std::array<char const*, 2>> const& keys() {
    static std::vector<std::array<char const*, 2>> const all{
        {"left drag", "turn around the target"},
        {"right or shift drag", "move"},
        {"wheel, middle drag", "enlarge, reduce"},
        {"double click", "turn around the point under the pointer"},
        {"W A S D, arrows", "fly"},
        {"X Y Z", "from the side of an axis (shift: from the other)"},
        {"O", "with or without perspective"},
        {"1 ... 9", "camera that Ctrl+1 ... Ctrl+9 stored"},
        {"R, Home", "camera of the command line"},
        {"M I T", "ray marching, iso-surfaces, multiple scattering"},
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
        {"H", "this help"},
        {"Q, Esc", "quit"}};
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

void Panels::transfer_panel(View& view, Shown const& shown) {
    if (shown.frame->report.transfer.points.empty()) return;
    TransferEdit edit = editable_transfer(shown.asked, view.look, shown.frame->report);
    bool changed = false;
    histogram_canvas(view, shown, edit, changed);
    color_strip(shown, edit, changed);
    combo_of_maps(edit, changed);
    ImGui::SameLine();
    bool reversed = edit.colormap.ends_with(":reverse");
    if (ImGui::SmallButton("flip")) {
        reversed = !reversed;
        edit.colormap = reversed ? edit.colormap + ":reverse" : edit.colormap.substr(0, edit.colormap.rfind(':'));
        if (!edit.colors.empty()) {
            std::vector<ColorKnot> turned;
            for (auto c = edit.colors.rbegin(); c != edit.colors.rend(); ++c)
                turned.push_back({edit.lower + edit.upper - c->value, c->color});
            edit.colors = std::move(turned);
        }
        changed = true;
    }
    double lower = edit.lower, upper = edit.upper;
    float const half = ImGui::GetContentRegionAvail().x * 0.29F;
    ImGui::SetNextItemWidth(half);
    bool typed = input("##lower", lower);
    ImGui::SameLine();
    ImGui::SetNextItemWidth(half);
    typed = input("domain", upper) || typed;
    if (typed) {
        set_domain(edit, lower, upper, false);
        changed = true;
    }
    if (edit.lower > 0 || edit.logarithmic) {
        if (ImGui::Checkbox("colours over log(value)", &edit.logarithmic)) changed = true;
    }
    if (ImGui::BeginCombo("preset", "choose ...", ImGuiComboFlags_HeightLargest)) {
        if (ImGui::Selectable("automatic")) {
            view.look.transfer.reset();
            view.look.colormap = shown.asked.colormap;
            view.look.shade = shown.asked.exact ? -1 : shown.asked.shade;
            changed = false;
        }
        if (shown.volume)
            for (std::string const& name : preset_names())
                if (ImGui::Selectable(name.c_str())) {
                    edit = preset(name, shown.volume->histogram(), edit);
                    changed = true;
                }
        ImGui::EndCombo();
    }
    if (view.look.algorithm != Algorithm::implicit_iso) {
        slider("opacity", view.look.opacity_scale, 0.01, 100, true, "x %.3g");
        tip("multiplies all extinctions (--opacity-scale)");
        double unit = shown.frame->report.unit;
        if (input("unit distance", unit) && unit > 0) view.look.unit = to_text(unit);
        tip("world length that opacities hold for (--unit-distance)");
    }
    ImGui::Checkbox("log values", &log_values_);
    ImGui::SameLine();
    ImGui::Checkbox("log opacity", &log_opacity_);
    if (ImGui::TreeNode("Files")) {
        ImGui::InputTextWithHint("file", "transfer.json", file_.data(), file_.size());
        std::string const name = file_[0] != '\0' ? std::string(file_.data()) : "transfer.json";
        auto const attempt = [&](auto const& body) {
            try {
                body();
            } catch (Error const& error) {
                file_message_ = error.what();
            }
        };
        auto const write = [&](std::string const& content) {
            attempt([&] {
                OutputFile file(name, true);
                file.write(content.data(), content.size());
                file.commit();
                file_message_ = "wrote " + name;
            });
        };
        render::TransferFunction function = function_of(edit);
        function.unit = shown.frame->report.unit;
        if (ImGui::Button("load"))
            attempt([&] {
                auto const bytes = open_bytes(name);
                std::string content(std::size_t{16} << 20, '\0');
                std::size_t size = 0;
                while (std::size_t const n = bytes->read(content.data() + size, content.size() - size)) size += n;
                content.resize(size);
                render::TransferFunction const read = render::transfer_from_json(content);
                edit = edit_of(read, "");
                if (read.unit > 0) view.look.unit = to_text(read.unit);
                changed = true;
                file_message_ = "read " + name;
            });
        ImGui::SameLine();
        if (ImGui::Button("save")) write(render::transfer_to_json(function) + "\n");
        ImGui::SameLine();
        if (ImGui::Button("save for ParaView")) write(render::transfer_to_paraview(function, "vkt"));
        if (!file_message_.empty()) ImGui::TextWrapped("%s", file_message_.c_str());
        ImGui::TreePop();
    }
    if (!changed) return;
    // The light stays what it was, where only the renderer's own functions are lit by themselves.
    if (!view.look.transfer && view.look.shade < 0) view.look.shade = shown.frame->report.shade;
    view.look.transfer = edit;
}

void Panels::histogram_canvas(View& view, Shown const& shown, TransferEdit& edit, bool& changed) {
    render::Histogram const* const histogram = shown.volume ? &shown.volume->histogram() : nullptr;
    ValueAxis axis{edit.lower, edit.upper, log_values_};
    if (histogram != nullptr) {
        axis.lower = std::min(histogram->least, edit.lower), axis.upper = std::max(histogram->greatest, edit.upper);
        if (log_values_ && !(axis.lower > 0)) axis.lower = std::max(axis.upper * 1e-5, 1e-300);
    }
    if (!(axis.lower < axis.upper)) axis.upper = axis.lower + 1;
    OpacityAxis const opacity{log_opacity_};
    ImVec2 const size{ImGui::GetContentRegionAvail().x, ImGui::GetTextLineHeight() * 9};
    ImVec2 const at = ImGui::GetCursorScreenPos();
    ImGui::InvisibleButton("histogram", size, ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight);
    bool const hovered = ImGui::IsItemHovered();
    ImDrawList& list = *ImGui::GetWindowDrawList();
    list.AddRectFilled(at, {at.x + size.x, at.y + size.y}, IM_COL32(18, 19, 23, 255), 3);
    auto const x_of = [&](double value) {
        return at.x + size.x * static_cast<float>(std::clamp(axis.place(value), -1.0, 2.0));
    };
    auto const y_of = [&](double alpha) {
        return at.y + (size.y - 4) * static_cast<float>(1 - opacity.place(alpha)) + 2;
    };
    auto const columns = static_cast<std::size_t>(std::max(16.0F, size.x));
    if (histogram != nullptr &&
        (columns_of_ != histogram || columns_.size() != columns || columns_axis_.lower != axis.lower ||
         columns_axis_.upper != axis.upper || columns_axis_.logarithmic != axis.logarithmic)) {
        columns_ = log_columns(*histogram, axis, columns);
        columns_of_ = histogram, columns_axis_ = axis;
    }
    list.PushClipRect(at, {at.x + size.x, at.y + size.y}, true);
    for (std::size_t i = 0; i < columns_.size(); ++i) {
        float const x = at.x + static_cast<float>(i);
        double const value = axis.value((static_cast<double>(i) + 0.5) / static_cast<double>(columns));
        Color const c = color_at(edit, value);
        Color const dim{0.12 + 0.4 * c.red, 0.12 + 0.4 * c.green, 0.12 + 0.4 * c.blue};
        if (columns_[i] > 0)
            list.AddRectFilled({x, at.y + size.y * (1 - 0.94F * columns_[i])}, {x + 1, at.y + size.y}, color_of(dim));
    }
    bool const surfaces = view.look.algorithm == Algorithm::implicit_iso;
    // The line as the renderer has it: straight in extinction between knots.
    std::vector<ImVec2> line;
    for (std::size_t i = 0; i < columns; i += 2) {
        double const value = axis.value(static_cast<double>(i) / static_cast<double>(columns));
        line.push_back({at.x + static_cast<float>(i), y_of(alpha_at(edit, value))});
    }
    for (OpacityKnot const& k : edit.knots) line.push_back({x_of(k.value), y_of(k.alpha)});
    std::stable_sort(line.begin(), line.end(), [](ImVec2 const& a, ImVec2 const& b) { return a.x < b.x; });
    ImU32 const bright = surfaces ? IM_COL32(255, 255, 255, 70) : IM_COL32(255, 255, 255, 230);
    list.AddPolyline(line.data(), static_cast<int>(line.size()), bright, 0, 1.6F);
    ImVec2 const mouse = ImGui::GetIO().MousePos;
    std::vector<Surface> isos = surfaces ? editable_surfaces(view.look, shown.frame->report) : std::vector<Surface>{};
    int near = -1, near_iso = -1;
    float best = knot_reach;
    for (std::size_t i = 0; !surfaces && i < edit.knots.size(); ++i) {
        ImVec2 const p{x_of(edit.knots[i].value), y_of(edit.knots[i].alpha)};
        float const d = std::hypot(p.x - mouse.x, p.y - mouse.y);
        if (d < best) best = d, near = static_cast<int>(i);
    }
    for (std::size_t i = 0; i < isos.size(); ++i)
        if (std::abs(x_of(isos[i].value) - mouse.x) < best) near_iso = static_cast<int>(i);
    for (std::size_t i = 0; !surfaces && i < edit.knots.size(); ++i) {
        ImVec2 const p{x_of(edit.knots[i].value), y_of(edit.knots[i].alpha)};
        bool const hot = static_cast<int>(i) == (knot_ >= 0 ? knot_ : hovered ? near : -1);
        list.AddCircleFilled(p, hot ? 6.5F : 5.0F, color_of(color_at(edit, edit.knots[i].value)));
        list.AddCircle(p, hot ? 6.5F : 5.0F, hot ? IM_COL32(255, 220, 90, 255) : IM_COL32(255, 255, 255, 255), 16,
                       1.5F);
    }
    for (std::size_t i = 0; i < isos.size(); ++i) {
        float const x = x_of(isos[i].value);
        list.AddLine({x, at.y}, {x, at.y + size.y}, color_of(isos[i].color), 2);
        list.AddTriangleFilled({x - 6, at.y}, {x + 6, at.y}, {x, at.y + 9}, color_of(isos[i].color));
    }
    list.PopClipRect();

    double const value = axis.value(std::clamp((mouse.x - at.x) / size.x, 0.0F, 1.0F));
    double const alpha = opacity.alpha(1 - (mouse.y - at.y - 2) / (size.y - 4));
    ImGuiIO const& io = ImGui::GetIO();
    if (hovered && ImGui::IsMouseClicked(ImGuiMouseButton_Left)) {
        if (surfaces) {
            iso_ = near_iso;
            if (iso_ < 0 && isos.size() < static_cast<std::size_t>(render::most_isos)) {
                isos.push_back({value, color_at(edit, value), isos.empty() ? 1.0 : isos.back().opacity});
                iso_ = static_cast<int>(isos.size()) - 1;
                view.look.surfaces = isos;
            }
        } else if (near >= 0 && io.KeyCtrl) {
            remove_knot(edit, static_cast<std::size_t>(near));
            changed = true;
        } else if (near >= 0 && ImGui::IsMouseDoubleClicked(ImGuiMouseButton_Left)) {
            typed_knot_ = near;
            ImGui::OpenPopup("typed");
        } else {
            knot_ = near >= 0 ? near : static_cast<int>(add_knot(edit, {value, alpha}));
            changed = changed || near < 0;
        }
    }
    if (hovered && ImGui::IsMouseClicked(ImGuiMouseButton_Right)) {
        if (surfaces && near_iso >= 0 && isos.size() > 1) {
            isos.erase(isos.begin() + near_iso);
            view.look.surfaces = isos;
        } else if (!surfaces && near >= 0) {
            remove_knot(edit, static_cast<std::size_t>(near));
            changed = true;
        }
    }
    if (!ImGui::IsMouseDown(ImGuiMouseButton_Left)) knot_ = iso_ = -1;
    bool const moved = io.MouseDelta.x != 0 || io.MouseDelta.y != 0;
    if (knot_ >= 0 && static_cast<std::size_t>(knot_) < edit.knots.size() && moved) {
        auto const i = static_cast<std::size_t>(knot_);
        move_knot(edit, i, {io.KeyShift ? edit.knots[i].value : value, alpha});
        changed = true;
    }
    if (iso_ >= 0 && static_cast<std::size_t>(iso_) < isos.size() && moved) {
        isos[static_cast<std::size_t>(iso_)].value = value;
        view.look.surfaces = isos;
    }
    if (hovered && near < 0 && knot_ < 0 && iso_ < 0)
        ImGui::SetTooltip("value %s\n%s", short_number(value).c_str(),
                          surfaces ? "click: a surface here; right click on one removes it"
                                   : "click: a knot here; right click on one removes it, double click types");
    if (knot_ >= 0 || (hovered && near >= 0)) {
        auto const i = static_cast<std::size_t>(knot_ >= 0 ? knot_ : near);
        if (i < edit.knots.size())
            ImGui::SetTooltip("value %s, opacity %s", short_number(edit.knots[i].value).c_str(),
                              short_number(edit.knots[i].alpha).c_str());
    }
    if (ImGui::BeginPopup("typed")) {
        if (typed_knot_ >= 0 && static_cast<std::size_t>(typed_knot_) < edit.knots.size()) {
            OpacityKnot knot = edit.knots[static_cast<std::size_t>(typed_knot_)];
            bool const first = input("value", knot.value), second = input("opacity", knot.alpha);
            if (first || second) {
                move_knot(edit, static_cast<std::size_t>(typed_knot_), knot);
                changed = true;
            }
        }
        ImGui::EndPopup();
    }
    ImGui::TextDisabled("%s", short_number(axis.lower).c_str());
    std::string const end = short_number(axis.upper);
    ImGui::SameLine(size.x - ImGui::CalcTextSize(end.c_str()).x + ImGui::GetStyle().WindowPadding.x);
    ImGui::TextDisabled("%s", end.c_str());
}

void Panels::color_strip(Shown const& shown, TransferEdit& edit, bool& changed) {
    ValueAxis axis{edit.lower, edit.upper, log_values_};
    if (shown.volume) axis = columns_axis_;
    ImVec2 const size{ImGui::GetContentRegionAvail().x, ImGui::GetTextLineHeight() * 1.5F};
    ImVec2 const at = ImGui::GetCursorScreenPos();
    ImGui::InvisibleButton("strip", size, ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight);
    bool const hovered = ImGui::IsItemHovered();
    ImDrawList& list = *ImGui::GetWindowDrawList();
    int const parts = static_cast<int>(size.x / 2);
    for (int i = 0; i < parts; ++i)
        list.AddRectFilled({at.x + size.x * static_cast<float>(i) / static_cast<float>(parts), at.y},
                           {at.x + size.x * static_cast<float>(i + 1) / static_cast<float>(parts), at.y + size.y - 8},
                           color_of(color_at(edit, axis.value((i + 0.5) / parts))));
    auto const x_of = [&](double value) {
        return at.x + size.x * static_cast<float>(std::clamp(axis.place(value), 0.0, 1.0));
    };
    ImVec2 const mouse = ImGui::GetIO().MousePos;
    double const value = axis.value(std::clamp((mouse.x - at.x) / size.x, 0.0F, 1.0F));
    // Handles of the domain hang below the strip, own colours are rings in it.
    for (double const end : {edit.lower, edit.upper}) {
        float const x = x_of(end);
        list.AddTriangleFilled({x, at.y + size.y - 9}, {x - 6, at.y + size.y}, {x + 6, at.y + size.y},
                               IM_COL32(255, 220, 90, 255));
    }
    int near = -1;
    for (std::size_t i = 0; i < edit.colors.size(); ++i) {
        ImVec2 const p{x_of(edit.colors[i].value), at.y + (size.y - 8) / 2};
        list.AddCircleFilled(p, 5, color_of(edit.colors[i].color));
        list.AddCircle(p, 5, IM_COL32(255, 255, 255, 255), 16, 1.5F);
        if (std::hypot(p.x - mouse.x, p.y - mouse.y) < knot_reach) near = static_cast<int>(i);
    }
    bool const low = mouse.y > at.y + size.y - 9;
    if (hovered && ImGui::IsMouseClicked(ImGuiMouseButton_Left)) {
        float const to_lower = std::abs(x_of(edit.lower) - mouse.x), to_upper = std::abs(x_of(edit.upper) - mouse.x);
        if (low && std::min(to_lower, to_upper) < 2 * knot_reach) {
            handle_ = to_lower < to_upper ? 0 : 1;
        } else if (near >= 0 && ImGui::IsMouseDoubleClicked(ImGuiMouseButton_Left)) {
            picked_color_ = near;
            ImGui::OpenPopup("picked");
        } else if (near >= 0) {
            color_knot_ = near;
        } else if (ImGui::IsMouseDoubleClicked(ImGuiMouseButton_Left)) {
            color_knot_ = picked_color_ = static_cast<int>(add_color(edit, value));
            changed = true;
            ImGui::OpenPopup("picked");
        }
    }
    if (hovered && near >= 0 && ImGui::IsMouseClicked(ImGuiMouseButton_Right)) {
        remove_color(edit, static_cast<std::size_t>(near));
        changed = true;
    }
    if (!ImGui::IsMouseDown(ImGuiMouseButton_Left)) handle_ = color_knot_ = -1;
    ImGuiIO const& io = ImGui::GetIO();
    if (handle_ >= 0 && io.MouseDelta.x != 0) {
        set_domain(edit, handle_ == 0 ? value : edit.lower, handle_ == 1 ? value : edit.upper, io.KeyShift);
        changed = true;
    }
    if (color_knot_ >= 0 && static_cast<std::size_t>(color_knot_) < edit.colors.size() && io.MouseDelta.x != 0) {
        move_color(edit, static_cast<std::size_t>(color_knot_), value);
        changed = true;
    }
    if (hovered && handle_ < 0 && color_knot_ < 0)
        ImGui::SetTooltip("%s", low ? "drag the ends of the domain; shift takes the knots along"
                                    : "double click: a colour of your own here; right click removes one");
    if (ImGui::BeginPopup("picked")) {
        if (picked_color_ >= 0 && static_cast<std::size_t>(picked_color_) < edit.colors.size()) {
            Color& c = edit.colors[static_cast<std::size_t>(picked_color_)].color;
            std::array<float, 3> rgb{static_cast<float>(c.red), static_cast<float>(c.green),
                                     static_cast<float>(c.blue)};
            if (ImGui::ColorPicker3("##color", rgb.data(), ImGuiColorEditFlags_PickerHueWheel)) {
                c = {static_cast<double>(rgb[0]), static_cast<double>(rgb[1]), static_cast<double>(rgb[2])};
                changed = true;
            }
        }
        ImGui::EndPopup();
    }
}

void Panels::algorithm_panel(View& view, Shown const& shown) {
    Look& look = view.look;
    bool const tree = shown.volume && shown.volume->header().kind == Kind::hierarchical;
    int which = static_cast<int>(look.algorithm);
    if (tree) {
        ImGui::TextDisabled("ray marching (of a hierarchical volume)");
    } else {
        ImGui::RadioButton("march", &which, 0);
        ImGui::SameLine();
        ImGui::RadioButton("surfaces", &which, 1);
        ImGui::SameLine();
        ImGui::RadioButton("scatter", &which, 2);
        look.algorithm = static_cast<Algorithm>(which);
    }
    if (look.algorithm == Algorithm::ray_marching) {
        if (!tree) ImGui::Checkbox("exact", &look.exact);
        if (!look.exact) slider("step", look.step, 1.0 / 16, 4, true, "%.3g voxels");
    }
    if (look.algorithm != Algorithm::multi_scattering && !(look.exact && look.algorithm == Algorithm::ray_marching)) {
        double shade = shown.frame->report.shade;
        if (slider("shading", shade, 0, 1, false, "%.2f")) look.shade = shade;
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
    if (look.algorithm == Algorithm::multi_scattering) {
        if (!shown.asked.environment) {
            ImGui::TextDisabled("the same from all around; --environment lights it by a picture");
            return;
        }
        slider("turned by", look.environment_rotation, -180, 180, false, "%.0f degrees");
        slider("strength", look.environment_strength, 0.01, 100, true, "%.3g");
        return;
    }
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
    }
    tip("else from the camera");
    if (lamp) {
        Angles angles = angles_of(*look.light_direction);
        bool turned = slider("azimuth", angles.azimuth, -180, 180, false, "%.0f degrees");
        turned = slider("elevation", angles.elevation, -89, 89, false, "%.0f degrees") || turned;
        if (turned) look.light_direction = direction_of(angles);
        ImGui::Checkbox("shadows", &look.shadows);
    }
    slider("from everywhere", look.ambient, 0, 1, false, "%.2f");
    slider("highlight", look.specular, 0, 1, false, "%.2f");
    bool occluded = look.ambient_occlusion > 0;
    if (ImGui::Checkbox("ambient occlusion", &occluded)) look.ambient_occlusion = occluded ? 16 : 0;
    tip("what is nearby holds back the light from everywhere");
    if (occluded) {
        auto ways = static_cast<double>(look.ambient_occlusion);
        if (slider("directions", ways, 6, render::most_ways, false, "%.0f"))
            look.ambient_occlusion = std::clamp(static_cast<int>(ways), 6, render::most_ways);
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

namespace {

/// White words with a dark rim: readable on anything.
void label(ImDrawList& list, ImVec2 at, std::string const& words) {
    for (auto const& [dx, dy] : {std::pair{-1.0F, 0.0F}, {1.0F, 0.0F}, {0.0F, -1.0F}, {0.0F, 1.0F}})
        list.AddText({at.x + dx, at.y + dy}, IM_COL32(0, 0, 0, 200), words.c_str());
    list.AddText(at, IM_COL32(255, 255, 255, 255), words.c_str());
}

} // namespace

Wish Panels::draw_over_picture(View& view, Shown const& shown) {
    floating_.clear();
    Area const& p = shown.picture;
    ImDrawList& list = *ImGui::GetBackgroundDrawList();
    if (box) {
        auto const& b = *box;
        auto const corner = [&](double x, double y) {
            return ImVec2{p.x + p.width * static_cast<float>(x), p.y + p.height * static_cast<float>(y)};
        };
        list.AddRect(corner(b[0], b[1]), corner(b[2], b[3]), IM_COL32(255, 220, 90, 255), 0, 0, 2);
        label(list, {corner(std::min(b[0], b[2]), 0).x, corner(0, std::max(b[1], b[3])).y + 3},
              "Enter shows this part finer");
    }
    if (shown.frame == nullptr) return Wish::none;
    float const line = ImGui::GetTextLineHeight();
    if (!shown.frame->arrival.complete)
        label(list, {p.x + 10, p.y + 8},
              text(shown.frame->arrival.slices, " of ", shown.frame->arrival.of, " slices are here"));
    if (overlays && p.width > 200 && p.height > 160) {
        render::Camera const& camera = shown.frame->camera;
        // Colours, from below.
        if (!shown.frame->report.transfer.points.empty()) {
            TransferEdit const edit = editable_transfer(shown.asked, view.look, shown.frame->report);
            ValueAxis const axis{edit.lower, edit.upper, edit.logarithmic};
            float const height = std::min(0.5F * p.height, 240.0F), x = p.x + 14, y = p.y + (p.height - height) / 2;
            for (int i = 0; i < 64; ++i)
                list.AddRectFilled({x, y + height * static_cast<float>(63 - i) / 64},
                                   {x + 14, y + height * static_cast<float>(64 - i) / 64},
                                   color_of(color_at(edit, axis.value((i + 0.5) / 64))));
            list.AddRect({x, y}, {x + 14, y + height}, IM_COL32(255, 255, 255, 160));
            for (double const share : {0.0, 0.5, 1.0})
                label(list, {x + 20, y + height * static_cast<float>(1 - share) - line / 2},
                      short_number(axis.value(share)));
        }
        // A length in the world, at the distance of the target.
        double const span = span_of(camera), per_point = span / static_cast<double>(p.height);
        double const length = round_length(0.25 * span * static_cast<double>(p.width) / static_cast<double>(p.height));
        if (length > 0) {
            auto const points = static_cast<float>(length / per_point);
            float const x = p.x + (p.width - points) / 2, y = p.y + p.height - 16;
            list.AddRectFilled({x - 1, y - 2}, {x + points + 1, y + 3}, IM_COL32(0, 0, 0, 160));
            list.AddRectFilled({x, y - 1}, {x + points, y + 2}, IM_COL32(255, 255, 255, 255));
            std::string const words = short_number(length);
            label(list, {x + (points - ImGui::CalcTextSize(words.c_str()).x) / 2, y - 6 - line}, words);
        }
        // Where the axes of the world point.
        auto const [right, up, forward] = axes_of(camera);
        ImVec2 const centre{p.x + p.width - 52, p.y + p.height - 52};
        std::array<std::pair<double, int>, 3> order;
        for (int axis = 0; axis < 3; ++axis) order[static_cast<std::size_t>(axis)] = {-forward[axis], axis};
        std::sort(order.begin(), order.end()); // those that point away first
        std::array<ImU32, 3> const colors{IM_COL32(235, 85, 75, 255), IM_COL32(95, 200, 90, 255),
                                          IM_COL32(85, 145, 250, 255)};
        for (auto const& [depth, axis] : order) {
            ImVec2 const end{centre.x + 34 * static_cast<float>(right[axis]),
                             centre.y - 34 * static_cast<float>(up[axis])};
            list.AddLine(centre, end, colors[static_cast<std::size_t>(axis)], 3);
            char const name[] = {static_cast<char>('x' + axis), '\0'};
            label(
                list,
                {end.x + 4 * static_cast<float>(right[axis]) - 3, end.y - 4 * static_cast<float>(up[axis]) - line / 2},
                name);
        }
    }
    if (slices) slice_views(view, shown);
    if (help) help_window(shown);
    return Wish::none;
}

void Panels::slice_views(View& view, Shown const& shown) {
    if (!shown.volume || shown.frame->report.transfer.points.empty()) return;
    render::Renderer const& volume = *shown.volume;
    Index3 const dims = volume.header().dims;
    Geometry const& g = volume.header().geometry;
    Area const& p = shown.picture;
    float const width = std::min(p.width - 16, 3 * 240.0F), height = width / 3 + 2 * ImGui::GetTextLineHeight() + 8;
    ImGui::SetNextWindowPos({p.x + 8, p.y + p.height - height - 8}, ImGuiCond_Appearing);
    ImGui::SetNextWindowSize({width, height}, ImGuiCond_Appearing);
    ImGui::SetNextWindowBgAlpha(0.92F);
    if (ImGui::Begin("Slices", &slices, ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoScrollbar)) {
        TransferEdit const edit = editable_transfer(shown.asked, view.look, shown.frame->report);
        double const grey_lower = volume.histogram().percentile(0.005),
                     grey_upper = volume.histogram().percentile(0.999);
        ValueAxis const grey{grey_lower, grey_upper > grey_lower ? grey_upper : grey_lower + 1, false};
        bool const tree = volume.header().kind == Kind::hierarchical;
        ImVec2 const room = ImGui::GetContentRegionAvail();
        float const each = (room.x - 2 * 6) / 3, tall = std::max(24.0F, room.y - ImGui::GetTextLineHeight() - 6);
        ImVec2 const start = ImGui::GetCursorScreenPos();
        ImDrawList& list = *ImGui::GetWindowDrawList();
        double value = std::nan("");
        for (std::size_t axis = 0; axis < 3; ++axis) {
            // Across and down: the other two axes, as they come.
            int const a = axis == 0 ? 1 : 0, b = axis == 2 ? 1 : 2;
            double const wide = g.spacing[a] * static_cast<double>(dims[a]),
                         high = g.spacing[b] * static_cast<double>(dims[b]);
            float const scale = std::min(each / static_cast<float>(wide), tall / static_cast<float>(high));
            ImVec2 const size{std::max(4.0F, scale * static_cast<float>(wide)),
                              std::max(4.0F, scale * static_cast<float>(high))};
            ImVec2 const at{start.x + static_cast<float>(axis) * (each + 6) + (each - size.x) / 2,
                            start.y + (tall - size.y) / 2};
            int const cells = tree ? 64 : 160;
            int const nx =
                std::clamp(static_cast<int>(std::min<std::int64_t>(dims[a], cells)), 1, static_cast<int>(size.x) + 1);
            int const ny =
                std::clamp(static_cast<int>(std::min<std::int64_t>(dims[b], cells)), 1, static_cast<int>(size.y) + 1);
            Slice& slice = slices_[axis];
            double const place = crosshair[axis] * static_cast<double>(dims[static_cast<int>(axis)]) - 0.5;
            if (slice.of != &volume || slice.at != place || slice.width != nx || slice.height != ny) {
                slice = {std::vector<float>(static_cast<std::size_t>(nx * ny)), nx, ny, place, &volume};
                for (int j = 0; j < ny; ++j)
                    for (int i = 0; i < nx; ++i) {
                        Vec3 index{0, 0, 0};
                        index[static_cast<int>(axis)] = place;
                        index[a] = (i + 0.5) / nx * static_cast<double>(dims[a]) - 0.5;
                        index[b] = (1 - (j + 0.5) / ny) * static_cast<double>(dims[b]) - 0.5; // upwards
                        slice.values[static_cast<std::size_t>(j * nx + i)] = static_cast<float>(volume.value_at(index));
                    }
            }
            for (int j = 0; j < ny; ++j)
                for (int i = 0; i < nx;) {
                    auto const shade_at = [&](int k) {
                        float const v = slice.values[static_cast<std::size_t>(j * nx + k)];
                        return std::isnan(v)
                                   ? -1
                                   : static_cast<int>(255 * std::clamp(grey.place(static_cast<double>(v)), 0.0, 1.0));
                    };
                    int const shade = shade_at(i);
                    int end = i + 1;
                    while (end < nx && shade_at(end) == shade) ++end;
                    ImU32 const c = shade < 0 ? IM_COL32(40, 20, 30, 255) : IM_COL32(shade, shade, shade, 255);
                    list.AddRectFilled({at.x + size.x * static_cast<float>(i) / static_cast<float>(nx),
                                        at.y + size.y * static_cast<float>(j) / static_cast<float>(ny)},
                                       {at.x + size.x * static_cast<float>(end) / static_cast<float>(nx),
                                        at.y + size.y * static_cast<float>(j + 1) / static_cast<float>(ny)},
                                       c);
                    i = end;
                }
            std::array<ImU32, 3> const colors{IM_COL32(235, 85, 75, 255), IM_COL32(95, 200, 90, 255),
                                              IM_COL32(85, 145, 250, 255)};
            list.AddRect(at, {at.x + size.x, at.y + size.y}, colors[axis]);
            float const cx = at.x + size.x * static_cast<float>(crosshair[static_cast<std::size_t>(a)]);
            float const cy = at.y + size.y * static_cast<float>(1 - crosshair[static_cast<std::size_t>(b)]);
            list.AddLine({cx, at.y}, {cx, at.y + size.y}, colors[static_cast<std::size_t>(a)]);
            list.AddLine({at.x, cy}, {at.x + size.x, cy}, colors[static_cast<std::size_t>(b)]);
            ImGui::SetCursorScreenPos(at);
            ImGui::PushID(static_cast<int>(axis));
            ImGui::InvisibleButton("slice", size);
            ImGui::PopID();
            ImVec2 const mouse = ImGui::GetIO().MousePos;
            double const u = std::clamp(static_cast<double>((mouse.x - at.x) / size.x), 0.0, 0.999999);
            double const v = std::clamp(1 - static_cast<double>((mouse.y - at.y) / size.y), 0.0, 0.999999);
            if (ImGui::IsItemActive())
                crosshair[static_cast<std::size_t>(a)] = u, crosshair[static_cast<std::size_t>(b)] = v;
            if (ImGui::IsItemHovered()) {
                float const wheel = ImGui::GetIO().MouseWheel;
                crosshair[axis] = std::clamp(crosshair[axis] + static_cast<double>(wheel) /
                                                                   static_cast<double>(dims[static_cast<int>(axis)]),
                                             0.0, 0.999999);
                Vec3 index{0, 0, 0};
                index[static_cast<int>(axis)] = place;
                index[a] = u * static_cast<double>(dims[a]) - 0.5, index[b] = v * static_cast<double>(dims[b]) - 0.5;
                value = volume.value_at(index);
                ImGui::SetTooltip("%s", std::isnan(value) ? "no data" : short_number(value).c_str());
            }
        }
        Vec3 here;
        for (int axis = 0; axis < 3; ++axis)
            here[axis] = crosshair[static_cast<std::size_t>(axis)] * static_cast<double>(dims[axis]) - 0.5;
        double const at_cross = volume.value_at(here);
        ImGui::SetCursorScreenPos({start.x, start.y + tall + 4});
        ImGui::TextDisabled("%s",
                            text("voxel ", std::lround(here.x), ", ", std::lround(here.y), ", ", std::lround(here.z),
                                 ": ", std::isnan(at_cross) ? "no data" : short_number(at_cross),
                                 volume.header().units.empty() ? "" : " ", volume.header().units)
                                .c_str());
    }
    ImVec2 const at = ImGui::GetWindowPos(), size = ImGui::GetWindowSize();
    floating_.push_back({at.x, at.y, size.x, size.y});
    ImGui::End();
}

void Panels::help_window(Shown const& shown) {
    Area const& p = shown.picture;
    ImGui::SetNextWindowPos({p.x + 12, p.y + 12}, ImGuiCond_Appearing);
    ImGui::SetNextWindowBgAlpha(0.9F);
    ImGui::SetNextWindowSizeConstraints({0, 0}, {p.width - 16, p.height - 16});
    if (ImGui::Begin("Keys", &help, ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_AlwaysAutoResize)) {
        if (ImGui::BeginTable("keys", 2, ImGuiTableFlags_SizingFixedFit)) {
            for (auto const& [key, what] : keys()) {
                ImGui::TableNextRow();
                ImGui::TableNextColumn();
                ImGui::TextColored({1, 0.87F, 0.45F, 1}, "%s", key);
                ImGui::TableNextColumn();
                ImGui::TextUnformatted(what);
            }
            ImGui::EndTable();
        }
    }
    ImVec2 const at = ImGui::GetWindowPos(), size = ImGui::GetWindowSize();
    floating_.push_back({at.x, at.y, size.x, size.y});
    ImGui::End();
}

} // namespace vkt::shell::viewer
