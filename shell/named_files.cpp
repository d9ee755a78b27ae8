// Files that command lines name.
// SPDX-License-Identifier: MIT
#include "shell/named_files.h"

#include "libvkt/core/error.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/series.h"
#include "libvkt/formats/sidecar.h"
#include "libvkt/io/shared_memory.h"

#include <algorithm>
#include <filesystem>
#include <string_view>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

namespace vkt::shell {
namespace {

bool same_file(std::string const& a, std::string const& b) {
    struct stat one {
    }, other{};
    return ::stat(a.c_str(), &one) == 0 && ::stat(b.c_str(), &other) == 0 && one.st_dev == other.st_dev &&
           one.st_ino == other.st_ino;
}

bool is_pair(std::string const& path) {
    std::string const lower = lower_case(path);
    if (is_segment(path)) return false;
    return lower.ends_with(".nhdr") || lower.ends_with(".mhd");
}

/// A file, and where formats of two files keep the voxels of a header by this name when they write it.
std::vector<std::string> files_of(std::string const& path) {
    std::vector<std::string> files{path};
    if (is_pair(path))
        for (char const* const data : {".raw", ".raw.gz", ".zraw"})
            files.push_back(path.substr(0, path.rfind('.')) + data);
    return files;
}

/// Throws Error{usage} if what is no volume, a report or a picture, would replace a volume that is read.
void spare_volumes(std::deque<Invocation>& stages, std::string const& output) {
    if (output.empty() || output == "-") return;
    for (auto& stage : stages)
        for (auto const& input : named_inputs(stage))
            if (same_file(input, output))
                throw Error(ErrorKind::usage, text("'", input, "' is read and would be replaced by what is no volume"),
                            "write under another name");
}

/// Throws Error{usage} if a report would go where the result does: it would end within it, or replace it.
void spare_output(Invocation const& stage, std::string const& output) {
    std::string const& report = stage.common().report_file;
    if (report.empty()) return;
    std::error_code failed;
    auto const place = [&](std::string const& path) {
        return std::filesystem::weakly_canonical(std::filesystem::absolute(path, failed), failed);
    };
    bool const printed = output == "-" && (report == "-" || same_file(report, "/dev/stdout"));
    bool const written = output != "-" && report != "-" && (output == report || place(output) == place(report));
    if (printed || (written && output != "/dev/null"))
        throw Error(ErrorKind::usage, text("--report ", report, " names where the result goes"),
                    printed ? "write one of them to a file: --report FILE, or -o FILE" : "write it under another name");
    std::string const sidecar = sidecar_of(output);
    if (!sidecar.empty() && report != "-" && place(sidecar) == place(report))
        throw Error(ErrorKind::usage,
                    text("--report ", report, " names the file beside ", output,
                         " where BIDS has what belongs to the image: it would be read as that"),
                    text("write it under another name: --report ",
                         sidecar.substr(0, sidecar.size() - std::string_view(".json").size()), "_report.json"));
}

} // namespace

bool is_replaced(std::string const& path) {
    struct stat status {};
    return path != "-" && (::stat(path.c_str(), &status) != 0 || S_ISREG(status.st_mode));
}

std::vector<std::string> input_names(Invocation& stage) {
    if (stage.opener() == nullptr) return stage.inputs();
    if (!stage.opener()->reads()) return {};
    std::vector<std::string> names{"-"};
    for (char const* const name : {"in", "input"})
        if (stage.own_parameters().given(name)) names = stage.own_parameters().find(name)->get();
    return names;
}

std::vector<std::string> named_inputs(Invocation& stage) {
    std::vector<std::string> files;
    for (auto const& name : input_names(stage))
        if (name != "-")
            for (auto const& file : matching_files(name)) files.push_back(segment_file(file));
    return files;
}

void spare_inputs(std::deque<Invocation>& stages) {
    Invocation& last = stages.back();
    std::string output = last.common().output;
    bool const writes = last.consumer() != nullptr && last.own_parameters().find("out") != nullptr;
    if (last.consumer() != nullptr)
        for (char const* const name : {"in", "out", "output"}) // of write: the last that is given
            if ((writes || name == std::string_view("output")) && last.own_parameters().given(name))
                output = last.own_parameters().find(name)->get().front();
    for (auto& stage : stages) {
        spare_volumes(stages, stage.common().report_file);
        spare_output(stage, output);
    }
    if (last.consumer() != nullptr && !writes) spare_volumes(stages, output);
    bool const series = is_numbered(output), pair = is_pair(output);
    bool const replaces = series || pair || (!is_segment(output) && ::access(output.c_str(), F_OK) == 0);
    if (output == "-" || !replaces) return;
    std::vector<std::string> inputs;
    for (auto& stage : stages)
        for (auto const& name : named_inputs(stage)) {
            // A header stays beside what replaces its voxels, and would describe them wrongly.
            for (auto& file : detached_files(name)) inputs.push_back(std::move(file));
            if (series || pair)
                for (auto& file : files_of(name)) inputs.push_back(std::move(file));
        }
    if (inputs.empty()) return;
    constexpr std::int64_t most_files = std::int64_t{1} << 20;
    for (std::int64_t i = 0; i < (series ? most_files : 1); ++i) {
        bool any = false;
        for (auto const& file : files_of(segment_file(numbered_path(output, i)))) {
            any = any || ::access(file.c_str(), F_OK) == 0;
            for (auto const& input : inputs)
                if (same_file(input, file))
                    throw Error(ErrorKind::usage,
                                series || pair
                                    ? text("'", input, "' is read and would be replaced, but not in one step: ",
                                           series ? "a series is" : "header and voxels are",
                                           " written one file after the other")
                                    : text("'", input, "' holds the voxels of an input, whose header would ",
                                           "describe the new ones"),
                                "write under another name");
        }
        if (!any) break;
    }
}

} // namespace vkt::shell
