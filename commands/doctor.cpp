// vkt doctor: what this build and this machine can do, and how fast.
// SPDX-License-Identifier: MIT
#include "libvkt/core/cgroup.h"
#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/parameters.h"
#include "libvkt/core/report.h"
#include "libvkt/formats/format.h"
#include "libvkt/io/module.h"
#include "shell/calibration.h"
#include "shell/command.h"
#include "shell/plot.h"
#include "shell/short_number.h"

#include <cstdio>

namespace vkt::shell {
namespace {

/// "loads", or why it does not.
std::string module_state(std::string const& name) {
    try {
        if (name == "window")
            module_functions(name, "nothing");
        else
            module_parser(name, "nothing");
        return "there";
    } catch (Error const& e) {
        return text("missing: ", e.what());
    }
}

struct Line {
    std::string name, value;
};

std::string rate_text(double bytes) { return text(bytes_text(bytes), "/s"); }

std::vector<Line> machine() {
    std::vector<Line> lines;
    CgroupLimits const limits = cgroup_limits();
    lines.push_back({"version", VKT_VERSION});
    lines.push_back({"processor", processor_name()});
    lines.push_back({"threads", to_text(default_threads())});
    lines.push_back({"instructions", std::string(name_of(best_instruction_set()))});
    lines.push_back({"memory", text(bytes_text(static_cast<double>(default_memory())), " a stage by default",
                                    limits.memory > 0 ? text(", the control group allows ",
                                                             bytes_text(static_cast<double>(limits.memory)))
                                                      : std::string())});
    int const gpus = gpu_count();
    lines.push_back({"GPUs", !built_with_cuda() ? std::string("none: built without CUDA")
                             : gpus == 0        ? std::string("none found")
                                                : to_text(gpus)});
    std::string reads, writes;
    for (Format const& format : formats()) {
        if (format.open != nullptr) reads += text(reads.empty() ? "" : " ", format.name);
        if (format.create != nullptr) writes += text(writes.empty() ? "" : " ", format.name);
    }
    lines.push_back({"reads", reads});
    lines.push_back({"writes", writes});
    for (char const* const name : {"hdf5", "openvdb", "tiff", "gdcm", "blosc"})
        lines.push_back({name, module_state(name)});
    lines.push_back({"gnuplot", can_plot() ? "there" : "missing: vkt chart writes tables only"});
    return lines;
}

std::vector<Line> speed(Calibration const& c) {
    std::vector<Line> lines;
    auto const both = [&](ByThreads const& rate) {
        return text(rate_text(rate[0]), " one thread, ", rate_text(rate[1]), " ", c.threads);
    };
    lines.push_back({"copy", both(c.copy)});
    lines.push_back({"scan", both(c.scan)});
    lines.push_back({"file", text(rate_text(c.file_read), " read from the page cache, ", rate_text(c.file_write),
                                  " written to it")});
    for (auto const& rate : c.rates) {
        auto const part = [&](std::size_t many) {
            std::string terms = text(short_number(1e9 * rate.fixed[many]), " ns");
            if (rate.per_cost[many] > 0)
                terms += text(" + ", short_number(1e9 * rate.per_cost[many]), " ns a multiply-add");
            return terms;
        };
        lines.push_back({text(rate.operation, rate.bytes == 2 ? " uint16" : " float32"),
                         text("a voxel: ", part(0), "; ", c.threads, " threads: ", part(1))});
    }
    return lines;
}

int doctor(std::vector<std::string> const& words) {
    bool measure = false, json = false;
    Parameters parameters;
    parameters.flag("calibrate", measure, "");
    parameters.flag("json", json, "");
    auto const left = read_words(words, {&parameters});
    if (!left.empty()) throw Error(ErrorKind::usage, text("unexpected argument '", left.front(), "'"));
    std::optional<Calibration> found;
    if (measure) {
        found = calibrate();
        save(*found);
    } else {
        found = load_calibration();
    }
    std::vector<Line> lines = machine();
    if (found)
        for (auto& line : speed(*found)) lines.push_back(std::move(line));
    std::string const where = calibration_path();
    lines.push_back(
        {"calibration", found ? where : std::string("none of this machine and build: vkt doctor --calibrate")});
    if (json) {
        Report report;
        for (auto const& line : lines) report.add(line.name, line.value);
        std::fputs((report.json() + "\n").c_str(), stdout);
        return 0;
    }
    std::size_t width = 0;
    for (auto const& line : lines) width = std::max(width, line.name.size());
    for (auto const& line : lines)
        std::printf("%s%s  %s\n", line.name.c_str(), std::string(width - line.name.size(), ' ').c_str(),
                    line.value.c_str());
    return 0;
}

} // namespace

Command doctor_command() {
    Command command;
    command.texts = {
        "What this build and this machine can do, and how fast.",
        "vkt doctor [options]\n"
        "  --calibrate    measure copies, files and some operations, on one thread and on all, in about two "
        "seconds, and keep it: -n and --explain then predict seconds\n"
        "  --json         report as JSON",
        {{"What there is", "vkt doctor"},
         {"What a pipeline will take",
          "vkt doctor --calibrate && vkt pipe -n 'read volume.nrrd | filter gaussian --sigma 2 | stats'"}}};
    command.body = doctor;
    return command;
}

} // namespace vkt::shell
