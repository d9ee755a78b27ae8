// vkt stress: a pipeline on volumes that are made to break it.
// SPDX-License-Identifier: MIT
#include "shell/stress/stress.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/report.h"
#include "libvkt/core/text.h"
#include "libvkt/io/output_file.h"
#include "shell/command.h"
#include "shell/stress/damage.h"
#include "shell/stress/hard_volumes.h"
#include "shell/terminal.h"

namespace vkt::shell {
namespace {

class Stress : public Consumer {
public:
    void parameters(Parameters& p) override {
        p.positional("pipeline", request_.pipeline, "stages from a volume on standard input on, quoted as one word")
            .optional();
        p.option("volume", volumes_, "NAME,...",
                 "try these volumes only; without a pipeline, write one to standard output, as a stream")
            .choices = hard_volume_names();
        p.option("damage", damage_, "NAME", "without a pipeline, damage the stream that is written").choices =
            damage_names();
        p.flag("list", list_, "list the volumes and kinds of damage");
        p.option("vkt", request_.program, "PROGRAM", "run this instead of the vkt that is running");
        p.option("timeout", request_.seconds, "SECONDS", "what takes longer hangs");
    }
    void check() const override {
        if (list_ ? !request_.pipeline.empty() || !volumes_.empty() : request_.pipeline.empty() && volumes_.empty())
            throw Error(ErrorKind::usage, "one of a pipeline, --volume and --list is needed",
                        "e.g. vkt stress 'filter gaussian --sigma 2'");
        if (!damage_.empty() && (!request_.pipeline.empty() || volumes_.empty()))
            throw Error(ErrorKind::usage, "--damage is for a volume that is written: name it with --volume");
        if (!(request_.seconds > 0)) throw Error(ErrorKind::usage, text("--timeout ", request_.seconds, " is no time"));
    }
    int inputs() const override { return 0; }
    bool reports() const override { return true; }

    int consume(std::vector<std::unique_ptr<Source>>&, Context& context) override {
        if (list_) {
            std::string all;
            for (auto const& name : hard_volume_names()) all += text("volume  ", name, "\n");
            for (auto const& name : damage_names()) all += text("damage  ", name, "\n");
            context.print(all);
            return 0;
        }
        if (request_.pipeline.empty()) return write_volume();
        request_.volumes = volumes_.empty() ? hard_volume_names() : split(volumes_, ',');
        for (auto const& name : request_.volumes) hard_volume(name);
        if (context.dry_run()) {
            context.note(text("'", request_.pipeline, "' would run on ", join(request_.volumes, ", ")));
            return 0;
        }
        return tell(stress(request_, context), context);
    }

private:
    int write_volume() const {
        Volume const volume = hard_volume(volumes_);
        if (output_is_terminal()) throw Error(ErrorKind::usage, "refusing to write a binary volume to the terminal");
        std::string stream = stream_of(volume);
        if (!damage_.empty()) {
            auto const wrong = damaged(stream, damage_);
            if (!wrong) throw Error(ErrorKind::usage, text("'", volumes_, "' cannot have the damage '", damage_, "'"));
            stream = *wrong;
        }
        OutputFile file("-", false);
        file.write(stream.data(), stream.size());
        file.commit();
        return 0;
    }

    int tell(StressReport const& found, Context& context) const {
        auto const volumes = static_cast<std::int64_t>(request_.volumes.size());
        if (context.json()) {
            Report report;
            report.add("pipeline", request_.pipeline).add("volumes", volumes);
            report.add("trials", found.trials);
            report.add("findings", rows(found.findings)).add("refusals", rows(found.refusals));
            context.print(report.json() + "\n");
        } else {
            std::string all;
            for (auto const* const list : {&found.refusals, &found.findings})
                for (auto const& f : *list)
                    all += text(f.kind, f.more > 0 ? text(" ", f.volume, " and ", f.more, " more") : " " + f.volume,
                                ": ", f.what, "\n  ", f.repeat, "\n");
            all += text(found.trials, " runs on ", volumes, volumes == 1 ? " volume: " : " volumes: ",
                        found.findings.empty() ? std::string("nothing found")
                                               : text(static_cast<std::int64_t>(found.findings.size()), " found"),
                        "\n");
            context.print(all);
        }
        return found.findings.empty() ? 0 : 1;
    }

    static std::vector<Report> rows(std::vector<Finding> const& list) {
        return collect(list, [](Finding const& f) {
            Report row;
            row.add("kind", f.kind).add("what", f.what).add("volume", f.volume).add("more", f.more);
            row.add("repeat", f.repeat);
            return row;
        });
    }

    StressRequest request_;
    std::string volumes_, damage_;
    bool list_ = false;
};

} // namespace

Command stress_command() {
    return consumer_command<Stress>(
        {"Run a pipeline on volumes made to break it.",
         "Constants, single voxels, NaN, infinities, offsets, denormals, extremes of every type, mirrored and oblique "
         "frames; slabs of one slice, one and five threads, both transports, little memory, streams that come byte by "
         "byte; cut and damaged streams, wrong headers, a full disk. What changes, crashes, hangs, is further from "
         "exact than promised, loses or spreads NaN, takes damage for data or leaves files is told with the command "
         "that repeats it, and "
         "makes exit code 1. Volumes that are refused are told, too.",
         {{"A filter on volumes of one's choice; on all of them it takes half a minute",
           "vkt stress 'filter gaussian --sigma 1' --volume extremes-uint8,nan-float32,large"},
          {"A pipeline of one's own", "vkt stress 'flip x | resample --scale 0.5' --volume noise-int16 --json"},
          {"One of its volumes", "vkt stress --volume nan-float32 | vkt stats"}}});
}

} // namespace vkt::shell
