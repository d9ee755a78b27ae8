// Lines run by bash in process groups of their own.
// SPDX-License-Identifier: MIT
#include "shell/stress/trial.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace vkt::shell {
namespace {

constexpr int closed_pipe = 128 + SIGPIPE;

[[noreturn]] void become_shell(std::string const& script, TrialOptions const& options, int codes, int life) {
    ::setpgid(0, 0);
    int const in = ::open("/dev/null", O_RDONLY);
    int const out = ::open(options.stdout_file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    int const err = ::open(options.stderr_file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    if (in < 0 || out < 0 || err < 0 || ::chdir(options.folder.c_str()) != 0) ::_exit(126);
    ::dup2(in, 0);
    ::dup2(out, 1);
    ::dup2(err, 2);
    // Neither may be at the other's place, nor at its own, where it would be closed with the rest.
    codes = ::fcntl(codes, F_DUPFD_CLOEXEC, 10);
    life = ::fcntl(life, F_DUPFD_CLOEXEC, 10);
    ::dup2(codes, 9);
    ::dup2(life, 8);
    if (options.file_limit) {
        rlimit const limit{static_cast<rlim_t>(*options.file_limit), static_cast<rlim_t>(*options.file_limit)};
        ::setrlimit(RLIMIT_FSIZE, &limit);
    }
    std::signal(SIGPIPE, SIG_DFL);
    ::execl("/bin/bash", "bash", "-c", script.c_str(), nullptr);
    ::_exit(126);
}

} // namespace

bool TrialResult::ok() const {
    return !hung && !codes.empty() && std::all_of(codes.begin(), codes.end(), [](int code) { return code == 0; });
}

bool TrialResult::says(int code) const { return std::find(codes.begin(), codes.end(), code) != codes.end(); }

std::optional<int> TrialResult::crash() const {
    for (int const code : codes)
        if (code > 5 && code != closed_pipe) return code;
    return std::nullopt;
}

TrialResult try_line(std::string const& line, TrialOptions const& options) {
    std::array<int, 2> ends{}, life{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) throw Error(ErrorKind::resources, "cannot make a pipe");
    if (::pipe2(life.data(), O_CLOEXEC) != 0) {
        for (int const end : ends) ::close(end);
        throw Error(ErrorKind::resources, "cannot make a pipe");
    }
    // Nothing is ever written to the pipe of life: it ends when this process does, and then the trial is killed.
    std::string const script =
        "{ read -r -u 8 || kill -KILL 0; } 2>/dev/null &\nexec 8<&-\n" + line + "\necho \"${PIPESTATUS[*]}\" >&9\n";
    pid_t const child = ::fork();
    if (child < 0) {
        for (int const end : {ends[0], ends[1], life[0], life[1]}) ::close(end);
        throw Error(ErrorKind::resources, "cannot start a process");
    }
    if (child == 0) become_shell(script, options, ends[1], life[0]);
    ::setpgid(child, child); // whoever comes first
    ::close(ends[1]);
    ::close(life[0]);

    TrialResult result;
    auto const end = std::chrono::steady_clock::now() + std::chrono::duration<double>(options.seconds);
    int status = 0;
    auto nap = std::chrono::microseconds(500);
    while (::waitpid(child, &status, WNOHANG) == 0) {
        if (std::chrono::steady_clock::now() > end) {
            result.hung = true;
            ::kill(-child, SIGKILL);
            ::waitpid(child, &status, 0);
            break;
        }
        std::this_thread::sleep_for(nap);
        nap = std::min(nap * 2, std::chrono::microseconds(10000));
    }
    ::kill(-child, SIGKILL); // what it left running in the background
    ::close(life[1]);
    std::string said;
    std::array<char, 256> buffer{};
    ::fcntl(ends[0], F_SETFL, O_NONBLOCK);
    for (ssize_t n = 0; (n = ::read(ends[0], buffer.data(), buffer.size())) > 0;)
        said.append(buffer.data(), static_cast<std::size_t>(n));
    ::close(ends[0]);
    for (auto const& word : shell_words(said)) result.codes.push_back(static_cast<int>(parse_integer(word)));
    if (result.codes.empty() && !result.hung) result.codes.push_back(WIFEXITED(status) ? WEXITSTATUS(status) : 126);
    return result;
}

} // namespace vkt::shell
