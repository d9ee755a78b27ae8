// The window itself: the only file with GLFW and OpenGL.
// SPDX-License-Identifier: MIT
#include "shell/viewer/viewer.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <cstdlib>

#ifdef VKT_HAVE_VIEWER
#include "shell/viewer/painter.h"

#include <GLFW/glfw3.h>
#include <dlfcn.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#endif

namespace vkt::shell::viewer {

namespace {
constexpr char const* instead = "use -o FILE to write the picture";

[[maybe_unused]] bool set(char const* variable) {
    char const* const value = std::getenv(variable);
    return value != nullptr && *value != '\0';
}
} // namespace

#ifndef VKT_HAVE_VIEWER

void require_display() {
    throw Error(ErrorKind::usage, "no window: this vkt was built without the viewer (GLFW)", instead);
}

void show(Scene&, render::RenderSettings const&, render::Background const&,
          std::function<void(std::string const&)> const&) {
    require_display();
}

#else

void require_display() {
    if (set("DISPLAY") || set("WAYLAND_DISPLAY")) return;
    throw Error(ErrorKind::usage, "no window: there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set)",
                instead);
}

namespace {

/// A frame of a movement should take no longer: two refreshes of a common screen.
constexpr double target_seconds = 0.030;

// GLFW is loaded when a window is opened. Linked, every vkt process would need it and pay 0.6 to 1.1 ms and 1.6 MiB.
#define VKT_GLFW_FUNCTIONS(one)                                                                                        \
    one(glfwInit) one(glfwTerminate) one(glfwGetError) one(glfwWindowHint) one(glfwCreateWindow)                       \
        one(glfwDestroyWindow) one(glfwMakeContextCurrent) one(glfwGetProcAddress) one(glfwSetWindowUserPointer)       \
            one(glfwGetWindowUserPointer) one(glfwSetMouseButtonCallback) one(glfwSetCursorPosCallback)                \
                one(glfwSetScrollCallback) one(glfwSetKeyCallback) one(glfwSetFramebufferSizeCallback)                 \
                    one(glfwSetWindowRefreshCallback) one(glfwGetFramebufferSize) one(glfwGetWindowSize)               \
                        one(glfwGetCursorPos) one(glfwSetWindowTitle) one(glfwWindowShouldClose)                       \
                            one(glfwSetWindowShouldClose) one(glfwWaitEvents) one(glfwPostEmptyEvent)                  \
                                one(glfwSwapBuffers) one(glfwSwapInterval) one(glfwGetPrimaryMonitor)                  \
                                    one(glfwGetMonitorWorkarea)
struct Glfw {
#define VKT_DECLARE(name) decltype(&::name) name = nullptr;
    VKT_GLFW_FUNCTIONS(VKT_DECLARE)
#undef VKT_DECLARE
};

[[noreturn]] void no_window(std::string const& why) {
    throw Error(ErrorKind::resources, text("no window: ", why), instead);
}

Glfw const& glfw() {
    static Glfw const loaded = [] {
        constexpr char const* library = "libglfw.so.3";
        // Never closed: GLFW leaves handlers behind in the libraries of the display.
        void* const handle = ::dlopen(library, RTLD_NOW | RTLD_LOCAL);
        if (handle == nullptr) no_window(text(library, " cannot be loaded (on Debian it is in the package libglfw3)"));
        Glfw g;
#define VKT_LOAD(name)                                                                                                 \
    g.name = reinterpret_cast<decltype(&::name)>(::dlsym(handle, #name));                                              \
    if (g.name == nullptr) no_window(text(library, " has no " #name));
        VKT_GLFW_FUNCTIONS(VKT_LOAD)
#undef VKT_LOAD
        return g;
    }();
    return loaded;
}

std::string glfw_error() {
    char const* message = nullptr;
    glfw().glfwGetError(&message);
    return message == nullptr ? "the display does not answer" : message;
}

/// The library between its start and its end.
struct Session {
    Session() {
        if (glfw().glfwInit() != GLFW_TRUE) no_window(glfw_error());
    }
    ~Session() { glfw().glfwTerminate(); }
    Session(Session const&) = delete;
    Session& operator=(Session const&) = delete;
};

/// Functions of OpenGL, which GLFW has loaded with the context.
struct Gl {
#define VKT_GL_FUNCTIONS(one)                                                                                          \
    one(glGenTextures) one(glBindTexture) one(glTexParameteri) one(glPixelStorei) one(glTexImage2D) one(glEnable)      \
        one(glViewport) one(glClear) one(glBegin) one(glEnd) one(glTexCoord2f) one(glVertex2f) one(glGetIntegerv)
#define VKT_DECLARE(name) decltype(&::name) name = nullptr;
    VKT_GL_FUNCTIONS(VKT_DECLARE)
#undef VKT_DECLARE

    void load() {
#define VKT_LOAD(name)                                                                                                 \
    name = reinterpret_cast<decltype(&::name)>(glfw().glfwGetProcAddress(#name));                                      \
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
    enum class Drag { none, orbit, pan };

    static Window& of(GLFWwindow* window) { return *static_cast<Window*>(glfw().glfwGetWindowUserPointer(window)); }
    void listen();
    void open();
    void press(int button, int action, int modifiers);
    void move(double x, double y);
    void scroll(double notches);
    void key(int which);
    void resize(int width, int height);
    /// Shows the camera moved by `change`, once there is a picture to start from.
    template <class Change> void change_camera(Change change);
    void take_news();
    void upload(Frame const& frame);
    void draw();
    void set_title();

    render::RenderSettings asked_;
    std::function<void(std::string const&)> note_;
    Session session_;
    GLFWwindow* window_ = nullptr;
    Gl gl_;
    int largest_texture_ = 0;
    View view_;
    std::optional<render::Camera> home_; ///< what the command line asks for, known from the first frame
    Drag drag_ = Drag::none;
    double x_ = 0, y_ = 0; ///< where the mouse was
    std::string name_, facts_, message_, title_;
    std::unique_ptr<Painter> painter_;
};

Window::Window(Scene& scene, render::RenderSettings const& asked, render::Background const& background,
               std::function<void(std::string const&)> const& note)
    : asked_(asked), note_(note), view_(initial_view(asked)) {
    open();
    listen();
    painter_ = std::make_unique<Painter>(
        scene, asked, background, [] { glfw().glfwPostEmptyEvent(); }, target_seconds);
}

Window::~Window() {
    painter_.reset(); // it posts events until it ends, so that the library goes later
}

void Window::open() {
    Glfw const& g = glfw();
    // As large as the picture, unless the screen is smaller; the picture keeps its size then.
    double scale = 1;
    if (GLFWmonitor* const monitor = g.glfwGetPrimaryMonitor()) {
        int x = 0, y = 0, width = 0, height = 0;
        g.glfwGetMonitorWorkarea(monitor, &x, &y, &width, &height);
        if (width > 0 && height > 0)
            scale = std::min({1.0, 0.95 * width / asked_.width, 0.95 * height / asked_.height});
    }
    auto const scaled = [&](int n) { return std::max(1, static_cast<int>(std::lround(n * scale))); };
    g.glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 2);
    g.glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 1);
    window_ = g.glfwCreateWindow(scaled(asked_.width), scaled(asked_.height), "vkt render", nullptr, nullptr);
    if (window_ == nullptr) no_window(glfw_error());
    g.glfwMakeContextCurrent(window_);
    g.glfwSwapInterval(1);
    gl_.load();
    gl_.glGetIntegerv(GL_MAX_TEXTURE_SIZE, &largest_texture_);
    GLuint texture = 0;
    gl_.glGenTextures(1, &texture);
    gl_.glBindTexture(GL_TEXTURE_2D, texture);
    gl_.glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    gl_.glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    gl_.glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, 0x812F); // clamp to edge, which old headers do not name
    gl_.glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, 0x812F);
    gl_.glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    gl_.glEnable(GL_TEXTURE_2D);
}

void Window::listen() {
    Glfw const& g = glfw();
    g.glfwSetWindowUserPointer(window_, this);
    g.glfwSetMouseButtonCallback(
        window_, [](GLFWwindow* w, int button, int action, int modifiers) { of(w).press(button, action, modifiers); });
    g.glfwSetCursorPosCallback(window_, [](GLFWwindow* w, double x, double y) { of(w).move(x, y); });
    g.glfwSetScrollCallback(window_, [](GLFWwindow* w, double, double y) { of(w).scroll(y); });
    g.glfwSetKeyCallback(window_, [](GLFWwindow* w, int which, int, int action, int) {
        if (action == GLFW_PRESS) of(w).key(which);
    });
    g.glfwSetFramebufferSizeCallback(window_,
                                     [](GLFWwindow* w, int width, int height) { of(w).resize(width, height); });
    g.glfwSetWindowRefreshCallback(window_, [](GLFWwindow* w) { of(w).draw(); });
}

void Window::press(int button, int action, int modifiers) {
    drag_ = Drag::none;
    if (action != GLFW_PRESS) return;
    if (button == GLFW_MOUSE_BUTTON_LEFT) drag_ = (modifiers & GLFW_MOD_SHIFT) != 0 ? Drag::pan : Drag::orbit;
    if (button == GLFW_MOUSE_BUTTON_RIGHT) drag_ = Drag::pan;
    glfw().glfwGetCursorPos(window_, &x_, &y_);
}

template <class Change> void Window::change_camera(Change change) {
    if (!home_) return;
    view_.camera = change(view_.camera.value_or(*home_));
    painter_->show(view_);
}

void Window::move(double x, double y) {
    if (drag_ == Drag::none) return;
    int width = 0, height = 0;
    glfw().glfwGetWindowSize(window_, &width, &height);
    Movement const movement{(x - x_) / std::max(1, height), (y - y_) / std::max(1, height)};
    x_ = x, y_ = y;
    if (movement.x == 0 && movement.y == 0) return;
    change_camera(
        [&](auto const& camera) { return drag_ == Drag::orbit ? orbit(camera, movement) : pan(camera, movement); });
}

void Window::scroll(double notches) {
    change_camera([&](auto const& camera) { return zoom(camera, notches, *home_); });
}

void Window::key(int which) {
    message_.clear();
    switch (which) {
    case GLFW_KEY_R:
    case GLFW_KEY_HOME:
        view_.camera.reset();
        painter_->show(view_);
        break;
    case GLFW_KEY_C:
        if (has_colormap(asked_)) {
            view_.colormap = next_colormap(view_.colormap, asked_.colormap);
            painter_->show(view_);
        } else {
            message_ = "the colours are those of the transfer function";
        }
        break;
    case GLFW_KEY_S:
        painter_->save();
        break;
    case GLFW_KEY_N:
    case GLFW_KEY_SPACE:
        painter_->next();
        break;
    case GLFW_KEY_Q:
    case GLFW_KEY_ESCAPE:
        glfw().glfwSetWindowShouldClose(window_, GLFW_TRUE);
        break;
    default:
        break;
    }
}

void Window::resize(int width, int height) {
    if (width < 1 || height < 1) return; // minimised
    constexpr int largest = 16384;       // of a picture
    view_.width = std::min(width, largest), view_.height = std::min(height, largest);
    painter_->show(view_);
}

void Window::take_news() {
    if (std::optional<Frame> const frame = painter_->take()) {
        if (!frame->view.camera) home_ = frame->camera;
        name_ = frame->name;
        std::string const map = !has_colormap(asked_)          ? "own colours"
                                : frame->view.colormap.empty() ? "automatic colours"
                                                               : frame->view.colormap;
        facts_ = text(enum_name(asked_.algorithm), ", ", map, ", ",
                      static_cast<std::int64_t>(std::lround(frame->seconds * 1e3)), " ms");
        if (frame->effort < 1) facts_ += text(" at ", frame->width, "x", frame->height);
        upload(*frame);
        draw();
    }
    while (std::optional<std::string> const message = painter_->take_message()) {
        message_ = *message;
        note_(*message);
    }
}

void Window::upload(Frame const& frame) {
    if (std::max(frame.width, frame.height) > largest_texture_) return; // the coarser one before it stays
    gl_.glTexImage2D(GL_TEXTURE_2D, 0, GL_RGB, frame.width, frame.height, 0, GL_RGB, GL_UNSIGNED_BYTE,
                     frame.rgb.data());
}

void Window::draw() {
    int width = 0, height = 0;
    glfw().glfwGetFramebufferSize(window_, &width, &height);
    gl_.glViewport(0, 0, width, height);
    gl_.glClear(GL_COLOR_BUFFER_BIT);
    gl_.glBegin(GL_QUADS);
    for (auto const& [x, y] : {std::pair{-1.0F, -1.0F}, {1.0F, -1.0F}, {1.0F, 1.0F}, {-1.0F, 1.0F}}) {
        gl_.glTexCoord2f((x + 1) / 2, (1 - y) / 2); // the first row of a picture is the top one
        gl_.glVertex2f(x, y);
    }
    gl_.glEnd();
    glfw().glfwSwapBuffers(window_);
}

void Window::set_title() {
    std::string title = text("vkt render: ", name_, " - ", facts_);
    if (painter_->saving())
        title += " - saving";
    else if (!message_.empty())
        title += " - " + message_;
    if (std::exchange(title_, title) != title) glfw().glfwSetWindowTitle(window_, title.c_str());
}

void Window::run() {
    note_("drag turns, right drag or shift moves, wheel zooms; r resets, c changes colours, s saves, n next volume, "
          "q quits");
    while (glfw().glfwWindowShouldClose(window_) == GLFW_FALSE) {
        glfw().glfwWaitEvents();
        take_news();
        set_title();
    }
    // The window goes at once; pictures that are being saved are finished without it.
    glfw().glfwDestroyWindow(window_);
    painter_->finish();
    while (std::optional<std::string> const message = painter_->take_message()) note_(*message);
}

} // namespace

void show(Scene& scene, render::RenderSettings const& asked, render::Background const& background,
          std::function<void(std::string const&)> const& note) {
    require_display();
    Window(scene, asked, background, note).run();
}

#endif

} // namespace vkt::shell::viewer
