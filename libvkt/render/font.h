// Lines of text as coverage of pixels, drawn by FreeType from a font of the machine.
// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

namespace vkt::render {

/// A line of text: coverage of pixels from 0 to 255, row by row from the top; the base line is `ascent` below it.
struct TextLine {
    int width = 0, height = 0, ascent = 0;
    std::vector<unsigned char> coverage;
};

/// The file of a plain sans serif font: DejaVu, Liberation, Noto and the like, or else the first one in the folders of
/// fonts, by name. Throws Error{failure} if there is none.
std::string default_font();

/// Throws Error{failure} without FreeType, Error{io} for a file that cannot be read and Error{data} for one that is no
/// font. `text` is UTF-8; `pixels` the height of the font's em, in [1, 1000].
TextLine draw_text(std::string const& font, double pixels, std::string const& text);

/// What the module freetype hands to the library.
struct FontFunctions {
    TextLine (*draw)(std::string const& font, double pixels, std::string const& text);
};

} // namespace vkt::render
