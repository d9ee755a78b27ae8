// What hands do with the window: mouse, keys, and what panels wish for.
// SPDX-License-Identifier: MIT
#include "shell/viewer/window/window.h"

#include <backends/imgui_impl_glfw.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace vkt::shell::viewer {

void Window::listen() {
    glfwSetWindowUserPointer(window_, this);
    glfwSetMouseButtonCallback(
        window_, [](GLFWwindow* w, int button, int action, int modifiers) { of(w).press(button, action, modifiers); });
    glfwSetCursorPosCallback(window_, [](GLFWwindow* w, double x, double y) { of(w).move(x, y); });
    glfwSetScrollCallback(window_, [](GLFWwindow* w, double, double notches) {
        double x = 0, y = 0;
        glfwGetCursorPos(w, &x, &y);
        of(w).scroll(x, y, notches);
    });
    glfwSetFramebufferSizeCallback(window_, [](GLFWwindow* w, int width, int height) { of(w).resize(width, height); });
    glfwSetWindowRefreshCallback(window_, [](GLFWwindow* w) { of(w).frames_left_ = 3; });
}

void Window::listen_to_keys() {
    // These callbacks take the place of those of Dear ImGui, which are called in time.
    glfwSetKeyCallback(window_, [](GLFWwindow* w, int which, int code, int action, int modifiers) {
        of(w).type({which, code, action, modifiers, 0});
    });
    glfwSetCharCallback(window_, [](GLFWwindow* w, unsigned character) { of(w).type({0, 0, 0, 0, character}); });
}

/// Dear ImGui sees what is pressed when a frame is drawn, and before it knows that text is meant for a field it has to
/// see the click into it, and after it the key that leaves it. What comes faster waits for the next frame.
void Window::type(Key const& key) {
    typed_.push_back(key);
    take_keys();
}

void Window::take_keys() {
    while (!typed_.empty() && frames_to_keys_ == 0) {
        Key const key = typed_.front();
        bool const change = key.character == 0 && key.action != GLFW_REPEAT;
        // No key is pressed and released in one frame, and what is pressed after text has been typed follows it.
        if (change && (changed_keys_.contains(key.which) || (characters_ && key.action == GLFW_PRESS))) return;
        typed_.pop_front();
        frames_left_ = std::max(frames_left_, 3);
        if (key.character != 0) {
            characters_ = true;
            ImGui_ImplGlfw_CharCallback(window_, key.character);
            continue;
        }
        if (change) changed_keys_.insert(key.which);
        bool const leaves = key.which == GLFW_KEY_ENTER || key.which == GLFW_KEY_KP_ENTER ||
                            key.which == GLFW_KEY_TAB || key.which == GLFW_KEY_ESCAPE;
        if (key.action == GLFW_PRESS && leaves && ImGui::GetIO().WantTextInput) frames_to_keys_ = 3;
        if (key.action != GLFW_RELEASE) this->key(key.which, key.modifiers, key.action == GLFW_REPEAT);
        ImGui_ImplGlfw_KeyCallback(window_, key.which, key.code, key.action, key.modifiers);
    }
}

/// After a frame in which Dear ImGui has seen the keys.
void Window::keys_were_seen() {
    changed_keys_.clear();
    characters_ = false;
    if (frames_to_keys_ > 0) --frames_to_keys_;
    take_keys();
}

