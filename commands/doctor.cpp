// vkt doctor: what this build and this machine can do, and how fast.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/parameters.h"
#include "libvkt/core/report.h"
#include "shell/command.h"
#include "shell/machine/calibration.h"
#include "shell/machine/inventory.h"

#include <algorithm>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

namespace vkt::shell {
namespace {

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
    std::vector<InventoryLine> lines = machine_inventory();
    if (found)
        for (auto& line : speed_inventory(*found)) lines.push_back(std::move(line));
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
