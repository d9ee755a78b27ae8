// The module freetype: lines of text from a font's outlines.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/module.h"
#include "libvkt/render/font.h"

#include <ft2build.h>
#include FT_FREETYPE_H

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>

namespace vkt::render {
namespace {

/// Code points; what is no UTF-8 becomes U+FFFD.
std::vector<std::uint32_t> code_points(std::string const& text) {
    std::vector<std::uint32_t> points;
    for (std::size_t i = 0; i < text.size();) {
        auto const first = static_cast<unsigned char>(text[i]);
        std::size_t const more = first < 0x80 ? 0 : first >= 0xf0 ? 3 : first >= 0xe0 ? 2 : first >= 0xc0 ? 1 : 4;
        std::uint32_t point = more == 0 ? first : first & (0x3fU >> more);
        bool good = more < 4 && i + more < text.size();
        for (std::size_t k = 1; good && k <= more; ++k) {
            auto const next = static_cast<unsigned char>(text[i + k]);
            good = (next & 0xc0) == 0x80;
            point = point << 6 | (next & 0x3fU);
        }
        points.push_back(good ? point : 0xfffd);
        i += good ? more + 1 : 1;
    }
    return points;
}

using Library = std::unique_ptr<FT_LibraryRec_, decltype(&FT_Done_FreeType)>;
using Face = std::unique_ptr<FT_FaceRec_, decltype(&FT_Done_Face)>;

TextLine draw(std::string const& font, double pixels, std::string const& text) {
    FT_Library bare = nullptr;
    if (FT_Init_FreeType(&bare) != 0) throw Error(ErrorKind::resources, "FreeType does not start");
    Library const library(bare, &FT_Done_FreeType);
    FT_Face opened = nullptr;
    if (FT_Error const code = FT_New_Face(library.get(), font.c_str(), 0, &opened); code != 0)
        throw Error(
            code == FT_Err_Cannot_Open_Resource ? ErrorKind::io : ErrorKind::data,
            vkt::text("the font '", font, "' cannot be ", code == FT_Err_Cannot_Open_Resource ? "opened" : "read"));
    Face const face(opened, &FT_Done_Face);
    if (FT_Set_Char_Size(face.get(), 0, std::lround(64 * pixels), 72, 72) != 0)
        throw Error(ErrorKind::data, vkt::text("the font '", font, "' has no outlines"));
    auto const whole = [](FT_Pos p) { return static_cast<int>((p + 32) >> 6); };
    TextLine line;
    line.ascent = whole(face->size->metrics.ascender);
    line.height = line.ascent - whole(face->size->metrics.descender);
    // Twice: how wide it is, then the pixels.
    for (bool const drawing : {false, true}) {
        FT_Pos pen = 0;
        FT_UInt before = 0;
        if (drawing)
            line.coverage.assign(static_cast<std::size_t>(line.width) * static_cast<std::size_t>(line.height), 0);
        for (std::uint32_t const point : code_points(text)) {
            FT_UInt const glyph = FT_Get_Char_Index(face.get(), point);
            FT_Vector kerning{};
            if (before != 0) FT_Get_Kerning(face.get(), before, glyph, FT_KERNING_UNFITTED, &kerning);
            pen += kerning.x;
            before = glyph;
            if (FT_Load_Glyph(face.get(), glyph, FT_LOAD_NO_HINTING | FT_LOAD_NO_BITMAP) != 0 ||
                FT_Render_Glyph(face->glyph, FT_RENDER_MODE_NORMAL) != 0)
                throw Error(ErrorKind::data, vkt::text("a glyph of the font '", font, "' is damaged"));
            FT_Bitmap const& bitmap = face->glyph->bitmap;
            int const x0 = whole(pen) + face->glyph->bitmap_left, y0 = line.ascent - face->glyph->bitmap_top;
            int const columns = static_cast<int>(bitmap.width), rows = static_cast<int>(bitmap.rows);
            if (!drawing) line.width = std::max(line.width, x0 + columns);
            for (int y = std::max(0, -y0); drawing && y < std::min(rows, line.height - y0); ++y)
                for (int x = std::max(0, -x0); x < std::min(columns, line.width - x0); ++x) {
                    unsigned char& to =
                        line.coverage[static_cast<std::size_t>(y0 + y) * static_cast<std::size_t>(line.width) +
                                      static_cast<std::size_t>(x0 + x)];
                    to = std::max(to, bitmap.buffer[y * bitmap.pitch + x]);
                }
            pen += face->glyph->advance.x;
        }
        if (!drawing) line.width = std::max(line.width, whole(pen));
    }
    return line;
}

constexpr FontFunctions functions{draw};

} // namespace
} // namespace vkt::render

extern "C" {
__attribute__((visibility("default"))) extern vkt::ModuleExport const vkt_module_freetype;
vkt::ModuleExport const vkt_module_freetype{VKT_VERSION, &vkt::render::functions, nullptr};
}
