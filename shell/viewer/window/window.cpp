// The window itself: the only file with GLFW and OpenGL, in a module that is loaded when a window is opened.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/module.h"
#include "shell/viewer/painter.h"
#include "shell/viewer/window/panels.h"
#include "shell/viewer/window/widgets.h"

#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>
#include <imgui_internal.h> // to close popups

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <utility>

namespace vkt::shell::viewer {

namespace {

/// A frame of a movement should take no longer: two refreshes of a common screen.
constexpr double target_seconds = 0.030;
constexpr auto time_of_volume = std::chrono::milliseconds(250); ///< while volumes are played
constexpr float panel_points = 330;
/// Narrower windows keep all of their width for the picture.
constexpr float least_picture_points = 60;

[[noreturn]] void no_window(std::string const& why) {
    throw Error(ErrorKind::resources, text("no window: ", why), "vkt render -o FILE writes the picture");
}

std::string glfw_error() {
    char const* message = nullptr;
    glfwGetError(&message);
    return message == nullptr ? "the display does not answer" : message;
}

bool same(std::optional<render::Camera> const& a, std::optional<render::Camera> const& b) {
    if (!a || !b) return !a && !b;
    return a->eye == b->eye && a->target == b->target && a->up == b->up && a->projection == b->projection &&
           a->fov == b->fov && a->height == b->height;
}

/// The library between its start and its end.
struct Session {
    Session() {
        if (glfwInit() != GLFW_TRUE) no_window(glfw_error());
    }
    ~Session() { glfwTerminate(); }
    Session(Session const&) = delete;
    Session& operator=(Session const&) = delete;
};

/// Functions of OpenGL, which GLFW has loaded with the context.
struct Gl {
#define VKT_GL_FUNCTIONS(one)                                                                                          \
    one(glGenTextures) one(glBindTexture) one(glTexParameteri) one(glPixelStorei) one(glTexImage2D) one(glViewport)    \
        one(glClear) one(glClearColor) one(glGetIntegerv)
#define VKT_DECLARE(name) decltype(&::name) name = nullptr;
    VKT_GL_FUNCTIONS(VKT_DECLARE)
#undef VKT_DECLARE

