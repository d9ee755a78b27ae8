// vkt merge: bricks put together again.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/series.h"
#include "libvkt/operations/bricks/merge_bricks.h"
#include "shell/command.h"

#include <filesystem>

namespace vkt::shell {
namespace {

class Merge : public Opener {
public:
    void parameters(Parameters& p) override {
        p.positional("in", paths_, "a directory of bricks, a manifest (.json), files, or a stream of bricks ('-')")
            .optional();
    }
    bool reads() const override { return true; }
    std::vector<std::string> input_names() const override {
        return paths_.empty() ? std::vector<std::string>{"-"} : paths_;
    }

    std::unique_ptr<Source> open(Context& context) override {
        std::vector<BrickFile> files;
        for (std::string const& path : input_names()) {
            bool const manifest = std::filesystem::is_directory(path) || lower_case(path).ends_with(".json");
            if (manifest && paths_.size() > 1)
                throw Error(ErrorKind::usage, text("'", path, "' is merged by itself"),
                            "name one directory, one manifest, or the files of the bricks");
            if (manifest)
                files = bricks_of(path, context.trust_paths());
            else
                for (auto const& file : matching_files(path)) files.push_back({file, {}});
            if (!manifest && paths_.size() <= 1 && files.size() == 1)
                return merged_stream(context.open(path), path == "-" ? "standard input" : path, context.execution(),
                                     context.stage_info());
        }
        auto const open = [&context](std::string const& path) { return context.open(path); };
        return merged_files(std::move(files), open, context.execution(), context.stage_info());
    }

private:
    std::vector<std::string> paths_;
};

} // namespace

Command merge_command() {
    return opener_command<Merge>(
        {"Put bricks together again.",
         "Bit for bit the volume that 'vkt brick' cut, or what was made of its bricks meanwhile: each must have kept "
         "its extent and place, and all must have one type. Ghosts are dropped. Bricks that are missing, overlap or "
         "belong elsewhere are refused. Files are read piece by piece, of a stream a layer of bricks is held.",
         {{"A directory", "vkt brick volume.nrrd --size 16 -o bricks && vkt merge bricks -o again.nrrd"},
          {"Files", "vkt brick volume.nrrd --size 16 -o 'part%02d.nrrd' && vkt merge 'part*.nrrd' | vkt info"},
          {"In one process",
           "vkt pipe 'read volume.nrrd | brick --size 16 --ghost 2 | filter median --radius 2 | merge -o m.nrrd'"}}});
}

} // namespace vkt::shell
