// The window's loop: news from the painter, pictures on the screen, and what the module exports.
// SPDX-License-Identifier: MIT
#include "shell/viewer/window/window.h"

#include "libvkt/core/text.h"
#include "libvkt/io/module.h"
#include "shell/viewer/window/widgets.h"

#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>
#include <imgui_internal.h> // to close popups

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace vkt::shell::viewer {

namespace {

/// A frame of a movement should take no longer: two refreshes of a common screen.
constexpr double target_seconds = 0.030;
constexpr auto time_of_volume = std::chrono::milliseconds(250); ///< while volumes are played

bool same(std::optional<render::Camera> const& a, std::optional<render::Camera> const& b) {
    if (!a || !b) return !a && !b;
    return a->eye == b->eye && a->target == b->target && a->up == b->up && a->projection == b->projection &&
           a->fov == b->fov && a->height == b->height;
}

} // namespace

Window::Window(Scene& scene, render::RenderSettings const& asked, render::Background const& background,
               std::function<void(std::string const&)> const& note)
    : asked_(asked), background_(background.color), note_(note), view_(initial_view(asked)), undo_(view_.look) {
    open();
    listen();
    style();
    painter_ = std::make_unique<Painter>(
        scene, asked, background, [] { glfwPostEmptyEvent(); }, target_seconds);
}

Window::~Window() {
    painter_.reset(); // it posts events until it ends, so that the library goes later
    if (ImGui::GetCurrentContext() != nullptr) {
        ImGui_ImplOpenGL3_Shutdown();
        ImGui_ImplGlfw_Shutdown();
        ImGui::DestroyContext();
    }
}

Area Window::picture_area() const {
    int width = 0, height = 0;
    glfwGetWindowSize(window_, &width, &height);
    auto const w = static_cast<float>(width);
    return {0, 0, panels_fit(w) ? w - panel_width() : w, static_cast<float>(height)};
}

std::array<double, 2> Window::in_picture(double x, double y) const {
    Area const area = picture_area();
    return {x / std::max(1.0, static_cast<double>(area.width)), y / std::max(1.0, static_cast<double>(area.height))};
}

void Window::take_news() {
    if (std::optional<Frame> frame = painter_->take()) {
        if (!frame->view.camera) home_ = frame->camera;
        name_ = frame->name;
        std::string const map = frame->view.look.transfer           ? "edited colours"
                                : !has_colormap(asked_)             ? "own colours"
                                : frame->view.look.colormap.empty() ? "automatic colours"
                                                                    : frame->view.look.colormap;
        facts_ = text(enum_name(frame->view.look.algorithm), ", ", map, ", ",
                      static_cast<std::int64_t>(std::lround(frame->seconds * 1e3)), " ms");
        int const wanted = frame->view.look.samples;
        if (!frame->arrival.complete || !frame->arrival.failure.empty())
            facts_ += text(" at ", frame->arrival.slices, " of ", frame->arrival.of, " slices");
        else if (frame->effort < 1 && frame->paths > 0)
            facts_ += text(" at ", frame->paths, " of ", wanted, " paths");
        else if (frame->effort < 1)
            facts_ += text(" at ", frame->width, "x", frame->height);
        if (!frame_ || frame_->turn != frame->turn) shown_since_ = std::chrono::steady_clock::now();
        frame_ = std::move(frame);
        upload();
        frames_left_ = std::max(frames_left_, 2);
        if (message_ == "resampling") message_.clear();
    }
    while (std::optional<std::string> const message = painter_->take_message()) {
        bool const command = message->starts_with("vkt ");
        if (*message == no_next_volume) playing_ = false;
        message_ = command ? "the command is in the terminal" : *message;
        note_(*message);
        frames_left_ = std::max(frames_left_, 2);
    }
}

void Window::upload() {
    Frame& frame = *frame_;
    if (std::max(frame.width, frame.height) > largest_texture_) return; // the coarser one before it stays
    gl_.glBindTexture(GL_TEXTURE_2D, texture_);
    gl_.glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    gl_.glTexImage2D(GL_TEXTURE_2D, 0, GL_RGB, frame.width, frame.height, 0, GL_RGB, GL_UNSIGNED_BYTE,
                     frame.rgb.data());
    frame.rgb = {};
}

/// The newest picture. It may be one of a camera that has moved meanwhile: then it is shown as that camera would see
/// it.
void Window::draw_picture(Area const& area) {
    ImDrawList& list = *ImGui::GetBackgroundDrawList();
    auto const texture = reinterpret_cast<ImTextureID>(static_cast<std::uintptr_t>(texture_));
    ImVec2 const corner{area.x, area.y}, far_corner{area.x + area.width, area.y + area.height};
    constexpr int cells = 16;
    std::vector<std::array<double, 2>> places;
    if (frame_ && home_ && !same(frame_->view.camera, view_.camera))
        places = reprojected(frame_->camera, static_cast<double>(frame_->width) / frame_->height,
                             view_.camera.value_or(*home_), static_cast<double>(view_.width) / view_.height, cells);
    if (places.empty()) {
        list.AddImage(texture, corner, far_corner); // the first row of a picture is the top one
        return;
    }
    list.PushClipRect(corner, far_corner, true);
    list.AddRectFilled(corner, far_corner, color_of(background_));
    for (int j = 0; j < cells; ++j)
        for (int i = 0; i < cells; ++i) {
            auto const place = [&](int x, int y) {
                auto const [u, v] = places[static_cast<std::size_t>(y) * (cells + 1) + static_cast<std::size_t>(x)];
                return ImVec2{area.x + area.width * static_cast<float>(u),
                              area.y + area.height * static_cast<float>(v)};
            };
            auto const in_texture = [&](int x, int y) {
                return ImVec2{static_cast<float>(x) / cells, static_cast<float>(y) / cells};
            };
            list.AddImageQuad(texture, place(i, j), place(i + 1, j), place(i + 1, j + 1), place(i, j + 1),
                              in_texture(i, j), in_texture(i + 1, j), in_texture(i + 1, j + 1), in_texture(i, j + 1));
        }
    list.PopClipRect();
}

void Window::draw() {
    int width = 0, height = 0;
    glfwGetFramebufferSize(window_, &width, &height);
    if (width < 1 || height < 1) return keys_were_seen(); // minimised
    ImGui_ImplOpenGL3_NewFrame();
    ImGui_ImplGlfw_NewFrame();
    ImGui::NewFrame();
    if (std::exchange(closing_popups_, false)) ImGui::ClosePopupToLevel(0, true);
    Area const area = picture_area();
    draw_picture(area);
    auto const volume = frame_ ? frame_->volume.lock() : nullptr;
    double x = 0, y = 0;
    glfwGetCursorPos(window_, &x, &y);
    auto const [u, v] = in_picture(x, y);
    Shown const shown{
        asked_,   frame_ ? &*frame_ : nullptr, volume, area, u, v, undo_.can_undo(), undo_.can_redo(), magnified_,
        message()};
    Look const before = view_.look;
    std::optional<render::Camera> const camera = view_.camera;
    ImVec2 const all = ImGui::GetIO().DisplaySize;
    Wish wish = Wish::none;
    if (panels_fit(all.x)) wish = panels_.draw(view_, shown, {area.width, 0, all.x - area.width, all.y});
    panels_.draw_over_picture(view_, shown);
    bool const changed = view_.look != before || !same(camera, view_.camera);
    // One step to go back to for each gesture, not for each of its frames.
    if (!ImGui::IsAnyMouseDown()) undo_.record(view_.look);
    if (changed) {
        show_view();
        frames_left_ = std::max(frames_left_, 2);
    }
    if (!panels_.remark.empty()) {
        message_ = std::exchange(panels_.remark, {});
        frames_left_ = std::max(frames_left_, 2);
    }
    do_wish(wish);
    ImGui::Render();
    gl_.glViewport(0, 0, width, height);
    gl_.glClearColor(0.07F, 0.075F, 0.09F, 1);
    gl_.glClear(GL_COLOR_BUFFER_BIT);
    ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
    glfwSwapBuffers(window_);
    keys_were_seen();
}

/// While volumes are played: goes on once the last one that was asked for has been seen for a while.
void Window::play() {
    if (!playing_ || !frame_ || !frame_->arrival.complete || frame_->turn < asked_turn_) return;
    if (std::chrono::steady_clock::now() - shown_since_ < time_of_volume) return;
    asked_turn_ = frame_->turn + 1;
    painter_->go_on(Turn::around);
}

/// What there is to tell: of a volume that is not whole, whenever there is nothing else.
std::string Window::message() const {
    if (painter_->saving()) return "saving";
    if (!message_.empty() || !frame_) return message_;
    return frame_->arrival.failure;
}

void Window::set_title() {
    std::string title = text("vkt render: ", name_, " - ", facts_);
    if (playing_) title += " - playing";
    if (std::string const told = message(); !told.empty()) title += " - " + told;
    if (std::exchange(title_, title) != title) glfwSetWindowTitle(window_, title.c_str());
}

void Window::run() {
    note_("drag turns, right drag or shift moves, wheel zooms; h shows all keys, s saves, p prints the command, q "
          "quits");
    while (glfwWindowShouldClose(window_) == GLFW_FALSE) {
        // Panels need some frames until they rest; text that is being typed blinks.
        if (!typed_.empty()) {
            glfwPollEvents();
            frames_left_ = std::max(frames_left_, 1);
        } else if (ImGui::GetIO().WantTextInput) {
            glfwWaitEventsTimeout(0.2);
        } else if (frames_left_ > 0) {
            glfwWaitEventsTimeout(0.012);
        } else if (playing_) {
            glfwWaitEventsTimeout(0.05);
        } else {
            glfwWaitEvents();
        }
        if (ImGui::IsAnyMouseDown() || ImGui::GetIO().WantTextInput) frames_left_ = std::max(frames_left_, 2);
        take_news();
        play();
        if (frames_left_ > 0) {
            --frames_left_;
            draw();
        }
        set_title();
    }
    // The window goes at once; pictures that are being saved are finished without it.
    glfwHideWindow(window_);
    painter_->finish();
    while (std::optional<std::string> const message = painter_->take_message()) note_(*message);
}

namespace {

void show_window(Scene& scene, render::RenderSettings const& asked, render::Background const& background,
                 std::function<void(std::string const&)> const& note) {
    Window(scene, asked, background, note).run();
}

WindowFunctions const functions{show_window};

} // namespace

} // namespace vkt::shell::viewer

extern "C" {
extern vkt::ModuleExport const vkt_module_window;
vkt::ModuleExport const vkt_module_window{VKT_VERSION, &vkt::shell::viewer::functions, nullptr};
}
