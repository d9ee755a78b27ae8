// Fonts: where they lie, and the module that draws with them.
// SPDX-License-Identifier: MIT
#include "libvkt/render/font.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/module.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>

namespace vkt::render {

std::string default_font() {
    namespace fs = std::filesystem;
    constexpr std::array preferred{"DejaVuSans.ttf", "LiberationSans-Regular.ttf", "NotoSans-Regular.ttf",
                                   "FreeSans.ttf",   "Lato-Regular.ttf",           "Arial.ttf"};
    std::vector<fs::path> folders{"/usr/share/fonts", "/usr/local/share/fonts"};
    if (char const* const home = std::getenv("HOME")) {
        folders.push_back(fs::path(home) / ".local/share/fonts");
        folders.push_back(fs::path(home) / ".fonts");
    }
    std::vector<std::string> found;
    for (fs::path const& folder : folders) {
        std::error_code error;
        for (fs::recursive_directory_iterator i(folder, fs::directory_options::skip_permission_denied, error), end;
             !error && i != end; i.increment(error)) {
            std::string const suffix = lower_case(i->path().extension().string());
            if (suffix == ".ttf" || suffix == ".otf") found.push_back(i->path().string());
        }
    }
    std::sort(found.begin(), found.end());
    for (char const* const name : preferred)
        for (std::string const& file : found)
            if (file.ends_with(std::string("/") + name)) return file;
    if (found.empty())
        throw Error(ErrorKind::failure, "no font was found on this machine", "name a .ttf or .otf file: --font FILE");
    return found.front();
}

TextLine draw_text(std::string const& font, double pixels, std::string const& text) {
    return static_cast<FontFunctions const*>(module_functions("freetype", "text in pictures"))
        ->draw(font, pixels, text);
}

} // namespace vkt::render
