// vkt stack: slices to a volume, volumes to a series.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/stack.h"
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
        p.flag("force-uniform", force_uniform_, "in the order named, wherever the inputs lie in the world");
    }
    bool reads() const override { return true; }
    std::vector<std::string> input_names() const override { return paths_; }

    std::unique_ptr<Source> open(Context& context) override {
        std::vector<std::string> files;
        for (std::string const& path : paths_)
            for (auto const& file : matching_files(path)) files.push_back(file);
        return stacked(
            files, [&context](std::string const& path) { return context.open(path); }, along_, force_uniform_,
            context.stage_info());
    }

private:
    std::vector<std::string> paths_;
    std::optional<StackAxis> along_;
    bool force_uniform_ = false;
};

} // namespace

Command stack_command() {
    return opener_command<Stack>(
        {"Put slices together to a volume, or volumes to a series.",
         "As numpy.stack does, what is stacked gets one more axis: single slices make a volume, volumes a series, one "
         "after another. --along z puts volumes on one another. Slices that say where they lie must be in order and "
         "evenly spaced, and give the spacing; others keep the spacing that they have.",
         {{"Slices to a volume", "vkt split volume.nrrd -o 'slice%03d.png' && vkt stack 'slice*.png' -o again.nrrd"},
          {"Volumes to a series",
           "vkt filter median volume.nrrd --radius 1 -o smooth.nrrd && vkt stack volume.nrrd smooth.nrrd -o "
           "series.nrrd"},
          {"Volumes on one another",
           "vkt crop volume.nrrd --roi :,:,:10 -o a.nrrd && vkt crop volume.nrrd --roi :,:,10: -o b.nrrd && vkt stack "
           "a.nrrd b.nrrd --along z | vkt diff - volume.nrrd"}}});
}

} // namespace vkt::shell
