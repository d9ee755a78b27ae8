// vkt split: a series into its volumes, a volume into its slices.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/series.h"
#include "libvkt/formats/stack.h"
#include "libvkt/io/shared_memory.h"
#include "shell/command.h"

#include <filesystem>

namespace vkt::shell {
namespace {

class Split : public Opener {
public:
    void parameters(Parameters& p) override {
        p.positional("in", path_, "input: a file of any known format, a stream, or '-' (the default)").optional();
        p.option("along", along_, "AXIS",
                 "z: slices; series: volumes (default: series for files that hold several, z for others)");
    }
    bool reads() const override { return true; }
    std::vector<std::string> input_names() const override { return {path_.empty() ? "-" : path_}; }

    std::unique_ptr<Source> open(Context& context) override {
        std::string const path = input_names().front();
        if (!along_) along_ = found_out(path, context);
        auto source = context.open(path);
        return along_ == StackAxis::series ? std::move(source) : slices_of(std::move(source), context.stage_info());
    }

    std::unique_ptr<Sink> sink(std::string const& output, WriteOptions const&,
                               std::function<std::unique_ptr<Sink>(std::string const&)> const&) override {
        if (output != "-" && !is_numbered(output) && !lower_case(output).ends_with(".vkt"))
            throw Error(ErrorKind::usage, text("'", output, "' names one file"),
                        "give a place for the number: -o out%03d.nrrd");
        return nullptr;
    }

private:
    static StackAxis found_out(std::string const& path, Context& context) {
        std::error_code failed;
        std::string const file = file_part(path).file;
        bool const again = is_segment(path) || matching_files(path).size() > 1 ||
                           std::filesystem::is_regular_file(file, failed) ||
                           std::filesystem::is_directory(file, failed);
        if (!again && path != "-" && !std::filesystem::exists(file, failed))
            static_cast<void>(context.open(path)); // says so
        if (!again)
            throw Error(ErrorKind::usage,
                        text("'", path, "' can be read only once, and may hold one volume or several"),
                        "--along z splits into slices, --along series into volumes");
        auto const source = context.open(path);
        if (!source->next_volume()) return StackAxis::series;
        source->finish();
        return source->next_volume() ? StackAxis::series : StackAxis::z;
    }

    std::string path_;
    std::optional<StackAxis> along_;
};

} // namespace

Command split_command() {
    return opener_command<Split>(
        {"Take a series apart into volumes, or a volume into slices.",
         "The reverse of vkt stack. A file of several volumes is split into these, another one into its slices along "
         "z; --along says which. Each keeps its place in the world, and is written to a file of its own, numbered from "
         "0.",
         {{"Slices as pictures", "vkt split volume.nrrd -o 'slice%03d.png'"},
          {"Volumes of a series",
           "vkt stack volume.nrrd volume.nrrd -o series.nrrd && vkt split series.nrrd -o 'volume%d.mha'"},
          {"Slices, each smoothed",
           "vkt split volume.nrrd | vkt filter gaussian --sigma 1 | vkt write 's%03d.nrrd'"}}});
}

} // namespace vkt::shell
