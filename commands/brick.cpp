// vkt brick: a volume as bricks, in a directory, in numbered files or as a stream.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/series.h"
#include "libvkt/operations/bricks/merge_bricks.h"
#include "shell/command.h"

#include <algorithm>
#include <filesystem>

namespace vkt::shell {
namespace {

class Brick : public Opener {
public:
    void parameters(Parameters& p) override {
        p.positional("in", path_, "input: a file of any known format, a stream, or '-' (the default)").optional();
        options_.declare(p);
    }
    bool reads() const override { return true; }
    std::vector<std::string> input_names() const override { return {path_.empty() ? "-" : path_}; }

    std::unique_ptr<Source> open(Context& context) override {
        return brick_source(context.open(input_names().front()), options_, context.execution(), context.stage_info());
    }

    std::unique_ptr<Sink> sink(std::string const& output, WriteOptions const& options,
                               std::function<std::unique_ptr<Sink>(std::string const&)> const& create) override {
        bool const directory = output.ends_with('/') || std::filesystem::is_directory(output);
        if (!directory && (output == "-" || is_numbered(output) || !format_of_name(output).empty() ||
                           lower_case(output).ends_with(".vkt")))
            return nullptr;
        std::string extension = options.format.empty() ? ".nrrd" : ".vkt";
        for (Format const& format : formats())
            if (format.name == lower_case(options.format) && !format.extensions.empty())
                extension = format.extensions.front();
        std::error_code failure;
        std::filesystem::path const folder = std::filesystem::path(path_).parent_path();
        if (directory && !path_.empty() && std::filesystem::equivalent(folder.empty() ? "." : folder, output, failure))
            throw Error(ErrorKind::usage, text("'", path_, "' lies in the directory that would be replaced"),
                        "write under another name");
        return brick_directory(numbered_path(output, 0), options.force, extension, options_, create);
    }

private:
    std::string path_;
    BrickOptions options_;
};

} // namespace

Command brick_command() {
    return opener_command<Brick>(
        {"Cut a volume into bricks, with ghost voxels of their neighbours.",
         "To a directory (whole or not at all, with the manifest bricks.json), to numbered files, or as a stream of "
         "volumes, on which every command works one by one. Bricks keep their place in the world and say it in "
         "attributes; 'vkt merge' puts them together again. From a stream a layer of bricks is held in memory, or the "
         "volume is spooled where that is more than half of --memory.",
         {{"A directory of files that any program reads",
           "vkt brick volume.nrrd --size 16 -o bricks && ls bricks && vkt merge bricks | vkt diff volume.nrrd"},
          {"Numbered files of another format", "vkt brick volume.nrrd --size 16,16,8 -o 'part%03d.mha'"},
          {"A filter brick by brick: ghosts as wide as it reaches",
           "vkt brick volume.nrrd --size 20 --ghost 8 | vkt filter gaussian --sigma 1 | vkt merge -o smooth.nrrd"}}});
}

} // namespace vkt::shell
