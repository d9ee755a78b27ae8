// What lies over the picture: colour bar, scale, axes, slices, help.
// SPDX-License-Identifier: MIT
#include "shell/viewer/window/panels.h"
#include "shell/viewer/window/widgets.h"

#include "libvkt/core/text.h"
#include "libvkt/formats/format.h"

#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace vkt::shell::viewer {

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
    if (slices) slice_views(shown);
    if (overlays && p.width > 200 && p.height > 160) {
        render::Camera const& camera = shown.frame->camera;
        auto const [column_top, column_bottom] = free_column(p);
        if (auto const& labels = shown.frame->report.labels) {
            float const x = p.x + 14, y = column_top, pitch = line + 4;
            auto const room = static_cast<std::size_t>(std::max(1.0F, (column_bottom - column_top) / pitch));
            std::size_t const fit = labels->size() > room ? room - 1 : labels->size();
            for (std::size_t i = 0; i < fit; ++i) {
                render::ShownLabel const& one = (*labels)[i];
                float const top = y + static_cast<float>(i) * pitch;
                list.AddRectFilled({x, top}, {x + 14, top + line}, color_of(one.color));
                list.AddRect({x, top}, {x + 14, top + line}, IM_COL32(255, 255, 255, 160));
                label(list, {x + 20, top}, one.name.empty() ? to_text(one.label) : printable(one.name));
            }
            if (fit < labels->size())
                label(list, {x, y + static_cast<float>(fit) * pitch},
                      text(fit > 0 ? "and " : "", static_cast<std::int64_t>(labels->size() - fit), " more"));
        } else if (!shown.frame->report.transfer.points.empty() && column_bottom - column_top >= 4 * line) {
            // Colours, from below.
            TransferEdit const edit = editable_transfer(shown.asked, view.look, shown.frame->report);
            ValueAxis const axis{edit.lower, edit.upper, edit.logarithmic};
            // In the middle, unless something is there; half a line of words stands out at either end.
            float const height = std::min({0.5F * p.height, 240.0F, column_bottom - column_top - line}), x = p.x + 14;
            float const y = std::max(column_top + line / 2,
                                     std::min(p.y + (p.height - height) / 2, column_bottom - line / 2 - height));
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
            std::string const unit = shown.volume ? render::length_unit(shown.volume->header()) : "";
            std::string const words = unit.empty() ? short_number(length) : text(short_number(length), " ", unit);
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
    if (help) help_window(shown);
    return Wish::none;
}

/// Above the scale bar, what slices and the like leave of the column at the left of the picture.
std::array<float, 2> Panels::free_column(Area const& p) const {
    float const line = ImGui::GetTextLineHeight();
    float top = p.y + line + 16, bottom = p.y + p.height - line - 32;
    for (Area const& a : floating_) {
        if (a.x > p.x + 6.5F * line || a.y > bottom || a.y + a.height < top) continue;
        float const above = a.y - 8, below = a.y + a.height + 8;
        if (above - top > bottom - below)
            bottom = above;
        else
            top = below;
    }
    return {top, std::max(top, bottom)};
}

void Panels::slice_views(Shown const& shown) {
    if (!shown.volume || shown.frame->report.transfer.points.empty()) return;
    render::Renderer const& volume = *shown.volume;
    Index3 const dims = volume.header().dims;
    Geometry const& g = volume.header().geometry;
    Area const& p = shown.picture;
    float const width = std::min(p.width - 16, 3 * 240.0F), height = width / 3 + 2 * ImGui::GetTextLineHeight() + 8;
    // At the top: below are the scale bar and the axes. Laid out anew where the picture gets another size.
    bool const resized = std::exchange(slices_in_, {p.width, p.height}) != std::array{p.width, p.height};
    ImGuiCond const when = resized ? ImGuiCond_Always : ImGuiCond_Appearing;
    ImGui::SetNextWindowPos({p.x + 8, p.y + 8}, when);
    ImGui::SetNextWindowSize({width, std::min(height, p.height - 16)}, when);
    ImGui::SetNextWindowBgAlpha(0.92F);
    // Never over the help.
    if (ImGui::Begin("Slices", &slices,
                     ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoScrollbar |
                         ImGuiWindowFlags_NoBringToFrontOnFocus)) {
        ValueAxis const grey = grey_axis(volume.histogram());
        // Labels have the colours of the picture.
        std::vector<render::ShownLabel> const* const labels = shown.frame->report.labels.get();
        auto const label_of = [&](double v) { return labels == nullptr ? nullptr : label_at(*labels, v); };
        auto const paint_of = [&](float v) {
            if (std::isnan(v)) return IM_COL32(40, 20, 30, 255);
            if (labels == nullptr) {
                // Of a single value there is neither black nor white.
                double const place = grey.lower < grey.upper ? grey.place(static_cast<double>(v)) : 0.5;
                auto const shade = static_cast<int>(255 * std::clamp(place, 0.0, 1.0));
                return IM_COL32(shade, shade, shade, 255);
            }
            render::ShownLabel const* const one = label_of(static_cast<double>(v));
            return one == nullptr ? IM_COL32(0, 0, 0, 255) : color_of(one->color);
        };
        auto const words_of_value = [&](double v) {
            if (std::isnan(v)) return std::string("no data");
            render::ShownLabel const* const one = label_of(v);
            return short_number(v) + (one != nullptr && !one->name.empty() ? " " + one->name : "");
        };
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
                        slice.values[static_cast<std::size_t>(j) * static_cast<std::size_t>(nx) +
                                     static_cast<std::size_t>(i)] = static_cast<float>(volume.value_at(index));
                    }
            }
            for (int j = 0; j < ny; ++j)
                for (int i = 0; i < nx;) {
                    auto const color_at = [&](int k) {
                        return paint_of(slice.values[static_cast<std::size_t>(j) * static_cast<std::size_t>(nx) +
                                                     static_cast<std::size_t>(k)]);
                    };
                    ImU32 const c = color_at(i);
                    int end = i + 1;
                    while (end < nx && color_at(end) == c) ++end;
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
                ImGui::SetTooltip("%s", words_of_value(value).c_str());
            }
        }
        Vec3 here;
        for (int axis = 0; axis < 3; ++axis)
            here[axis] = crosshair[static_cast<std::size_t>(axis)] * static_cast<double>(dims[axis]) - 0.5;
        double const at_cross = volume.value_at(here);
        ImGui::SetCursorScreenPos({start.x, start.y + tall + 4});
        Index3 const voxel = voxel_at(crosshair, dims);
        ImGui::TextDisabled("%s", text("voxel ", voxel.x, ", ", voxel.y, ", ", voxel.z, ": ", words_of_value(at_cross),
                                       volume.header().units.empty() ? "" : " ", volume.header().units)
                                      .c_str());
    }
    ImVec2 const at = ImGui::GetWindowPos(), size = ImGui::GetWindowSize();
    floating_.push_back({at.x, at.y, size.x, size.y});
    ImGui::End();
}