void Window::press(int button, int action, int modifiers) {
    frames_left_ = 3;
    if (action == GLFW_PRESS) frames_to_keys_ = 2; // until it is known whether text is meant
    Drag const before = std::exchange(drag_, Drag::none);
    if (before == Drag::box) panels_.choosing_box = false;
    if (before == Drag::orbit && action != GLFW_PRESS && clicks_.release()) pick(x_, y_);
    if (action != GLFW_PRESS) return;
    // Where the pointer was then, by the events before: by now it may be elsewhere.
    if (!picture_area().contains(x_, y_) || panels_.covers(x_, y_)) return;
    if (button == GLFW_MOUSE_BUTTON_LEFT) {
        if (panels_.choosing_box) {
            drag_ = Drag::box;
            auto const [u, v] = in_picture(x_, y_);
            panels_.box = {u, v, u, v};
        } else {
            drag_ = (modifiers & GLFW_MOD_SHIFT) != 0 || (modifiers & GLFW_MOD_ALT) != 0 ? Drag::pan : Drag::orbit;
            if (drag_ == Drag::orbit) clicks_.press(x_, y_, glfwGetTime());
        }
    }
    if (button == GLFW_MOUSE_BUTTON_RIGHT) drag_ = Drag::pan;
    if (button == GLFW_MOUSE_BUTTON_MIDDLE) drag_ = Drag::dolly;
}

template <class Change> void Window::change_camera(Change change) {
    if (!home_) return;
    view_.camera = shortened(change(view_.camera.value_or(*home_)));
    show_view();
}

void Window::show_view() {
    message_.clear();
    painter_->show(view_);
}

void Window::move(double x, double y) {
    frames_left_ = std::max(frames_left_, 2);
    double const height = std::max(1.0, static_cast<double>(picture_area().height));
    Movement const movement{(x - x_) / height, (y - y_) / height};
    x_ = x, y_ = y;
    if (drag_ == Drag::none) return;
    if (movement.x == 0 && movement.y == 0) return;
    clicks_.move(x, y);
    if (drag_ == Drag::box && panels_.box) {
        auto const [u, v] = in_picture(x, y);
        (*panels_.box)[2] = std::clamp(u, 0.0, 1.0), (*panels_.box)[3] = std::clamp(v, 0.0, 1.0);
        return;
    }
    change_camera([&](auto const& camera) {
        return drag_ == Drag::orbit ? orbit(camera, movement)
               : drag_ == Drag::pan ? pan(camera, movement)
                                    : zoom(camera, -20 * movement.y, *home_);
    });
}

void Window::scroll(double x, double y, double notches) {
    frames_left_ = std::max(frames_left_, 2);
    if (!picture_area().contains(x, y) || panels_.covers(x, y)) return;
    change_camera([&](auto const& camera) { return zoom(camera, notches, *home_); });
}

void Window::pick(double x, double y) {
    if (!frame_ || !home_) return;
    auto const volume = frame_->volume.lock();
    if (volume == nullptr || frame_->report.transfer.points.empty()) return;
    auto const [u, v] = in_picture(x, y);
    render::Camera const camera = view_.camera.value_or(*home_);
    auto const met = point_met(line_under(camera, u, v, static_cast<double>(view_.width) / view_.height), *volume,
                               frame_->report.transfer, frame_->report.unit, frame_->report.isos);
    if (met) change_camera([&](auto const& c) { return aimed_at(c, *met); });
}

void Window::set_algorithm(render::Algorithm algorithm) {
    view_.look.algorithm = algorithm;
    show_view();
}

void Window::magnify_box() {
    auto const volume = frame_ ? frame_->volume.lock() : nullptr;
    if (!panels_.box || volume == nullptr || !home_) return;
    render::Camera const camera = view_.camera.value_or(*home_);
    auto const box =
        part_in_box(camera, *panels_.box, static_cast<double>(view_.width) / view_.height, *volume, frame_->report);
    panels_.box.reset();
    if (!box) {
        message_ = "there is nothing in the box";
        return;
    }
    message_ = "resampling";
    if (!std::exchange(magnified_, true)) clip_of_whole_ = view_.look.clip;
    view_.camera.reset();
    clip_anew({});
    painter_->show(view_);
    painter_->magnify(*box);
}

/// Boxes that were said before are in voxels of what is not shown any more.
void Window::clip_anew(std::string const& clip) {
    view_.look.clip = clip;
    undo_.change_all([&](Look& look) { look.clip = clip; });
}

