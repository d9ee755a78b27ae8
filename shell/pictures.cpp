// Volumes made ready for drawing; PNG files with their metadata.
// SPDX-License-Identifier: MIT
#include "shell/pictures.h"

#include "libvkt/core/text.h"
#include "libvkt/formats/format.h"
#include "libvkt/render/settings.h"

namespace vkt::shell {

bool Volumes::another() {
    while (!another_) {
        another_ = source_.next_volume();
        if (!*another_ || !source_.header().dry_run) break;
        context_.note(text("would render ", source_.header().dims, " voxels into ", width_, "x", height_, " pixels"));
        source_.finish();
        another_.reset();
    }
    return *another_;
}

bool Volumes::next() {
    if (!another()) return false;
    renderer_.reset();
    header_ = source_.header();
    renderer_ = std::make_unique<render::Renderer>(load(source_, context_.execution()), context_.execution());
    another_.reset();
    return true;
}

void write_picture(std::string const& path, bool force, Picture const& picture, Header const& header,
                   StageInfo const& stage, Context& context) {
    render::RenderReport const& r = picture.report;
    auto const png = render::to_png(picture.image, picture.background,
                                    {{"Software", "vkt " VKT_VERSION},
                                     {"History", history_as_shell(history_step(stage, {header}))},
                                     {"Camera", render::camera_text(r.camera)},
                                     {"Method", r.method},
                                     {"Unit distance", to_text(r.unit)},
                                     {"Transfer function", r.transfer}});
    OutputFile file(path, force);
    file.write(png.data(), png.size());
    file.commit();
    if (r.missing > 0) context.note(text(r.missing, " voxels are not a number and show nothing"));
    if (r.infinite > 0) context.note(text(r.infinite, " voxels are infinite and show as the nearest finite value"));
    if (r.capped > 0) context.note(text(r.capped, " paths were cut at the bounce limit"));
    if (context.verbose()) context.note(render::report_text(r));
}

} // namespace vkt::shell
