// From a source to pictures: volumes that are ready to be drawn, and files that hold their own recipe.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/render.h"
#include "shell/command.h"

#include <memory>
#include <string>
#include <vector>

namespace vkt::shell {

/// The volumes of an input one after the other, one in memory at a time.
class Volumes {
public:
    Volumes(Source& source, Context& context) : source_(source), context_(context), more_(source.next_volume()) {}

    /// Loads the next one; those that are only planned are described and passed over.
    bool next(render::RenderSettings const& settings);
    bool more() const { return more_; }
    render::Renderer const& renderer() const { return *renderer_; }
    Header const& header() const { return header_; }

private:
    Source& source_;
    Context& context_;
    bool more_;
    Header header_;
    std::unique_ptr<render::Renderer> renderer_;
};

struct Picture {
    render::Image const& image;
    render::RenderReport const& report;
    render::Background const& background;
};

/// Writes a PNG file that says which stage drew it from a volume with this header; notes what is remarkable.
void write_picture(std::string const& path, bool force, Picture const& picture, Header const& header,
                   StageInfo const& stage, Context& context);

} // namespace vkt::shell
