// Timing tables.
// SPDX-License-Identifier: MIT
#include "shell/run/timing.h"

#include "libvkt/core/text.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <sys/resource.h>
#include <tuple>
#include <utility>

namespace vkt::shell {
namespace {

double seconds(timeval const& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); }

/// Bytes that the process has read and written so far; zeros where the system does not tell.
std::pair<std::uint64_t, std::uint64_t> process_bytes() {
    std::ifstream file("/proc/self/io");
    std::string name;
    std::uint64_t value = 0, read = 0, written = 0;
    while (file >> name >> value) {
        if (name == "rchar:") read = value;
        if (name == "wchar:") written = value;
    }
    return {read, written};
}

} // namespace

TimeMeter::TimeMeter() { std::tie(read_, written_) = process_bytes(); }

ipc::StageReport TimeMeter::report(std::string stage, ipc::Traffic const* in, ipc::Traffic const* out) const {
    auto const [read, written] = process_bytes();
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    double const wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
    return {std::move(stage),
            wall,
            seconds(usage.ru_utime) + seconds(usage.ru_stime),
            in != nullptr ? in->wait : 0,
            out != nullptr ? out->wait : 0,
            in != nullptr ? in->bytes : read - read_,
            out != nullptr ? out->bytes : written - written_};
}

std::string timing_table(std::vector<ipc::StageReport> const& stages) {
    std::size_t width = 5;
    for (auto const& stage : stages) width = std::max(width, printable(stage.stage).size());
    std::string table = "stage";
    table.append(width - 5, ' ');
    table += "    wall s     cpu s   wait in  wait out    bytes in   bytes out\n";
    for (auto const& s : stages) {
        std::array<char, 160> line{};
        std::snprintf(line.data(), line.size(), "  %8.3f  %8.3f  %8.3f  %8.3f  %10s  %10s\n", s.wall, s.cpu, s.wait_in,
                      s.wait_out, bytes_text(static_cast<double>(s.bytes_in)).c_str(),
                      bytes_text(static_cast<double>(s.bytes_out)).c_str());
        std::string name = printable(s.stage); // it comes from a stream
        name.append(width - name.size(), ' ');
        table += name + line.data();
    }
    return table;
}

} // namespace vkt::shell
