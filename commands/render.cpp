// vkt render: a picture of a volume.
// SPDX-License-Identifier: MIT
#include "libvkt/core/text.h"
#include "libvkt/formats/series.h"
#include "libvkt/render/annotate.h"
#include "libvkt/render/font.h"
#include "libvkt/render/settings.h"
#include "shell/chart/tunable_picture.h"
#include "shell/command.h"
#include "shell/picture/pictures.h"
#include "shell/picture/watching.h"
#include "shell/viewer/scene_of_input.h"

#include "libvkt/core/text.h"

namespace vkt::shell {

namespace {

/// One picture per volume, or a window. The options are those of render::SettingsParameters.
class Render : public Consumer, public TunablePicture {
public:
    void parameters(Parameters& list) override {
        options_.declare(list);
        list.option("depth", depth_, "BITS", "bits a channel: 8 or 16 of PNG, 16 or 32 of OpenEXR (default: 8, 32)")
            .not_in_history();
        annotation_.declare(list);
        list.option("tiles", tiles_, "I/N",
                    "draw part I of N of the picture; vkt image join makes one picture of the parts")
            .not_in_history();
        list.flag("window", window_, "show it in a window, also where standard output is no terminal").not_in_history();
    }
    void check() const override {
        options_.check();
        bool const parts = settings().parts > 1;
        if (parts && annotation_.any())
            throw Error(ErrorKind::usage, "--annotate and --caption are for whole pictures, and --tiles draws parts");
        annotation_.check();
    }
    bool writes() const override { return true; }
    std::vector<std::string> suffixes() const override { return render::picture_suffixes(); }
    void check_file(std::string const& path) const override {
        render::PictureOptions file = picture_options(path);
        if (!tiles_.empty()) file.part.whole_width = file.part.whole_height = 1; // not known yet
        render::check(file, options_.background(), path);
        if (annotation_.any()) // fails before anything is drawn
            render::draw_text(annotation_.font.empty() ? render::default_font() : annotation_.font, 12, "x");
    }
    bool shows() const override { return true; }
    bool needs_whole() const override { return true; }
    bool runs_on_gpu() const override { return true; }
    std::size_t bytes_held(Header const& header, std::string const& output) const override {
        render::RenderSettings const settings = this->settings();
        auto const& environment = settings.environment;
        std::size_t const floats = environment ? environment->pixels.size() + environment->column_ends.size() : 0;
        return render::bytes_to_draw(header, settings.tree) + floats * sizeof(float) +
               render::bytes_of_picture(settings, header, picture_options(output));
    }
    std::vector<std::string> explain(Header const& header, std::string const& output) const override {
        static_cast<void>(settings().clip.resolve(header.dims)); // or it is refused, as drawing will
        auto lines = render::explanation(settings(), header, picture_options(output));
        if (is_numbered(output) && options_.depends_on_data())
            lines.emplace_back("colours, opacities and surfaces that are chosen from the data are those of the first "
                               "volume in all pictures");
        return lines;
    }

    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override {
        render::RenderSettings settings = this->settings();
        render::Background const background = options_.background();
        if (context.window()) {
            if (settings.goal.any())
                throw Error(ErrorKind::usage, "--tolerance, --noise and --time are for pictures that are written",
                            "give -o FILE");
            if (annotation_.any())
                throw Error(ErrorKind::usage, "--annotate and --caption are for pictures that are written",
                            "give -o FILE; in a window, v shows a colour bar, a scale bar and the axes");
            if (options_.cameras().size() > 1 || options_.has_keyframes())
                throw Error(
                    ErrorKind::usage,
                    text(options_.has_keyframes() ? "--keyframes" : "--orbit", " is for pictures that are written"),
                    "give -o picture-%04d.png");
            if (depth_ || settings.parts > 1)
                throw Error(ErrorKind::usage,
                            text("--", depth_ ? "depth" : "tiles", " is for pictures that are written"),
                            "give -o FILE");
            viewer::show_input(*inputs.front(), context, settings, background);
            return 0;
        }
        render::PictureOptions file = picture_options(context.output());
        if (!tiles_.empty()) file.part = {0, render::rows_of_part(settings).first, settings.width, settings.height};
        settings.layers = file.format == render::PictureFormat::exr;
        Volumes volumes(*inputs.front(), context, settings.tree,
                        [&](Header const& header) { return render::bytes_of_picture(settings, header, file); });
        bool const numbered = is_numbered(context.output());
        std::vector<render::CameraRequest> const cameras = options_.cameras();
        render::Insets const insets = render::insets_of(annotation_, settings.width, settings.height);
        if (!numbered && cameras.size() > 1)
            throw Error(
                ErrorKind::usage,
                text(options_.has_keyframes() ? "--keyframes" : "--orbit", " makes several pictures, but -o names one"),
                "give a place for the number: -o picture-%04d.png");
        for (std::int64_t number = 0; volumes.next();) {
            // Of a series the first one decides, so that the others can be compared with it.
            if (!settings.chosen_from)
                settings.chosen_from = std::make_shared<render::Histogram const>(volumes.renderer().histogram());
            for (render::CameraRequest const& camera : cameras) {
                settings.camera = camera;
                settings.camera.insets = insets;
                render::RenderReport report;
                Watching const watching(context);
                render::Image image = volumes.renderer().watched(settings, &report, watching.watch());
                if (image.pixels.empty()) {
                    context.lossy("interrupted before anything was drawn: no picture is written");
                    return Watching::exit_code;
                }
                // A number leaves room for whatever follows; a single name does not, and then no file is to appear.
                if (!numbered && volumes.another())
                    throw Error(ErrorKind::usage, "the input holds several volumes, but -o names one picture",
                                "give a place for the number: -o picture-%04d.png");
                if (annotation_.any()) render::annotate(image, report, volumes.header(), background, annotation_);
                write_picture(numbered_path(context.output(), number++), context.force(),
                              {image, report, background, settings.goal, file}, volumes.header(), context.stage_info(),
                              context);
                if (report.quality.stopped) return Watching::exit_code;
            }
        }
        return 0;
    }

private:
    render::RenderSettings settings() const {
        render::RenderSettings settings = options_.settings();
        if (tiles_.empty()) return settings;
        auto const words = split(tiles_, '/');
        auto const count = [&](std::string const& word) {
            bool const fits =
                !word.empty() && word.size() < 6 && word.find_first_not_of("0123456789") == std::string::npos;
            if (words.size() != 2 || !fits)
                throw Error(ErrorKind::usage, text("--tiles '", tiles_, "' is not I/N"), "for example --tiles 1/4");
            return static_cast<int>(parse_integer(word));
        };
        settings.part = count(words.front());
        settings.parts = count(words.back());
        render::check(settings);
        return settings;
    }
    render::PictureOptions picture_options(std::string const& path) const {
        return {render::picture_format(path), depth_.value_or(0), {}};
    }
    render::Annotation annotation_;
    std::optional<int> depth_;
    std::string tiles_;
    bool window_ = false; ///< of interest to the framework only
};

} // namespace

Command render_command() {
    return consumer_command<Render>(
        {"Make a picture of a volume.",
         "Rays are marched through the volume (absorption and emission), meet its iso-surfaces, or are scattered in it "
         "as light "
         "in a cloud. Without options the colours, opacities and the camera are chosen from the data. The picture is a "
         "PNG file (.png), OpenEXR (.exr: linear light, with layers such as the distance) or PFM (.pfm); the first two "
         "hold their own recipe. Without -o, on a terminal, or with --window, a window shows the volume instead, "
         "as "
         "soon as its first slices are there: drag to turn it, drag with the right button or with shift to move it, "
         "wheel to zoom; panels beside it edit transfer function, surfaces, integrator, camera and clip box; keys h "
         "(all keys), s (save), p (print the command that draws what is seen), q (quit).\n\n"
         "Hierarchical (AMR) volumes are drawn as they are, by every algorithm; marched with steps as long as their "
         "cells are large.",
         {{"In a window, everything chosen from the data", "vkt render volume.nrrd"},
          {"The same as a picture", "vkt render volume.nrrd -o picture.png"},
          {"From the right, own opacities over the value range",
           "vkt render volume.nrrd --view x --colormap viridis --opacity 0,0.02,0.1,0.6 -o "
           "picture.png"},
          {"An iso-surface", "vkt render volume.nrrd --render-algo implicit-iso --iso 60 -o picture.png"},
          {"An AMR volume",
           "vkt make amr --blocks 300 --levels 4 | vkt render --opacity 0,0.3 --domain 0:1 -o amr.png"},
          {"Light scattered in it, as in a cloud", "vkt make amr --blocks 300 --levels 4 | vkt render --render-algo "
                                                   "multi-scattering --spp 16 --size 256 -o amr.png"},
          {"Lit from a side, with shadows", "vkt render volume.nrrd --light-direction 1,-1,2 --shadows -o lit.png"},
          {"Cut by a plane", "vkt render volume.nrrd --clip-plane 1 1 0 0 -o cut.png"},
          {"16 bits a channel", "vkt render volume.nrrd --depth 16 -o picture.png"},
          {"Multiple scattering, quickly", "vkt render volume.nrrd --render-algo "
                                           "multi-scattering --spp 16 --size 256 -o picture.png"}}});
}

} // namespace vkt::shell
