// vkt render: a picture of a volume.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/series.h"
#include "libvkt/render/settings.h"
#include "shell/command.h"
#include "shell/pictures.h"
#include "shell/viewer/viewer.h"

#include "libvkt/core/text.h"

namespace vkt::shell {

namespace {

/// What the window asks for.
class WindowScene : public viewer::Scene {
public:
    WindowScene(Volumes& volumes, Context& context, render::RenderSettings asked, render::Background background)
        : volumes_(volumes), context_(context), asked_(std::move(asked)), background_(background) {}

    std::string name() const override { return text(input(), " (", volumes_.header().dims, ")"); }
    render::Image draw(render::RenderSettings const& settings, render::RenderReport& report,
                       std::stop_token const& stop) override {
        return volumes_.renderer().render(settings, &report, stop);
    }
    std::string save(render::Image const& image, render::RenderReport const& report,
                     viewer::View const& view) override {
        std::string path = viewer::free_picture_name(input());
        StageInfo stage = context_.stage_info();
        stage.words = viewer::words_of(stage.words, asked_, view);
        write_picture(path, false, {image, report, background_}, volumes_.header(), stage, context_);
        return path;
    }
    bool next() override { return volumes_.next(); }

private:
    std::string input() const {
        std::string const name = context_.stage_info().input_names.front();
        return name == "-" ? "volume" : name.substr(name.rfind('/') + 1);
    }

    Volumes& volumes_;
    Context& context_;
    render::RenderSettings asked_;
    render::Background background_;
};

/// One picture per volume, or a window. The options are those of render::SettingsParameters.
class Render : public Consumer {
public:
    void parameters(Parameters& list) override { options_.declare(list); }
    void check() const override { options_.check(); }
    bool writes() const override { return true; }
    std::vector<std::string> suffixes() const override { return {".png"}; }
    bool shows() const override { return true; }
    bool needs_whole() const override { return true; }
    bool runs_on_gpu() const override { return true; }
    std::size_t bytes_held(Header const& header) const override { return bytes_to_draw(header); }
    std::vector<std::string> explain(Header const& header) const override {
        return explanation(options_.settings(), header);
    }

    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override {
        render::RenderSettings const settings = options_.settings();
        render::Background const background = options_.background();
        Volumes volumes(*inputs.front(), context);
        if (context.window()) {
            WindowScene scene(volumes, context, settings, background);
            if (scene.next())
                viewer::show(scene, settings, background, [&](std::string const& line) { context.note(line); });
            return 0;
        }
        bool const numbered = is_numbered(context.output());
        for (std::int64_t number = 0; volumes.next(); ++number) {
            render::RenderReport report;
            render::Image const image = volumes.renderer().render(settings, &report);
            // A number leaves room for whatever follows; a single name does not, and then no file is to appear.
            if (!numbered && volumes.another())
                throw Error(ErrorKind::usage, "the input holds several volumes, but -o names one picture",
                            "give a place for the number: -o picture-%04d.png");
            write_picture(numbered_path(context.output(), number), context.force(), {image, report, background},
                          volumes.header(), context.stage_info(), context);
        }
        return 0;
    }

private:
    render::SettingsParameters options_;
};

} // namespace

Command render_command() {
    return consumer_command<Render>(
        {"Make a picture of a volume.",
         "Rays are marched through the volume (absorption and emission), meet its iso-surfaces, or are scattered in it "
         "as light "
         "in a cloud. Without options the colours, opacities and the camera are chosen from the data. The picture is a "
         "PNG file "
         "that holds its own recipe. Without -o, on a terminal, a window shows the volume instead: drag to turn it, "
         "drag with the right button or with shift to move it, wheel to zoom; keys r (reset), c (next colours), s "
         "(save), n (next volume), q (quit).\n\n"
         "Hierarchical (AMR) volumes are marched as they are, with steps as long as their cells are large; the other "
         "algorithms take what vkt resample makes of them.",
         {{"In a window, everything chosen from the data", "vkt render volume.nrrd"},
          {"The same as a picture", "vkt render volume.nrrd -o picture.png"},
          {"From the right, own opacities over the value range",
           "vkt render volume.nrrd --view x --colormap viridis --opacity 0,0.02,0.1,0.6 -o "
           "picture.png"},
          {"An iso-surface", "vkt render volume.nrrd --render-algo implicit-iso --iso 60 -o picture.png"},
          {"An AMR volume",
           "vkt make amr --blocks 300 --levels 4 | vkt render --opacity 0,0.3 --domain 0:1 -o amr.png"},
          {"Multiple scattering, quickly", "vkt render volume.nrrd --render-algo "
                                           "multi-scattering --spp 16 --size 256 -o picture.png"}}});
}

} // namespace vkt::shell
