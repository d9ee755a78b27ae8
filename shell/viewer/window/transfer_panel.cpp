// The transfer function: opacity over the histogram, colours, domain, files.
// SPDX-License-Identifier: MIT
#include "shell/viewer/window/panels.h"
#include "shell/viewer/window/widgets.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/render/settings.h"
#include "libvkt/render/transfer_file.h"

#include <imgui.h>

#include <algorithm>
#include <cmath>

namespace vkt::shell::viewer {

namespace {

using render::Algorithm;
using render::Color;

constexpr float knot_reach = 9;

bool has_opacities(View const& view, Shown const& shown) {
    return render::applies("opacity", view.look.algorithm) && shown.frame->report.labels == nullptr;
}

/// Where labels are drawn, that of the nearest one; 0 is none.
Color shown_color(Shown const& shown, TransferEdit const& edit, double value) {
    auto const& labels = shown.frame->report.labels;
    if (labels == nullptr) return color_at(edit, value);
    Color color{0.15, 0.15, 0.15};
    double nearest = std::abs(value);
    for (render::ShownLabel const& one : *labels) {
        double const distance = std::abs(static_cast<double>(one.label) - value);
        if (distance < nearest) nearest = distance, color = one.color;
    }
    return color;
}

void combo_of_maps(TransferEdit& edit, bool labels, bool& changed) {
    std::string const name = labels ? "labels" : edit.colors.empty() ? edit.colormap : "own colours";
    if (!ImGui::BeginCombo("map", name.c_str(), ImGuiComboFlags_HeightLargest)) return;
    bool const reversed = edit.colormap.ends_with(":reverse");
    for (std::string const& map : render::colormap_names()) {
        ImVec2 const at = ImGui::GetCursorScreenPos();
        std::string const full = reversed ? map + ":reverse" : map;
        std::string_view const other = render::other_name(map);
        std::string const called = other.empty() ? map : text(map, " (", other, ")");
        bool const taken = !labels && edit.colors.empty() && edit.colormap == full;
        if (ImGui::Selectable(("          " + called).c_str(), taken)) {
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

void Panels::transfer_panel(View& view, Shown const& shown) {
    if (shown.frame->report.transfer.points.empty()) return;
    TransferEdit edit = editable_transfer(shown.asked, view.look, shown.frame->report);
    bool changed = false;
    // What the picture does not depend on is not to be edited: labels have colours of their own, projections no
    // opacity.
    bool const labels = shown.frame->report.labels != nullptr, opacities = has_opacities(view, shown);
    ImGui::BeginDisabled(!opacities && view.look.algorithm != Algorithm::implicit_iso);
    histogram_canvas(view, shown, edit, changed);
    ImGui::EndDisabled();
    ImGui::BeginDisabled(labels);
    color_strip(shown, edit, changed);
    ImGui::EndDisabled();
    combo_of_maps(edit, labels, changed);
    ImGui::SameLine();
    ImGui::BeginDisabled(labels);
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
        if (lower < upper) {
            set_domain(edit, lower, upper, false);
            changed = true;
        } else {
            remark = text("the domain stays: ", short_number(lower), " is not below ", short_number(upper));
        }
    }
    ImGui::BeginDisabled(!(edit.lower > 0));
    if (ImGui::Checkbox("colours over log(value)", &edit.logarithmic)) changed = true;
    ImGui::EndDisabled();
    tip("where the domain is above 0");
    ImGui::EndDisabled();
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
    ImGui::BeginDisabled(!opacities);
    slider("opacity", view.look.opacity_scale, 0.01, 100, true, "x %.3g");
    tip("multiplies all extinctions (--opacity-scale)");
    double unit = shown.frame->report.unit;
    if (input("unit distance", unit) && unit > 0) view.look.unit = to_text(unit);
    tip("world length that opacities hold for (--unit-distance)");
    ImGui::EndDisabled();
    ImGui::Checkbox("log values", &log_values_);
    ImGui::SameLine();
    ImGui::BeginDisabled(!opacities);
    ImGui::Checkbox("log opacity", &log_opacity_);
    ImGui::EndDisabled();
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
                save_transfer(name, content);
                file_message_ = "wrote " + name;
            });
        };
        render::TransferFunction function = function_of(edit);
        function.unit = shown.frame->report.unit;
        if (ImGui::Button("load"))
            attempt([&] {
                render::TransferFunction const read = render::read_transfer(name);
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
    if (!view.look.transfer && view.look.shade < 0 && render::applies("shade", view.look.algorithm))
        view.look.shade = shown.frame->report.shade;
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
        Color const c = shown_color(shown, edit, value);
        Color const dim{0.12 + 0.4 * c.red, 0.12 + 0.4 * c.green, 0.12 + 0.4 * c.blue};
        if (columns_[i] > 0)
            list.AddRectFilled({x, at.y + size.y * (1 - 0.94F * columns_[i])}, {x + 1, at.y + size.y}, color_of(dim));
    }
    bool const surfaces = view.look.algorithm == Algorithm::implicit_iso, opacities = has_opacities(view, shown);
    // The line as the renderer has it: straight in extinction between knots.
    std::vector<ImVec2> line;
    for (std::size_t i = 0; i < columns; i += 2) {
        double const value = axis.value(static_cast<double>(i) / static_cast<double>(columns));
        line.push_back({at.x + static_cast<float>(i), y_of(alpha_at(edit, value))});
    }
    for (OpacityKnot const& k : edit.knots) line.push_back({x_of(k.value), y_of(k.alpha)});
    std::stable_sort(line.begin(), line.end(), [](ImVec2 const& a, ImVec2 const& b) { return a.x < b.x; });
    ImU32 const bright = opacities ? IM_COL32(255, 255, 255, 230) : IM_COL32(255, 255, 255, 70);
    list.AddPolyline(line.data(), static_cast<int>(line.size()), bright, 0, 1.6F);
    ImVec2 const mouse = ImGui::GetIO().MousePos;
    std::vector<Surface> isos = surfaces ? editable_surfaces(view.look, shown.frame->report) : std::vector<Surface>{};
    int near = -1, near_iso = -1;
    float best = knot_reach;
    for (std::size_t i = 0; opacities && i < edit.knots.size(); ++i) {
        ImVec2 const p{x_of(edit.knots[i].value), y_of(edit.knots[i].alpha)};
        float const d = std::hypot(p.x - mouse.x, p.y - mouse.y);
        if (d < best) best = d, near = static_cast<int>(i);
    }
    for (std::size_t i = 0; i < isos.size(); ++i)
        if (std::abs(x_of(isos[i].value) - mouse.x) < best) near_iso = static_cast<int>(i);
    for (std::size_t i = 0; opacities && i < edit.knots.size(); ++i) {
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
                           color_of(shown_color(shown, edit, axis.value((i + 0.5) / parts))));
    auto const x_of = [&](double value) {
        return at.x + size.x * static_cast<float>(std::clamp(axis.place(value), 0.0, 1.0));
    };
    ImVec2 const mouse = ImGui::GetIO().MousePos;
    double const value = axis.value(std::clamp((mouse.x - at.x) / size.x, 0.0F, 1.0F));
    // Handles of the domain hang below the strip, own colours are rings in it.
    bool const labels = shown.frame->report.labels != nullptr;
    for (double const end : {edit.lower, edit.upper}) {
        float const x = x_of(end);
        list.AddTriangleFilled({x, at.y + size.y - 9}, {x - 6, at.y + size.y}, {x + 6, at.y + size.y},
                               labels ? IM_COL32(255, 255, 255, 70) : IM_COL32(255, 220, 90, 255));
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

} // namespace vkt::shell::viewer
