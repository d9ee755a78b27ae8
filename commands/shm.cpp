// vkt shm: the segments of shared memory in which commands have left volumes.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/report.h"
#include "libvkt/formats/segment.h"
#include "libvkt/io/shared_memory.h"
#include "shell/command.h"

#include <algorithm>
#include <array>
#include <cstdio>

namespace vkt::shell {
namespace {

char const* state_name(SegmentSummary::State state) {
    switch (state) {
    case SegmentSummary::State::whole:
        return "whole";
    case SegmentSummary::State::unfinished:
        return "unfinished";
    case SegmentSummary::State::damaged:
        break;
    }
    return "damaged";
}

std::string age_text(std::int64_t seconds) {
    if (seconds < 120) return text(seconds, " s");
    if (seconds < 120 * 60) return text(seconds / 60, " min");
    return seconds < 48 * 3600 ? text(seconds / 3600, " h") : text(seconds / (24 * 3600), " d");
}

/// A line for each under a line of titles; nothing if there are none.
std::string as_text(std::vector<SegmentSummary> const& segments) {
    using Row = std::array<std::string, 6>;
    std::vector<Row> rows{{"NAME", "SIZE", "TYPE", "DIMS", "AGE", "STATE"}};
    for (auto const& s : segments)
        rows.push_back({printable(s.name), bytes_text(static_cast<double>(s.bytes)),
                        s.header ? to_text(s.header->dtype) : "-", s.header ? to_text(s.header->dims) : "-",
                        age_text(s.age), state_name(s.state)});
    if (segments.empty()) return "";
    std::string lines;
    for (auto const& row : rows) {
        for (std::size_t i = 0; i + 1 < row.size(); ++i) {
            std::size_t width = 0;
            for (auto const& other : rows) width = std::max(width, other[i].size());
            lines += row[i] + std::string(width + 2 - row[i].size(), ' ');
        }
        lines += row.back() + "\n";
    }
    return lines;
}

/// A list, also of one.
std::string as_json(std::vector<SegmentSummary> const& segments) {
    std::string list;
    for (auto const& s : segments) {
        Report report;
        report.add("name", s.name).add("bytes", s.bytes).add("age", s.age).add("state", state_name(s.state));
        if (s.header) {
            report.add("kind", s.header->kind == Kind::structured ? "structured" : "hierarchical");
            report.add("dtype", name_of(s.header->dtype)).add("dims", s.header->dims);
        }
        list += text(list.empty() ? "\n " : ",\n ", report.json(1));
    }
    return text("[", list, list.empty() ? "]\n" : "\n]\n");
}

int list(std::vector<std::string> const& words) {
    bool json = false;
    Parameters parameters;
    parameters.flag("json", json, "");
    auto const left = read_words(words, {&parameters});
    if (!left.empty()) throw Error(ErrorKind::usage, text("unexpected argument '", left.front(), "'"));
    auto const segments = list_segments();
    std::fputs((json ? as_json(segments) : as_text(segments)).c_str(), stdout); // lines of a table are not wrapped
    return 0;
}

int remove(std::vector<std::string> const& words) {
    bool all = false;
    Parameters parameters;
    parameters.flag("all", all, "");
    std::vector<std::string> names = read_words(words, {&parameters});
    if (all == !names.empty())
        throw Error(ErrorKind::usage, all ? "--all leaves nothing to name" : "missing NAME: the segment to free",
                    "'vkt shm list' shows the segments there are");
    if (all) names = segments();
    for (auto& name : names) {
        if (!is_segment(name)) name.insert(0, "shm:");
        segment_file(name); // names that cannot be are refused before anything is freed
    }
    for (auto const& name : names) remove_segment(name);
    return 0;
}

} // namespace

Command shm_command() {
    Command list_verb, remove_verb, command;
    list_verb.texts = {"List the segments of shared memory that hold your volumes.",
                       "vkt shm list [--json]\n  --json         report as JSON\n\n"
                       "Segments that are unfinished or damaged are listed as such; no command reads them.",
                       {{"What there is", "vkt shm list"}, {"For scripts", "vkt shm list --json"}}};
    list_verb.body = list;
    remove_verb.texts = {"Free segments of shared memory.",
                         "vkt shm remove NAME…\n  --all          free all of your segments\n\n"
                         "Who has opened one keeps it until he is done.",
                         {{"One", "vkt write volume.nrrd shm:scan && vkt shm remove scan"}}};
    remove_verb.body = remove;
    command.texts = {
        "Show and free the volumes that lie in shared memory.",
        "A volume is put there by naming shm:NAME where a file is written, and read by the same name. Its memory is\n"
        "used as it lies, without a copy. It stays until it is removed, whoever wrote it and whenever that ended.",
        {{"A volume for several commands",
          "vkt write volume.nrrd shm:scan --force && vkt stats shm:scan && vkt flip x shm:scan -o f.nrrd && "
          "vkt shm remove scan"}}};
    command.verbs = {{"list", std::move(list_verb)}, {"remove", std::move(remove_verb)}};
    return command;
}

} // namespace vkt::shell
