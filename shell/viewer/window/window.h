// The window on a scene. Only files of this folder know GLFW and OpenGL: they are a module that is loaded when a window
// is opened.
// SPDX-License-Identifier: MIT
#pragma once

#include "shell/viewer/painter.h"
#include "shell/viewer/window/panels.h"

#include <GLFW/glfw3.h>

#include <array>
#include <chrono>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>

namespace vkt::shell::viewer {

inline constexpr float panel_points = 330;
/// About half of the window: narrower ones keep all of their width for the picture.
inline constexpr float least_picture_points = 250;

[[noreturn]] void no_window(std::string const& why);

/// The library between its start and its end.
struct Session {
    Session();
    ~Session() { glfwTerminate(); }
    Session(Session const&) = delete;
    Session& operator=(Session const&) = delete;
};

/// Functions of OpenGL, which GLFW has loaded with the context.
struct Gl {
    decltype(&::glGenTextures) glGenTextures = nullptr;
    decltype(&::glBindTexture) glBindTexture = nullptr;
    decltype(&::glTexParameteri) glTexParameteri = nullptr;
    decltype(&::glPixelStorei) glPixelStorei = nullptr;
    decltype(&::glTexImage2D) glTexImage2D = nullptr;
    decltype(&::glViewport) glViewport = nullptr;
    decltype(&::glClear) glClear = nullptr;
    decltype(&::glClearColor) glClearColor = nullptr;
    decltype(&::glGetIntegerv) glGetIntegerv = nullptr;

    void load();
};

/// The window on a scene: what is drawn, what the panels say, what hands do.
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
    /// As GLFW tells of them: a key, or a character that one or several make.
    struct Key {
        int which = 0, code = 0, action = 0, modifiers = 0;
        unsigned character = 0;
    };

    static Window& of(GLFWwindow* window) { return *static_cast<Window*>(glfwGetWindowUserPointer(window)); }
    void open();
    void listen();
    void listen_to_keys();
    void style();
    void press(int button, int action, int modifiers);
    void move(double x, double y);
    void scroll(double x, double y, double notches);
    void type(Key const& key);
    void take_keys();
    void keys_were_seen();
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

    bool room_for_panels(float width) const { return width >= (panel_points + least_picture_points) * scale_; }
    bool panels_fit(float width) const { return panels_on_ && room_for_panels(width); }
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
    std::deque<Key> typed_;      ///< that wait for a frame
    std::set<int> changed_keys_; ///< since the last frame
    bool characters_ = false;    ///< have been typed since
    int frames_to_keys_ = 0;     ///< that have to be drawn before keys are taken
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

} // namespace vkt::shell::viewer
