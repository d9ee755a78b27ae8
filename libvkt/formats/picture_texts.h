// What pictures say of how they were made: as text in PNG, as attributes in OpenEXR.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/history.h"

#include <string>
#include <utility>
#include <vector>

namespace vkt {

/// Keywords and texts.
using PictureTexts = std::vector<std::pair<std::string, std::string>>;

/// Under this keyword a picture keeps its history as the headers of files do.
inline constexpr char history_keyword[] = "vkt history";

/// The program, the history as a shell runs it and as headers have it.
PictureTexts texts_of_history(History const& history);

/// A whole chunk of a PNG file.
std::string png_text_chunk(std::string const& keyword, std::string const& content);
/// A PNG file with texts besides those that it has.
std::string with_png_texts(std::string const& file, PictureTexts const& texts);

} // namespace vkt