void Panels::help_window(Shown const& shown) {
    Area const& p = shown.picture;
    // Where panels have no room, there is none for a margin either.
    float const line = ImGui::GetTextLineHeight();
    bool const whole = p.width >= ImGui::GetIO().DisplaySize.x && (p.width < 40 * line || p.height < 47 * line);
    float const margin = whole ? 0 : 12, around = whole ? 0 : 16;
    ImGui::SetNextWindowPos({p.x + margin, p.y + margin}, whole ? ImGuiCond_Always : ImGuiCond_Appearing);
    ImGui::SetNextWindowSizeConstraints(whole ? ImVec2{p.width, p.height} : ImVec2{0, 0},
                                        {p.width - around, p.height - around});
    if (ImGui::Begin("Keys", &help, ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_AlwaysAutoResize)) {
        if (ImGui::BeginTable("keys", 2, ImGuiTableFlags_SizingFixedFit)) {
            // Over a narrow picture lines are broken, not cut off.
            ImGuiStyle const& style = ImGui::GetStyle();
            ImGui::PushTextWrapPos(p.width - around - 2 * style.WindowPadding.x - style.ScrollbarSize);
            for (auto const& [key, what] : keys()) {
                ImGui::TableNextRow();
                ImGui::TableNextColumn();
                ImGui::TextColored({1, 0.87F, 0.45F, 1}, "%s", key);
                ImGui::TableNextColumn();
                ImGui::TextUnformatted(what);
            }
            ImGui::PopTextWrapPos();
            ImGui::EndTable();
        }
    }
    ImVec2 const at = ImGui::GetWindowPos(), size = ImGui::GetWindowSize();
    floating_.push_back({at.x, at.y, size.x, size.y});
    ImGui::End();
}

} // namespace vkt::shell::viewer
