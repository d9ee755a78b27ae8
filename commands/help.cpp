// vkt help: what there is and how it is used.
// SPDX-License-Identifier: MIT
#include "shell/help.h"
#include "libvkt/core/error.h"
#include "libvkt/formats/format.h"
#include "shell/run/run.h"
#include "shell/terminal.h"

#include <algorithm>

namespace vkt::shell {
namespace {

/// One line a format: name, files, what can be done, what it is.
std::string format_table() {
    std::size_t longest = 0, widest = 0;
    std::vector<std::string> extensions;
    for (Format const& format : formats()) {
        extensions.push_back(join(format.extensions, " "));
        longest = std::max(longest, format.name.size());
        widest = std::max(widest, extensions.back().size());
    }
    std::string result = "Formats that are read (r) and written (w), with their usual names:\n";
    for (std::size_t i = 0; i < extensions.size(); ++i) {
        Format const& format = formats()[i];
        std::string name = format.name, files = extensions[i];
        name.resize(longest, ' ');
        files.resize(widest, ' ');
        result += text("  ", name, "  ", files, "  ", format.open ? "r" : "-", format.create ? "w" : "-", "  ",
                       format.description, "\n");
    }
    return result + "All but shm, amrex and zarr may be compressed as a whole: NAME.gz, .bz2, .xz, .zst;\n"
                    "those of several files (.nhdr, .mhd, .hdr, .pvti, .pvd) are not written so.\n"
                    "-o NAME/ writes a folder of DICOM slices, -o plt00000 an AMReX plotfile.\n"
                    "vkt-read(1) and vkt-write(1) say what of each.\n";
}

int help(std::vector<std::string> const& words) {
    std::string answer;
    if (words.empty()) {
        answer = overview();
    } else if (words.front() == "--list") {
        answer = verb_list();
    } else if (words.front() == "--common") {
        answer = common_help();
    } else if (words.front() == "formats" && words.size() == 1) {
        answer = format_table();
    } else if (words.front() == "--search") {
        if (words.size() != 2) throw Error(ErrorKind::usage, "--search needs one word", "e.g. vkt help --search blur");
        answer = search(words[1]);
        if (answer.empty()) throw Error(ErrorKind::failure, text("no command mentions '", words[1], "'"));
    } else if (words.front().starts_with("-")) {
        throw Error(ErrorKind::usage, text("unknown option '", words.front(), "'"),
                    "--list, --common and --search are known");
    } else {
        std::vector<std::string> verb = words;
        verb.emplace_back("--help");
        return run_words(verb);
    }
    print_text(answer);
    return 0;
}

} // namespace

Command help_command() {
    Command command;
    command.texts = {
        "List the commands, or explain one.",
        "vkt help [COMMAND | formats]\n  --list         one command a line\n  --common       the options that all "
        "commands share\n"
        "  --search WORD  commands whose texts mention a word",
        {{"All commands", "vkt help"},
         {"One command", "vkt help crop"},
         {"Formats of files", "vkt help formats"},
         {"Find a command", "vkt help --search mirror"}}};
    command.body = help;
    return command;
}

} // namespace vkt::shell
