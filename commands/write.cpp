// vkt write: a stream into a file of any format.
// SPDX-License-Identifier: MIT
#include "ipc/stream.h"
#include "libvkt/core/error.h"
#include "libvkt/formats/request.h"
#include "libvkt/formats/series.h"
#include "libvkt/io/byte_source.h"
#include "libvkt/io/shared_memory.h"
#include "shell/command.h"
#include "shell/terminal.h"

#include <memory>
#include <string>
#include <unistd.h>
#include <utility>

namespace vkt::shell {
namespace {

class Write : public Consumer {
public:
    bool runs_on_gpu() const override { return true; } // it computes nothing
    void parameters(Parameters& p) override {
        // Two words are IN and OUT, one is OUT; with -o it is IN.
        p.positional("in", first_, "input: a file of any known format, a stream, or '-' (the default)").optional();
        p.positional("out", second_,
                     "output: a file whose extension tells the format, shm:NAME, or '-' for standard output")
            .optional();
        p.option("output", output_, "OUT", "the output, said as an option; the only argument is then the input")
            .short_form('o');
        request_.declare(p);
    }

    std::vector<std::string> input_names() const override {
        bool const named = !second_.empty() || !output_.empty();
        return {named && !first_.empty() ? first_ : "-"};
    }

    void check() const override {
        if (!output_.empty() && !second_.empty())
            throw Error(ErrorKind::usage, text("two outputs: '", second_, "' and '", output_, "'"));
        if (out().empty()) throw Error(ErrorKind::usage, "missing OUT: the file to write", "e.g. vkt write out.nrrd");
        std::string const in = input_names().front();
        auto const there = [](std::string const& name) {
            return ::access(name.c_str(), F_OK) == 0 || ::access(file_part(name).file.c_str(), F_OK) == 0;
        };
        if (in != "-" && !is_segment(in) && !there(in) && ::access(out().c_str(), F_OK) == 0 &&
            in.find_first_of("*?[") == std::string::npos)
            throw Error(ErrorKind::io, text("cannot open '", in, "': there is no such file"),
                        "the input comes first: vkt write IN OUT");
        request_.check(out());
        if (stream() && request_.options().compress)
            throw Error(ErrorKind::usage, "--compress: streams are not compressed");
    }

    bool writes() const override { return true; }

    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override {
        Source& source = *inputs.front();
        // Made before anything is read, so that what is wrong with it is said at once.
        auto const sink = make_sink(context);
        bool planned_only = false;
        while (source.next_volume()) {
            if (source.header().dry_run) {
                planned_only = true;
                sink->plan(source.header());
                context.plan(source.header(), out());
                source.finish();
            } else {
                drain_volume(source, *sink, context.execution());
            }
        }
        if (!planned_only) sink->close();
        return 0;
    }

private:
    std::string const& out() const { return !output_.empty() ? output_ : !second_.empty() ? second_ : first_; }
    bool stream() const { return ipc::is_stream_file(out(), request_.options().format); }

    std::unique_ptr<Sink> make_sink(Context& context) const {
        if (out() == "-" && output_is_terminal())
            throw Error(ErrorKind::usage, "refusing to write a binary volume to the terminal", "name a file");
        if (out() != "-" || !stream()) {
            auto const told = std::make_shared<std::string>(); // of many files one line
            WriteOptions options = request_.options();
            options.notice = [&context, told](std::string const& message) {
                if (std::exchange(*told, message) != message) context.lossy(message);
            };
            options.remark = [&context, told](std::string const& message) {
                if (std::exchange(*told, message) != message) context.note(message);
            };
            options.memory = context.execution().memory;
            options.threads = context.execution().threads;
            auto const create = [this](std::string const& path, WriteOptions const& own) {
                return stream() ? ipc::create_stream_file(path, own.force, true) : create_volume(path, own);
            };
            if (!is_numbered(out())) return create(numbered_path(out(), 0), options);
            return numbered_sink(out(), holds_slices(out(), options.format), options, create);
        }
        ipc::StreamOptions stream_options;
        stream_options.stage = context.stage_info().name;
        return std::make_unique<ipc::StreamSink>(STDOUT_FILENO, stream_options);
    }

    std::string first_, second_, output_;
    WriteRequest request_;
};

} // namespace

Command write_command() {
    return consumer_command<Write>(
        {"Write a volume to a file.",
         "The extension tells the format: .nrrd .nhdr .mha .mhd .nii .nii.gz .hdr .mrc .npy .npz .png .raw .raw.gz "
         ".vkt, and others "
         "that "
         "are built\nin. The file appears when it is complete; an existing one is replaced only with --force.",
         {{"NRRD, compressed", "vkt read volume.nrrd | vkt write small.nrrd --compress"},
          {"One file into another format", "vkt write volume.nrrd volume.mha"},
          {"MetaImage with the voxels in a file beside it", "vkt read volume.nrrd | vkt write volume.mhd"},
          {"Bare voxels, x fastest, to another program", "vkt read volume.nrrd | vkt write - --format raw | wc -c"}}});
}

} // namespace vkt::shell
