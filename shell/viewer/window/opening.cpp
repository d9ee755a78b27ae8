// How the window is opened: the library, OpenGL, the look of the panels.
// SPDX-License-Identifier: MIT
#include "shell/viewer/window/window.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <type_traits>

namespace vkt::shell::viewer {

namespace {

std::string glfw_error() {
    char const* message = nullptr;
    glfwGetError(&message);
    return message == nullptr ? "the display does not answer" : message;
}

} // namespace

void no_window(std::string const& why) {
    throw Error(ErrorKind::resources, text("no window: ", why), "vkt render -o FILE writes the picture");
}

Session::Session() {
    if (glfwInit() != GLFW_TRUE) no_window(glfw_error());
}

void Gl::load() {
    auto const find = [](auto& function, char const* name) {
        function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(glfwGetProcAddress(name));
        if (function == nullptr) no_window(text("OpenGL has no ", name));
    };
    find(glGenTextures, "glGenTextures");
    find(glBindTexture, "glBindTexture");
    find(glTexParameteri, "glTexParameteri");
    find(glPixelStorei, "glPixelStorei");
    find(glTexImage2D, "glTexImage2D");
    find(glViewport, "glViewport");
    find(glClear, "glClear");
    find(glClearColor, "glClearColor");
    find(glGetIntegerv, "glGetIntegerv");
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
        double const beside = room_for_panels(static_cast<float>(width)) ? static_cast<double>(panel_width()) : 0;
        if (width > 0 && height > 0)
            shrink = std::min({1.0, 0.98 * (width - beside) / asked_.width, 0.95 * height / asked_.height});
    }
    auto const scaled = [&](int n) { return std::max(1, static_cast<int>(std::lround(n * shrink))); };
    int const with_panels = scaled(asked_.width) + static_cast<int>(panel_width());
    bool const panels = room_for_panels(static_cast<float>(with_panels));
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
    window_ = glfwCreateWindow(panels ? with_panels : scaled(asked_.width), scaled(asked_.height), "vkt render",
                               nullptr, nullptr);
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
    listen_to_keys();
    ImGui_ImplOpenGL3_Init("#version 330 core");
}

} // namespace vkt::shell::viewer
