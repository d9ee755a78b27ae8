// What drawing a volume takes, known from its header alone.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/header.h"
#include "libvkt/render/picture_file.h"
#include "libvkt/render/render.h"

#include <string>
#include <vector>

namespace vkt::render {

/// Throws Error{resources} if drawing such a volume, and a picture that takes so many bytes, take more than the budget,
/// Error{usage} for bricks of a grid, Error{data} for voxels too small or large for floats. Small integers of files are
/// read to where rays sample them; `copied`: they are somewhere else before.
void check_memory(Header const& header, Execution const& execution, TreeDrawing tree = TreeDrawing::automatic,
                  bool copied = false, std::size_t picture = 0);

/// What a picture takes while it is drawn and written: its light, what the algorithm holds of each pixel besides, its
/// layers, and the file, if that cannot be compressed.
std::size_t bytes_of_picture(RenderSettings const& settings, Header const& header, PictureOptions const& file);

/// What a volume takes at least until it is drawn: its voxels and what a renderer makes of them.
std::size_t bytes_to_draw(Header const& header, TreeDrawing tree = TreeDrawing::automatic, bool copied = false);

/// True for hierarchical volumes that are drawn as a grid, or would be if they had no holes: those that take no more
/// so, and, with room in so much memory, those that do not take much more, which is faster.
bool drawn_as_grid(Header const& header, TreeDrawing tree, std::size_t memory);

/// What is left of the budget for blocks of a hierarchical volume that is drawn by bricks: they make it faster.
std::size_t memory_for_blocks(Header const& header, Execution const& execution);

/// Model, method and cost of a picture of such a volume, a line each.
std::vector<std::string> explanation(RenderSettings const& settings, Header const& header, PictureOptions const& file);

} // namespace vkt::render