void Window::do_wish(Wish wish) {
    switch (wish) {
    case Wish::none:
        return;
    case Wish::save:
        message_.clear();
        painter_->save();
        return;
    case Wish::command:
        painter_->say_command();
        return;
    case Wish::next:
        message_.clear();
        painter_->go_on(Turn::next);
        return;
    case Wish::previous:
        playing_ = false;
        message_.clear();
        painter_->go_on(Turn::previous);
        return;
    case Wish::reset_camera:
        view_.camera.reset();
        show_view();
        return;
    case Wish::undo:
        view_.look = undo_.undo();
        show_view();
        return;
    case Wish::redo:
        view_.look = undo_.redo();
        show_view();
        return;
    case Wish::magnify:
        magnify_box();
        return;
    case Wish::whole:
        if (!std::exchange(magnified_, false)) return;
        message_.clear();
        view_.camera.reset();
        clip_anew(clip_of_whole_);
        painter_->show(view_);
        painter_->magnify({});
        return;
    case Wish::quit:
        glfwSetWindowShouldClose(window_, GLFW_TRUE);
        return;
    }
}

void Window::key(int which, int modifiers, bool repeated) {
    frames_left_ = std::max(frames_left_, 3);
    if (ImGui::GetIO().WantTextInput) return;
    bool const control = (modifiers & GLFW_MOD_CONTROL) != 0, shift = (modifiers & GLFW_MOD_SHIFT) != 0;
    double const step = repeated ? 0.6 : 1;
    auto const flown = [&](double steps) { change_camera([&](auto const& camera) { return fly(camera, steps); }); };
    auto const moved = [&](double x, double y) {
        change_camera([&](auto const& camera) { return pan(camera, {0.04 * step * x, 0.04 * step * y}); });
    };
    if (repeated && which != GLFW_KEY_W && which != GLFW_KEY_A && which != GLFW_KEY_D &&
        (which < GLFW_KEY_RIGHT || which > GLFW_KEY_UP))
        return;
    if (which >= GLFW_KEY_1 && which <= GLFW_KEY_9) {
        auto& stored = panels_.stored[static_cast<std::size_t>(which - GLFW_KEY_1)];
        if (control && home_)
            stored = view_.camera.value_or(*home_);
        else if (stored)
            change_camera([&](auto const&) { return *stored; });
        return;
    }
    switch (which) {
    case GLFW_KEY_R:
    case GLFW_KEY_HOME:
        do_wish(Wish::reset_camera);
        break;
    case GLFW_KEY_C:
        if (view_.look.transfer) {
            view_.look.transfer->colors.clear();
            view_.look.transfer->colormap = next_colormap(view_.look.transfer->colormap, "viridis");
            show_view();
        } else if (has_colormap(asked_)) {
            view_.look.colormap = next_colormap(view_.look.colormap, asked_.colormap);
            show_view();
        } else {
            message_ = "the colours are those of the transfer function";
        }
        break;
    case GLFW_KEY_S:
        do_wish(Wish::save);
        break;
    case GLFW_KEY_W:
    case GLFW_KEY_UP:
        flown(step);
        break;
    case GLFW_KEY_DOWN:
        flown(-step);
        break;
    case GLFW_KEY_A:
    case GLFW_KEY_LEFT:
        moved(1, 0);
        break;
    case GLFW_KEY_D:
    case GLFW_KEY_RIGHT:
        moved(-1, 0);
        break;
    case GLFW_KEY_P:
        do_wish(Wish::command);
        break;
    case GLFW_KEY_X:
    case GLFW_KEY_Y:
    case GLFW_KEY_Z:
        if (control)
            do_wish(which == GLFW_KEY_Y || shift ? Wish::redo : which == GLFW_KEY_Z ? Wish::undo : Wish::none);
        else
            change_camera([&](auto const& camera) { return axis_view(camera, which - GLFW_KEY_X, shift); });
        break;
    case GLFW_KEY_O:
        change_camera([&](auto const& camera) {
            return projected(camera, camera.projection == render::Projection::perspective
                                         ? render::Projection::orthographic
                                         : render::Projection::perspective);
        });
        break;
    case GLFW_KEY_M:
        set_algorithm(render::Algorithm::ray_marching);
        break;
    case GLFW_KEY_I:
        set_algorithm(render::Algorithm::implicit_iso);
        break;
    case GLFW_KEY_T:
        set_algorithm(render::Algorithm::multi_scattering);
        break;
    case GLFW_KEY_K:
        set_algorithm(next_projection(view_.look.algorithm));
        break;
    case GLFW_KEY_LEFT_BRACKET:
    case GLFW_KEY_RIGHT_BRACKET: {
        bool const more = which == GLFW_KEY_RIGHT_BRACKET;
        if (view_.look.algorithm == render::Algorithm::multi_scattering)
            view_.look.samples = std::clamp(more ? view_.look.samples * 2 : view_.look.samples / 2, 1, 1 << 20);
        else
            view_.look.step = std::clamp(more ? view_.look.step * 2 : view_.look.step / 2, 1.0 / 64, 4.0);
        show_view();
        break;
    }
    case GLFW_KEY_L:
        panels_.slices = !panels_.slices;
        break;
    case GLFW_KEY_V:
        panels_.overlays = !panels_.overlays;
        break;
    case GLFW_KEY_H:
        panels_.help = !panels_.help;
        break;
    case GLFW_KEY_G: {
        int width = 0, height = 0;
        glfwGetWindowSize(window_, &width, &height);
        if (!room_for_panels(static_cast<float>(width))) {
            message_ = "the window is too narrow for panels";
            break;
        }
        panels_on_ = !panels_on_;
        glfwGetFramebufferSize(window_, &width, &height);
        resize(width, height);
        break;
    }
    case GLFW_KEY_B:
        panels_.choosing_box = !panels_.choosing_box;
        panels_.box.reset();
        break;
    case GLFW_KEY_ENTER:
    case GLFW_KEY_KP_ENTER:
        do_wish(Wish::magnify);
        break;
    case GLFW_KEY_BACKSPACE:
        do_wish(Wish::whole);
        break;
    case GLFW_KEY_N:
    case GLFW_KEY_SPACE:
        do_wish(Wish::next);
        break;
    case GLFW_KEY_COMMA:
        do_wish(Wish::previous);
        break;
    case GLFW_KEY_PERIOD:
        playing_ = !playing_;
        asked_turn_ = 0;
        frames_left_ = 3;
        break;
    case GLFW_KEY_ESCAPE:
        // What is open over the picture or the panels is what it is meant for.
        if (ImGui::IsPopupOpen("", ImGuiPopupFlags_AnyPopupId | ImGuiPopupFlags_AnyPopupLevel))
            closing_popups_ = true;
        else if (panels_.help)
            panels_.help = false;
        else if (panels_.choosing_box || panels_.box)
            panels_.choosing_box = false, panels_.box.reset();
        else
            do_wish(Wish::quit);
        break;
    case GLFW_KEY_Q:
        do_wish(Wish::quit);
        break;
    default:
        break;
    }
}

void Window::resize(int width, int height) {
    frames_left_ = 3;
    if (width < 1 || height < 1) return; // minimised
    int points = 0, unused = 0;
    glfwGetWindowSize(window_, &points, &unused);
    double const pixels_per_point = points > 0 ? static_cast<double>(width) / points : 1;
    constexpr int largest = 16384; // of a picture
    int const picture = static_cast<int>(std::lround(static_cast<double>(picture_area().width) * pixels_per_point));
    view_.width = std::clamp(picture, 1, largest), view_.height = std::min(height, largest);
    painter_->show(view_);
}

} // namespace vkt::shell::viewer
