// From a source to pictures: volumes that are ready to be drawn, and files that hold their own recipe.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/cost.h"
#include "libvkt/render/picture_file.h"
#include "libvkt/render/render.h"
#include "shell/command.h"

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace vkt::shell {

/// The volumes of an input one after the other, one in memory at a time.
class Volumes {
public:
    /// `picture`: what one of such a volume takes.
    Volumes(Source& source, Context& context, render::TreeDrawing tree,
            std::function<std::size_t(Header const&)> picture)
        : source_(source), context_(context), tree_(tree), picture_(std::move(picture)) {}

    /// Whether one more follows. Waits for its header, so that whoever can do without knowing had better not ask. Those
    /// that are only planned are described and passed over.
    bool another();
    /// Moves on to the next one without loading it. Throws Error{resources} beyond the budget.
    bool open();
    /// Goes back: the volume with this number, from 0, is next, if the input can be had once more.
    bool rewind_to(std::int64_t volume);
    /// Loads the next one; without one, the last one stays. Throws the same.
    bool next();
    render::Renderer const& renderer() const { return *renderer_; }
    Header const& header() const { return header_; }

private:
    void read_all(AnyView const& to);

    Source& source_;
    Context& context_;
    render::TreeDrawing tree_;
    std::function<std::size_t(Header const&)> picture_;
    std::optional<bool> another_; ///< once it is known
    Header header_;
    std::unique_ptr<render::Renderer> renderer_;
};

/// Whether the bytes begin a PNG, PFM or OpenEXR file.
bool is_picture(ByteSource& bytes);
/// A volume without voxels that has the history in a picture that write_picture() wrote, or none. Throws Error{data}
/// for files that are cut off or damaged.
std::unique_ptr<Source> picture_source(std::unique_ptr<ByteSource> bytes);

struct Picture {
    render::Image const& image;
    render::RenderReport const& report;
    render::Background const& background;
    render::Goal goal;
    render::PictureOptions options; ///< a PNG file unless it says otherwise
};

/// Writes a file that says which stage drew it from a volume with this header; notes what is remarkable.
void write_picture(std::string const& path, bool force, Picture const& picture, Header const& header,
                   StageInfo const& stage, Context& context);

/// The texts with the history of a picture that this stage made of others.
render::PictureTexts with_history(render::PictureTexts const& texts, std::vector<render::PictureContents> const& others,
                                  StageInfo const& stage);

/// Writes what was made of other pictures, as the options say; a dry run only tells of it.
void write_combined(std::string const& path, render::PictureContents const& picture,
                    render::PictureOptions const& options, Context& context);

} // namespace vkt::shell
