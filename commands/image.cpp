// vkt image: pictures averaged, compared, and put together from parts.
// SPDX-License-Identifier: MIT
#include "libvkt/core/report.h"
#include "libvkt/formats/series.h"
#include "libvkt/operations/statistics/compare_pictures.h"
#include "libvkt/render/combine.h"
#include "shell/command.h"
#include "shell/picture/pictures.h"

namespace vkt::shell {
namespace {

class OfPictures : public Consumer {
public:
    void parameters(Parameters& p) override { p.positional("picture", names_, "PNG, OpenEXR or PFM files, or '-'"); }
    int inputs() const override { return 0; }
    std::vector<std::string> input_names() const override {
        return names_.empty() ? std::vector<std::string>{"-"} : names_;
    }
    bool opens_inputs() const override { return true; }

protected:
    std::vector<render::PictureContents> pictures() const {
        std::vector<render::PictureContents> all;
        for (std::string const& name : names_)
            for (std::string const& file : matching_files(name)) all.push_back(render::read_picture(*open_bytes(file)));
        return all;
    }

    std::vector<std::string> names_;
};

class Combine : public OfPictures {
public:
    void parameters(Parameters& p) override {
        OfPictures::parameters(p);
        p.option("depth", depth_, "BITS", "bits a channel: 8 or 16 of PNG, 16 or 32 of OpenEXR").not_in_history();
    }
    bool writes() const override { return true; }
    std::vector<std::string> suffixes() const override { return render::picture_suffixes(); }
    void check_file(std::string const& path) const override { render::check(options(path), {{}, 1}, path); }

protected:
    void write(render::PictureContents const& picture, Context& context, bool keeps_depth = false) const {
        render::PictureOptions file = options(context.output());
        file.part = picture.options.part;
        if (keeps_depth && !depth_ && file.format == picture.options.format) file.depth = picture.options.depth;
        write_combined(context.output(), picture, file, context);
    }

private:
    render::PictureOptions options(std::string const& path) const {
        return {render::picture_format(path), depth_.value_or(0), {}};
    }

    std::optional<int> depth_;
};

class Mean : public Combine {
public:
    int consume(std::vector<std::unique_ptr<Source>>&, Context& context) override {
        std::vector<render::PictureContents> const all = pictures();
        render::PictureContents mean = render::mean_of(all);
        mean.texts = with_history(mean.texts, all, context.stage_info());
        write(mean, context);
        return 0;
    }
};

class Join : public Combine {
public:
    int consume(std::vector<std::unique_ptr<Source>>&, Context& context) override {
        write(render::join_of(pictures()), context, true);
        return 0;
    }
};

class Difference : public OfPictures {
public:
    void parameters(Parameters& p) override {
        OfPictures::parameters(p);
        p.option("tolerance", tolerance_, "T", "largest difference of light that counts as equal (0)");
    }
    bool reports() const override { return true; }
    void check() const override {
        if (!(tolerance_ >= 0)) throw Error(ErrorKind::usage, text("--tolerance: ", tolerance_, " is negative"));
        if (names_.size() != 2)
            throw Error(ErrorKind::usage, text("two pictures are compared, not ", names_.size()),
                        "name the reference first");
    }
    int consume(std::vector<std::unique_ptr<Source>>&, Context& context) override {
        auto const read = [](std::string const& name) { return render::read_picture(*open_bytes(name)); };
        render::PictureContents const reference = read(names_[0]), test = read(names_[1]);
        bool const same_size = reference.image.width == test.image.width && reference.image.height == test.image.height;
        Report report;
        render::PictureDifference d;
        if (same_size) {
            d = render::compare_pictures(reference.image, test.image, context.execution());
            report.add("max_abs", d.max_abs).add("rmse", d.rmse).add("relmse", d.relmse);
            report.add("levels", d.levels).add("ssim", d.ssim).add("flip", d.flip);
        } else {
            context.note("the pictures differ in size");
        }
        report.add("same_size", same_size);
        context.print(context.json() ? report.json() + "\n" : report.text());
        return same_size && d.max_abs <= tolerance_ ? 0 : 1;
    }

private:
    double tolerance_ = 0;
};

} // namespace

Command image_command() {
    Command command;
    command.texts = {"Average, compare and join pictures.",
                     "Pictures are PNG, OpenEXR or PFM files. Light is linear: sRGB is decoded before it is computed "
                     "with, and encoded afterwards.",
                     {{"Two halves of the paths, on two machines",
                       "vkt render volume.nrrd -ra multi-scattering --spp 2 --size 32 -o a.png && vkt render "
                       "volume.nrrd -ra multi-scattering --spp 2 --first-sample 2 --size 32 -o b.png && "
                       "vkt image mean a.png b.png -o mean.png && vkt history mean.png"}}};
    command.verbs = {
        {"diff", consumer_command<Difference>(
                     {"Compare two pictures.",
                      "The first one is the reference. Exit code 0 if no channel of a pixel differs by more than the "
                      "tolerance, 1 if one does or if the sizes differ.",
                      {{"What do longer steps cost?",
                        "vkt render volume.nrrd --size 64 -o fine.png && vkt render volume.nrrd --size 64 --step 1 -o "
                        "coarse.png && vkt image diff fine.png coarse.png --tolerance 1"}}})},
        {"join", consumer_command<Join>(
                     {"Put the parts of a picture together.",
                      "Bit for bit the picture that vkt render without --tiles makes.",
                      {{"Two machines, half a picture each",
                        "vkt render volume.nrrd --tiles 1/2 -o part-1.png && vkt render volume.nrrd --tiles 2/2 -o "
                        "part-2.png && vkt image join part-1.png part-2.png -o whole.png"}}})},
        {"mean",
         consumer_command<Mean>(
             {"Average pictures of the same.",
              "Pictures of multiple scattering are weighted by their paths a pixel, as their texts tell them; they "
              "must be made of different paths (--first-sample or --seed of vkt render).",
              {{"Paths with other seeds",
                "vkt render volume.nrrd -ra multi-scattering --spp 4 --size 32 --seed 1 -o s1.png && vkt render "
                "volume.nrrd -ra multi-scattering --spp 8 --size 32 --seed 2 -o s2.png && vkt image mean s1.png "
                "s2.png -o s.png"}}})}};
    return command;
}

} // namespace vkt::shell
