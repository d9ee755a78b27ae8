// vkt stack: slices to a volume, volumes to a series.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/stack.h"
#include "libvkt/core/error.h"
#include "libvkt/formats/series.h"
#include "shell/command.h"

namespace vkt::shell {
namespace {

class Stack : public Opener {
public:
    void parameters(Parameters& p) override {
        p.positional("in", paths_, "inputs in their order: files, patterns in quotes, '-'");
        p.option("along", along_, "AXIS",
                 "z: one volume; series: one after another (default: z for single slices, series for volumes)");
        p.flag("force-uniform", force_uniform_,
               "in the order named, wherever the inputs lie in the world; of DICOM images in that of their places");
        p.option("variable", variable_, "NAME", "of DICOM images of several series, the one to stack");
    }
    bool reads() const override { return true; }
    std::vector<std::string> input_names() const override { return paths_; }

    std::unique_ptr<Source> open(Context& context) override {
        std::vector<std::string> files;
        for (std::string const& path : paths_)
            for (auto const& file : matching_files(path)) files.push_back(file);
        StageInfo const info = with_inputs(context.stage_info(), files);
        if (along_ != StackAxis::series) {
            auto const open = [&context](std::string const& first, ReadOptions const& together) {
                return context.open(first, together);
            };
            if (auto source = stacked_dicom(files, open, variable_, force_uniform_, context.stage_info()))
                return source;
        }
        if (!variable_.empty())
            throw Error(ErrorKind::usage,
                        "--variable chooses one of several series of DICOM images, which these are not");
        return stacked(
            files, [&context](std::string const& path) { return context.open(path); }, along_, force_uniform_, info);
    }

private:
    std::vector<std::string> paths_;
    std::optional<StackAxis> along_;
    std::string variable_;
    bool force_uniform_ = false;
};

} // namespace

Command stack_command() {
    return opener_command<Stack>(
        {"Put slices together to a volume, or volumes to a series.",
         "As numpy.stack does, what is stacked gets one more axis: single slices make a volume, volumes a series, one "
         "after another. --along z puts volumes on one another. Slices that say where they lie must be in order and "
         "evenly spaced, and give the spacing; others keep the spacing that they have. DICOM images are sorted by "
         "their places "
         "and checked as those of a folder are, in whatever order they are named.",
         {{"Slices to a volume", "vkt split volume.nrrd -o 'slice%03d.png' && vkt stack 'slice*.png' -o again.nrrd"},
          {"Volumes to a series",
           "vkt filter median volume.nrrd --radius 1 -o smooth.nrrd && vkt stack volume.nrrd smooth.nrrd -o "
           "series.nrrd"},
          {"Volumes on one another",
           "vkt crop volume.nrrd --roi :,:,:10 -o a.nrrd && vkt crop volume.nrrd --roi :,:,10: -o b.nrrd && vkt stack "
           "a.nrrd b.nrrd --along z | vkt diff - volume.nrrd"}}});
}

} // namespace vkt::shell
