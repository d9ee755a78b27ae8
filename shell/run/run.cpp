// From parsed stages to voxels that move.
// SPDX-License-Identifier: MIT
#include "shell/run/run.h"

#include "ipc/descriptor.h"
#include "ipc/stream.h"
#include "libvkt/core/error.h"
#include "libvkt/io/system_error.h"
#include "shell/help.h"
#include "shell/run/runner.h"
#include "shell/terminal.h"

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <new>
#include <string_view>
#include <system_error>
#include <unistd.h>

namespace vkt::shell {
namespace {

/// Whether words that could not be parsed name an output file: standard output is somebody else's then.
bool names_output(std::vector<std::string> const& words) {
    return std::any_of(words.begin(), words.end(), [](std::string const& word) {
        return word == "--output" || word.starts_with("--output=") || (word.starts_with("-o") && word != "-o-");
    });
}

} // namespace

void write_out_of_memory() {
    // Several threads may miss some: who comes second waits until the line is out, and does not end the process before.
    [[maybe_unused]] static auto const written = [] {
        constexpr std::string_view line = "vkt: out of memory\n";
        return ::write(STDERR_FILENO, line.data(), line.size());
    }();
}

void say_downstream(Invocation const& stage, std::string const& message) {
    bool const streams = stage.yields_volumes() && stage.common().output == "-" && ipc::is_pipe(STDOUT_FILENO);
    if (!streams) return;
    ipc::StreamSink sink(STDOUT_FILENO, {});
    tell(sink, stage.process(), message);
}

int run(std::deque<Invocation>& stages) {
    Runner runner(stages);
    return runner.run();
}

int run_words(std::vector<std::string> const& words) {
    Verb const verb = find_verb(words);
    if (verb.command->body) {
        bool const asks = std::find(verb.words.begin(), verb.words.end(), "--help") != verb.words.end();
        bool const examples = std::find(verb.words.begin(), verb.words.end(), "--examples") != verb.words.end();
        if (!asks && !examples) return verb.command->body(verb.words);
    }
    std::deque<Invocation> stages;
    stages.emplace_back(verb);
    Invocation& stage = stages.front();
    try {
        stage.parse();
    } catch (Error const& e) {
        if (!names_output(verb.words)) say_downstream(stage, e.what());
        throw;
    }
    if (stage.common().examples || stage.common().help) {
        std::string const answer = stage.common().examples ? command_examples(*verb.command) : command_help(stage);
        print_text(answer);
        return 0;
    }
    return run(stages);
}

int guarded(std::string const& stage, std::function<int()> const& body) {
    // What cannot be said for want of memory is said as what it is.
    auto const failed = [&](ErrorKind kind, std::string_view message, std::string_view hint) {
        try {
            Log const log;
            log.error(stage, std::string(message));
            if (!hint.empty()) log.error(stage, text("hint: ", hint));
        } catch (std::bad_alloc const&) {
            write_out_of_memory();
            kind = ErrorKind::resources;
        }
        return static_cast<int>(kind);
    };
    try {
        int const code = body();
        return std::fflush(stdout) == 0 ? code : failed(ErrorKind::io, "cannot write to standard output", "");
    } catch (ipc::BrokenPipe const&) {
        // Nobody reads on: leave as any filter would, killed by the signal that says so.
        std::signal(SIGPIPE, SIG_DFL);
        std::raise(SIGPIPE);
        return 141;
    } catch (UpstreamError const&) {
        return static_cast<int>(ErrorKind::data);
    } catch (Error const& e) {
        return failed(e.kind(), e.what(), e.hint());
    } catch (std::bad_alloc const&) {
        return failed(ErrorKind::resources, "out of memory", "lower --memory, or work on a part with 'vkt crop'");
    } catch (std::system_error const& e) {
        if (!is_shortage(e)) return failed(ErrorKind::failure, e.what(), "");
        return failed(ErrorKind::resources, text("cannot start a thread: ", e.code().message()),
                      "the limits of this shell or job are tight (ulimit -a); fewer --threads need less");
    } catch (std::exception const& e) {
        return failed(ErrorKind::failure, e.what(), "");
    }
}

} // namespace vkt::shell
