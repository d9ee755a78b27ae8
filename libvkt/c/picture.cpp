// Pictures of the C API.
// SPDX-License-Identifier: MIT
#include "libvkt/c/call.h"
#include "libvkt/c/volume.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/registry.h"
#include "libvkt/render/annotate.h"
#include "libvkt/render/cost.h"
#include "libvkt/render/render.h"
#include "libvkt/render/settings.h"

#include <algorithm>
#include <atomic>
#include <optional>
#include <string>
#include <utility>
#include <vector>

struct vkt_picture {
    int width = 0, height = 0;
    std::vector<unsigned char> bytes{};
    std::vector<float> light{};
    std::vector<std::byte> png{};
    std::string remarks{}, report{};
};

using namespace vkt;
using namespace vkt::c;

namespace {

/// The picture, whoever watches it coming.
render::Image image_of(Volume const& volume, render::RenderSettings const& settings, Execution const& execution,
                       render::RenderReport& report) {
    ProgressMonitor* const monitor = execution.monitor;
    if (monitor == nullptr) return render::render(volume, settings, execution, &report);
    std::optional<render::Renderer> renderer;
    {
        ProgressPart const preparation(monitor, 0.0, 0.1);
        renderer.emplace(volume, execution, settings.tree);
    }
    ProgressPart const drawing(monitor, 0.1, 0.9);
    std::atomic<bool> cancelled{false};
    render::Watch watch;
    watch.stop = [&] { return cancelled.load(); };
    watch.progress = [&](render::Progress const& progress) {
        try {
            monitor->poll(static_cast<std::int64_t>(1000 * progress.share), 1000);
        } catch (Error const&) {
            cancelled = true; // threads that draw leave their loop first
        }
    };
    render::Image image = renderer->watched(settings, &report, watch);
    monitor->poll(1, 1);
    return image;
}

vkt_picture drawn(Volume const& volume, char const* const* words, size_t count, Call& call) {
    render::SettingsParameters options;
    Parameters own, shared;
    ExecutionOptions for_execution = call.policy();
    render::Annotation annotation;
    options.declare(own);
    annotation.declare(own);
    for_execution.declare(shared);
    read_options(words, count, {&own, &shared});
    options.check();
    annotation.check();
    if (options.cameras().size() > 1)
        throw Error(ErrorKind::usage, "--orbit and --keyframes make several pictures, and this call makes one",
                    "give each camera in a call of its own");
    Execution const execution = call.execution(for_execution);
    render::RenderSettings settings = options.settings();
    settings.camera.insets = render::insets_of(annotation, settings.width, settings.height);
    render::check_memory(volume.header(), execution, settings.tree, true,
                         render::bytes_of_picture(settings, volume.header(), {}));
    render::RenderReport report;
    render::Image image = image_of(volume, settings, execution, report);
    if (annotation.any()) render::annotate(image, report, volume.header(), settings.background, annotation);
    vkt_picture picture{image.width, image.height};
    std::vector<unsigned char> const shown = render::to_bytes(image, settings.background);
    std::size_t const pixels = image.pixels.size() / 4, channels = shown.size() / pixels;
    picture.bytes.resize(4 * pixels, 255);
    for (std::size_t i = 0; i < pixels; ++i) std::copy_n(&shown[channels * i], channels, &picture.bytes[4 * i]);
    StageInfo info;
    info.name = "render";
    info.words = history_words(info.name, own, {"-"}, false);
    info.input_names = {"-"};
    History const history = folded(history_step(info, {volume.header()}));
    std::vector<std::pair<std::string, std::string>> texts{{"Software", "vkt " VKT_VERSION},
                                                           {"History", history_as_shell(history)}};
    for (auto& entry : render::texts_of(report, settings.goal)) texts.push_back(std::move(entry));
    picture.png = render::to_png(image, settings.background, texts);
    picture.light = std::move(image.pixels);
    for (std::size_t i = 3; i < picture.light.size(); i += 4) picture.light[i] = 1 - picture.light[i];
    picture.remarks = printable(join(render::remarks_of(report, settings.goal), "; "));
    picture.report = render::report_text(report);
    return picture;
}

} // namespace

vkt_status vkt_render(vkt_volume const* volume, char const* const* words, size_t count, vkt_picture** picture) {
    return guarded([&](Call& call) {
        need(volume, "volume");
        need(picture, "picture");
        *picture = new vkt_picture(drawn(volume->volume, words, count, call));
    });
}
int vkt_picture_width(vkt_picture const* picture) { return picture == nullptr ? 0 : picture->width; }
int vkt_picture_height(vkt_picture const* picture) { return picture == nullptr ? 0 : picture->height; }
unsigned char const* vkt_picture_bytes(vkt_picture const* picture) {
    return picture == nullptr ? nullptr : picture->bytes.data();
}
float const* vkt_picture_light(vkt_picture const* picture) {
    return picture == nullptr ? nullptr : picture->light.data();
}
char const* vkt_picture_remarks(vkt_picture const* picture) {
    return picture == nullptr ? "" : picture->remarks.c_str();
}
char const* vkt_picture_report(vkt_picture const* picture) { return picture == nullptr ? "" : picture->report.c_str(); }
vkt_status vkt_picture_png(vkt_picture const* picture, void const** bytes, size_t* size) {
    return guarded([&](Call&) {
        need(picture, "picture");
        need(bytes, "bytes");
        need(size, "size");
        *bytes = picture->png.data();
        *size = picture->png.size();
    });
}
void vkt_free_picture(vkt_picture* picture) { delete picture; }
