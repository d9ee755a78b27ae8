// vkt render: a picture of a volume.
// SPDX-License-Identifier: MIT
#include "libvkt/render/settings.h"
#include "shell/command.h"

#include "libvkt/core/text.h"
#include "libvkt/formats/format.h"

namespace vkt::shell {

namespace {

/// One picture per volume. The options are those of render::SettingsParameters.
class Render : public Consumer {
public:
    void parameters(Parameters& list) override { options_.declare(list); }
    void check() const override { (void)options_.settings(); }
    bool writes() const override { return true; }

    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override {
        render::RenderSettings const settings = options_.settings();
        Source& source = *inputs.front();
        bool more = source.next_volume();
        for (std::int64_t number = 0; more; ++number) {
            if (source.header().dry_run) {
                context.note(text("would render ", source.header().dims, " voxels into ", settings.width, "x",
                                  settings.height, " pixels"));
                source.finish();
                more = source.next_volume();
                continue;
            }
            Volume const volume = load(source, context.execution());
            render::RenderReport report;
            render::Image const image = render::render(volume, settings, context.execution(), &report);
            more = source.next_volume();
            std::string const path = render::numbered(context.output(), number, more || number > 0);
            write(path, image, volume.header(), report, context);
            tell(report, context);
        }
        return 0;
    }

private:
    void write(std::string const& path, render::Image const& image, Header const& header,
               render::RenderReport const& report, Context& context) const {
        History history{context.stage_info().words, {}};
        if (header.history) history.inputs.push_back(*header.history);
        auto const png = render::to_png(image, options_.background(),
                                        {{"Software", "vkt " VKT_VERSION},
                                         {"History", history_as_shell(history)},
                                         {"Camera", render::camera_text(report.camera)},
                                         {"Method", report.method},
                                         {"Unit distance", to_text(report.unit)},
                                         {"Transfer function", report.transfer}});
        OutputFile file(path, context.force());
        file.write(png.data(), png.size());
        file.commit();
    }

    static void tell(render::RenderReport const& r, Context& context) {
        if (r.missing > 0) context.note(text(r.missing, " voxels are not a number and show nothing"));
        if (r.infinite > 0) context.note(text(r.infinite, " voxels are infinite and show as the nearest finite value"));
        if (r.capped > 0) context.note(text(r.capped, " paths were cut at the bounce limit"));
        if (context.verbose()) context.note(render::report_text(r));
    }

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
         "that holds its own recipe.",
         {{"A picture, everything chosen from the data", "vkt render $DATA/raw/fuel_64x64x64_uint8.raw -o fuel.png"},
          {"From the right, own opacities over the value range",
           "vkt render $DATA/raw/fuel_64x64x64_uint8.raw --view x --colormap viridis --opacity 0,0.02,0.1,0.6 -o "
           "fuel.png"},
          {"An iso-surface",
           "vkt render $DATA/raw/fuel_64x64x64_uint8.raw --render-algo implicit-iso --iso 60 -o fuel.png"},
          {"Multiple scattering, quickly", "vkt render $DATA/raw/fuel_64x64x64_uint8.raw --render-algo "
                                           "multi-scattering --spp 16 --size 256 -o fuel.png"}}});
}

} // namespace vkt::shell