    void load() {
#define VKT_LOAD(name)                                                                                                 \
    name = reinterpret_cast<decltype(&::name)>(glfwGetProcAddress(#name));                                             \
    if (name == nullptr) no_window("OpenGL has no " #name);
        VKT_GL_FUNCTIONS(VKT_LOAD)
#undef VKT_LOAD
    }
};

class Window {
public:
    Window(Scene& scene, render::RenderSettings const& asked, render::Background const& background,
           std::function<void(std::string const&)> const& note);
    ~Window();
    Window(Window const&) = delete;
    Window& operator=(Window const&) = delete;
    void run();

private:
    enum class Drag { none, orbit, pan, dolly, box };

    static Window& of(GLFWwindow* window) { return *static_cast<Window*>(glfwGetWindowUserPointer(window)); }
    void open();
    void listen();
    void style();
    void press(int button, int action, int modifiers);
    void move(double x, double y);
    void scroll(double x, double y, double notches);
    void key(int which, int modifiers, bool repeated);
    void resize(int width, int height);
    void do_wish(Wish wish);
    void set_algorithm(render::Algorithm algorithm);
    void magnify_box();
    void clip_anew(std::string const& clip);
    void pick(double x, double y);
    /// Shows the camera moved by `change`, once there is a picture to start from.
    template <class Change> void change_camera(Change change);
    void show_view();
    void take_news();
    void upload();
    void draw();
    void draw_picture(Area const& area);
    void play();
    void set_title();
    std::string message() const;

    bool panels_fit(float width) const { return panels_on_ && width >= panel_width() + least_picture_points; }
    float panel_width() const { return panel_points * scale_; }
    Area picture_area() const;
    std::array<double, 2> in_picture(double x, double y) const;

    render::RenderSettings asked_;
    render::Color background_;
    std::function<void(std::string const&)> note_;
    Session session_;
    GLFWwindow* window_ = nullptr;
    Gl gl_;
    int largest_texture_ = 0;
    GLuint texture_ = 0;
    float scale_ = 1; ///< points per point of a common screen
    View view_;
    Undo<Look> undo_;
    std::optional<render::Camera> home_; ///< what the command line asks for, known from the first frame
    Drag drag_ = Drag::none;
    double x_ = 0, y_ = 0; ///< where the mouse was
    DoubleClick clicks_;
    bool panels_on_ = true, magnified_ = false;
    bool closing_popups_ = false;
    bool playing_ = false;
    int asked_turn_ = 0;                                ///< of the volume that was asked for last while playing
    std::chrono::steady_clock::time_point shown_since_; ///< …, of the one that is shown
    std::string clip_of_whole_;                         ///< while a part is magnified, whose voxels are others
    int frames_left_ = 3;                               ///< until the panels have come to rest
    Panels panels_;
    std::optional<Frame> frame_;
    std::string name_, facts_, message_, title_;
    std::unique_ptr<Painter> painter_;
};

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

void Window::open() {
    // As large as the picture and the panels, unless the screen is smaller; the picture keeps its size then.
    double shrink = 1;
    if (GLFWmonitor* const monitor = glfwGetPrimaryMonitor()) {
        int x = 0, y = 0, width = 0, height = 0;
        float unused = 1;
        glfwGetMonitorWorkarea(monitor, &x, &y, &width, &height);
        glfwGetMonitorContentScale(monitor, &scale_, &unused);
        scale_ = std::clamp(scale_, 1.0F, 4.0F);
        double const room = width - static_cast<double>(panel_width());
        if (room > 0 && height > 0) shrink = std::min({1.0, 0.98 * room / asked_.width, 0.95 * height / asked_.height});
    }
    auto const scaled = [&](int n) { return std::max(1, static_cast<int>(std::lround(n * shrink))); };
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
    window_ = glfwCreateWindow(scaled(asked_.width) + static_cast<int>(panel_width()), scaled(asked_.height),
                               "vkt render", nullptr, nullptr);
    if (window_ == nullptr) no_window(glfw_error());
    glfwMakeContextCurrent(window_);
    glfwSwapInterval(1);
    gl_.load();
    gl_.glGetIntegerv(GL_MAX_TEXTURE_SIZE, &largest_texture_);
    gl_.glGenTextures(1, &texture_);
    gl_.glBindTexture(GL_TEXTURE_2D, texture_);
    constexpr GLint clamp_to_edge = 0x812F; // which old headers do not name
    gl_.glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    gl_.glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    gl_.glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, clamp_to_edge);
    gl_.glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, clamp_to_edge);
    std::array<unsigned char, 3> const dark{18, 19, 23};
    gl_.glTexImage2D(GL_TEXTURE_2D, 0, GL_RGB, 1, 1, 0, GL_RGB, GL_UNSIGNED_BYTE, dark.data());
}

void Window::style() {
    IMGUI_CHECKVERSION();
    ImGui::CreateContext();
    ImGuiIO& io = ImGui::GetIO();
    io.IniFilename = nullptr; // nothing is left behind
    float const size = std::round(14 * scale_);
    for (char const* font : {"/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf", "/usr/share/fonts/TTF/DejaVuSans.ttf",
                             "/usr/share/fonts/dejavu-sans-fonts/DejaVuSans.ttf",
                             "/usr/share/fonts/truetype/liberation/LiberationSans-Regular.ttf",
                             "/usr/share/fonts/truetype/noto/NotoSans-Regular.ttf"}) {
        std::error_code ignored;
        if (std::filesystem::exists(font, ignored) && io.Fonts->AddFontFromFileTTF(font, size) != nullptr) break;
    }
    if (io.Fonts->Fonts.empty()) io.Fonts->AddFontDefault();
    ImGui::StyleColorsDark();
    ImGuiStyle& style = ImGui::GetStyle();
    style.WindowRounding = 4, style.FrameRounding = 3, style.GrabRounding = 3, style.PopupRounding = 3;
    style.FramePadding = {6, 3};
    style.ItemSpacing = {7, 5};
    style.WindowBorderSize = 0;
    style.Colors[ImGuiCol_WindowBg] = {0.11F, 0.115F, 0.13F, 1};
    style.Colors[ImGuiCol_FrameBg] = {0.19F, 0.2F, 0.23F, 1};
    style.Colors[ImGuiCol_Header] = {0.2F, 0.24F, 0.31F, 1};
    style.Colors[ImGuiCol_HeaderHovered] = {0.26F, 0.32F, 0.42F, 1};
    style.Colors[ImGuiCol_Button] = {0.22F, 0.28F, 0.37F, 1};
    style.Colors[ImGuiCol_SliderGrab] = {0.45F, 0.6F, 0.82F, 1};
    style.Colors[ImGuiCol_CheckMark] = {1, 0.86F, 0.4F, 1};
    style.Colors[ImGuiCol_PlotHistogram] = {0.45F, 0.6F, 0.82F, 1};
    style.ScaleAllSizes(scale_);
    ImGui_ImplGlfw_InitForOpenGL(window_, true); // calls our callbacks first
    ImGui_ImplOpenGL3_Init("#version 330 core");
}

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
    glfwSetKeyCallback(window_, [](GLFWwindow* w, int which, int, int action, int modifiers) {
        if (action != GLFW_RELEASE) of(w).key(which, modifiers, action == GLFW_REPEAT);
    });
    glfwSetFramebufferSizeCallback(window_, [](GLFWwindow* w, int width, int height) { of(w).resize(width, height); });
    glfwSetWindowRefreshCallback(window_, [](GLFWwindow* w) { of(w).frames_left_ = 3; });
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

void Window::press(int button, int action, int modifiers) {
    frames_left_ = 3;
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
    view_.camera = change(view_.camera.value_or(*home_));
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
    if (repeated && which != GLFW_KEY_W && which != GLFW_KEY_S && which != GLFW_KEY_A && which != GLFW_KEY_D &&
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
        if (!repeated) do_wish(Wish::save);
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
        panels_on_ = !panels_on_;
        int width = 0, height = 0;
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
    if (width < 1 || height < 1) return;
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
    do_wish(wish);
    ImGui::Render();
    gl_.glViewport(0, 0, width, height);
    gl_.glClearColor(0.07F, 0.075F, 0.09F, 1);
    gl_.glClear(GL_COLOR_BUFFER_BIT);
    ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
    glfwSwapBuffers(window_);
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
        if (ImGui::GetIO().WantTextInput)
            glfwWaitEventsTimeout(0.2);
        else if (frames_left_ > 0)
            glfwWaitEventsTimeout(0.012);
        else if (playing_)
            glfwWaitEventsTimeout(0.05);
        else
            glfwWaitEvents();
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
