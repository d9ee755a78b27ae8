// Starting children that parse, watching them, and saying what became of them.
// SPDX-License-Identifier: MIT
#include "libvkt/io/parser.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/parser_child.h"
#include "libvkt/io/system_error.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <utility>

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

namespace vkt {
namespace {

constexpr std::size_t mebi = std::size_t{1} << 20;
constexpr char const* nonsense = "its reader gave an answer that makes no sense";

/// Closes itself; posix_spawn's lists have to be destroyed whatever happens.
class SpawnSettings {
public:
    SpawnSettings() {
        posix_spawn_file_actions_init(&actions);
        posix_spawnattr_init(&attributes);
    }
    ~SpawnSettings() {
        posix_spawn_file_actions_destroy(&actions);
        posix_spawnattr_destroy(&attributes);
    }
    SpawnSettings(SpawnSettings const&) = delete;
    SpawnSettings& operator=(SpawnSettings const&) = delete;

    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
};

/// The descriptors a child starts with: nothing to read or say on the standard ones, then the socket and the file.
void arrange_descriptors(posix_spawn_file_actions_t& actions, int socket, int file) {
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDWR, 0);
    posix_spawn_file_actions_adddup2(&actions, STDIN_FILENO, STDOUT_FILENO);
    // What a library prints when it dies is not for the user, who gets one line; reports of sanitizers are.
    if (!sanitized_build) posix_spawn_file_actions_adddup2(&actions, STDIN_FILENO, STDERR_FILENO);
    posix_spawn_file_actions_adddup2(&actions, socket, parser_socket);
    posix_spawn_file_actions_adddup2(&actions, file, parser_file);
    posix_spawn_file_actions_addclosefrom_np(&actions, parser_file + 1);
}

/// A copy of a descriptor that no arrangement of the first few will overwrite.
int out_of_the_way(int descriptor) {
    int const copy = ::fcntl(descriptor, F_DUPFD_CLOEXEC, parser_file + 1);
    if (copy < 0) throw system_error("cannot start a process that reads the file");
    return copy;
}

/// Closes a descriptor at the end of a scope.
class Descriptor {
public:
    explicit Descriptor(int number) : number_(number) {}
    ~Descriptor() {
        if (number_ >= 0) ::close(number_);
    }
    Descriptor(Descriptor const&) = delete;
    Descriptor& operator=(Descriptor const&) = delete;
    operator int() const { return number_; }
    int release() { return std::exchange(number_, -1); }

private:
    int number_;
};

std::string signal_text(int signal) {
    char const* const name = ::sigabbrev_np(signal);
    return name != nullptr ? text("SIG", name) : text("signal ", signal);
}

} // namespace

ParserLimits parser_limits(std::size_t budget, std::int64_t file_size) {
    ParserLimits limits;
    auto const size = static_cast<std::size_t>(std::clamp<std::int64_t>(file_size, 0, std::int64_t{1} << 52));
    // What a file can rightly become grows with it: a small one that asks for gigabytes is damaged.
    std::size_t const wanted = std::max(std::min(budget, std::size_t{1} << 60), 64 * size);
    limits.memory = std::min(wanted, std::max(1024 * size, 256 * mebi)) + 256 * mebi;
    limits.seconds = static_cast<int>(std::clamp<std::int64_t>(file_size / 1000000, 600, 1 << 30));
    if (char const* const asked = std::getenv("VKT_PARSER_PATIENCE"); asked != nullptr && *asked != '\0') {
        std::int64_t const seconds = parse_integer(asked);
        if (seconds < 1 || seconds > 1000000)
            throw Error(ErrorKind::usage, text("VKT_PARSER_PATIENCE='", asked, "' is not a number of seconds"));
        limits.patience = static_cast<int>(seconds);
    }
    return limits;
}

Parser::Parser(std::string const& program, std::string module, int file, std::string name, ParserLimits const& limits)
    : module_(std::move(module)), name_(std::move(name)), limits_(limits) {
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
        throw system_error("cannot start a process that reads the file");
    Descriptor ours(ends[0]), theirs(ends[1]);
    Descriptor const socket(out_of_the_way(theirs)), bytes(out_of_the_way(file));

    SpawnSettings settings;
    arrange_descriptors(settings.actions, socket, bytes);
    sigset_t none, all;
    sigemptyset(&none);
    sigfillset(&all);
    posix_spawnattr_setsigmask(&settings.attributes, &none);
    posix_spawnattr_setsigdefault(&settings.attributes, &all);
    // A group of its own: what is typed at the terminal is for the process that asks.
    posix_spawnattr_setpgroup(&settings.attributes, 0);
    posix_spawnattr_setflags(&settings.attributes,
                             POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);

    std::array<std::string, 6> words{program,
                                     module_,
                                     name_,
                                     text(static_cast<std::int64_t>(::getpid())),
                                     text(static_cast<std::uint64_t>(limits_.memory)),
                                     text(limits_.seconds)};
    std::array<char*, words.size() + 1> arguments{};
    for (std::size_t i = 0; i < words.size(); ++i) arguments[i] = words[i].data();
    int const failure =
        ::posix_spawn(&process_, program.c_str(), &settings.actions, &settings.attributes, arguments.data(), environ);
    if (failure != 0) {
        process_ = -1;
        if (failure == EAGAIN || failure == ENOMEM)
            throw Error(ErrorKind::resources, text("cannot start a process that reads '", name_, "'"));
        throw Error(ErrorKind::failure, text("cannot run ", program, ": ", std::strerror(failure)),
                    "install vkt again, with its folder lib/vkt");
    }
    socket_ = ours.release();
}

Parser::~Parser() {
    end(true);
    if (!window_.empty()) ::munmap(window_.data(), window_.size());
}

/// It keeps nothing that would have to be put away, so there is no need to ask it to leave.
void Parser::end(bool kill) {
    if (socket_ >= 0) ::close(std::exchange(socket_, -1));
    pid_t const process = std::exchange(process_, -1);
    if (process < 0) return;
    if (kill) ::kill(process, SIGKILL);
    while (::waitpid(process, nullptr, 0) < 0 && errno == EINTR) {
    }
}

void Parser::send(Message const& request) {
    if (!lost_.empty()) lost();
    if (!send_message(socket_, request)) lost();
    ++under_way_;
}

Message Parser::ask(Message const& request) {
    while (under_way_ > 0) {
        try {
            receive();
        } catch (Error const&) {
            if (!lost_.empty()) throw;
        }
    }
    send(request);
    return receive();
}

std::span<std::byte const> Parser::share(std::size_t bytes) {
    Descriptor const memory(::memfd_create("vkt", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    if (memory < 0) throw system_error(text("'", name_, "': cannot make shared memory"));
    // Nobody may cut off pages that the other side still touches.
    if (::ftruncate(memory, static_cast<off_t>(bytes)) != 0 ||
        ::fcntl(memory, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) != 0)
        throw system_error(text("'", name_, "': cannot make shared memory"));
    void* const mapping = ::mmap(nullptr, bytes, PROT_READ, MAP_SHARED, memory, 0);
    if (mapping == MAP_FAILED) throw system_error(text("'", name_, "': cannot map shared memory"));
    window_ = {static_cast<std::byte*>(mapping), bytes};
    Message request;
    request.put(share_request);
    if (!send_message(socket_, request, memory)) lost();
    ++under_way_;
    receive();
    return window_;
}

Message Parser::receive() {
    wait_for_answer();
    std::optional<Received> received = receive_message(socket_);
    if (!received) lost();
    --under_way_;
    if (received->descriptor >= 0) ::close(received->descriptor);
    Message& answer = received->message;
    if (answer.bytes().size() < sizeof(std::int64_t)) lost(nonsense);
    std::int64_t const kind = answer.number();
    if (kind == 0) return std::move(answer);
    std::string const message = answer.text(), hint = answer.text();
    bool const known = kind >= static_cast<int>(ErrorKind::failure) && kind <= static_cast<int>(ErrorKind::resources);
    throw Error(known ? static_cast<ErrorKind>(kind) : ErrorKind::data, message, hint);
}

/// What can be seen of a child from outside.
struct Parser::Activity {
    char state = '?';
    std::int64_t ticks = 0; ///< of processor time
    std::int64_t read = -1; ///< bytes, -1 if the system does not tell
};

Parser::Activity Parser::activity() const {
    Activity seen;
    std::string const folder = text("/proc/", static_cast<std::int64_t>(process_));
    std::string line;
    if (std::ifstream file(folder + "/stat"); std::getline(file, line)) {
        // "PID (NAME) STATE …"; user and system time are the 14th and 15th field.
        std::vector<std::string> const fields = split(line.substr(std::min(line.size(), line.rfind(')') + 2)), ' ');
        if (fields.size() > 12 && !fields[0].empty()) {
            seen.state = fields[0][0];
            seen.ticks = std::atoll(fields[11].c_str()) + std::atoll(fields[12].c_str());
        }
    }
    std::ifstream file(folder + "/io");
    for (std::string name; file >> name >> seen.read;)
        if (name == "rchar:") return seen;
    seen.read = -1;
    return seen;
}

/// Gives up on a child that computes without reading on, or does nothing at all. Processor time and turns of this loop
/// are counted rather than hours of the day, so that a stopped pipeline or a busy machine costs nobody his patience.
void Parser::wait_for_answer() {
    if (!lost_.empty()) lost();
    constexpr int turn = 250; // ms
    std::int64_t const patience = limits_.patience, second = std::max(1L, ::sysconf(_SC_CLK_TCK));
    Activity before;
    std::int64_t since = -1; // processor time when it last read on
    std::int64_t idle = 0;   // turns without anything
    for (;;) {
        pollfd ready{socket_, POLLIN, 0};
        int const n = ::poll(&ready, 1, turn);
        if (n > 0) return;
        if (n < 0 && errno != EINTR) throw system_error(text("'", name_, "': cannot wait for its reader"));
        if (n < 0) continue;
        Activity const now = activity();
        bool const read_on = now.read < 0 || now.read != before.read || since < 0;
        if (read_on) since = now.ticks;
        bool const waits = now.state == 'D' || now.state == 'T' || now.state == 't'; // for a disk, for somebody
        idle = now.ticks == before.ticks && !read_on && !waits ? idle + 1 : 0;
        before = now;
        if (now.ticks - since <= patience * second && idle * turn <= 4 * patience * 1000) continue;
        lost(text("no progress in ", patience, " s of reading"));
    }
}

/// Why there is no answer; without a reason, what the end of the process tells.
void Parser::lost(std::string reason) {
    if (lost_.empty()) {
        ErrorKind kind = ErrorKind::data;
        bool const hung = !reason.empty();
        int status = 0;
        rlimit space{};
        bool const limited = ::getrlimit(RLIMIT_AS, &space) == 0 && space.rlim_cur != RLIM_INFINITY;
        if (hung) {
            end(true);
        } else {
            // Who closed his end is ending, with the reason that he had; who is not has sent what is no message.
            pid_t ended = 0;
            for (int i = 0; i < 400 && ended == 0; ++i) {
                ended = ::waitpid(process_, &status, WNOHANG);
                if (ended < 0 && errno == EINTR) ended = 0;
                if (ended == 0) ::usleep(5000);
            }
            if (ended == 0) end(true);
            process_ = -1;
            end(false);
            if (ended == 0)
                reason = nonsense;
            else if (ended < 0) // somebody else waits for this program's children
                reason = "its reader ended";
            else if (WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU)
                reason = text("its reader took more than ", limits_.seconds, " s of processor time");
            else if (WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL) {
                reason = "its reader was killed, which the system does when memory ends";
                kind = ErrorKind::resources;
            } else if (WIFSIGNALED(status))
                reason = text("its reader crashed (", signal_text(WTERMSIG(status)), ")");
            else if (WEXITSTATUS(status) == parser_unusable) {
                kind = limited ? ErrorKind::resources : ErrorKind::failure;
                reason = text("its reader cannot be started", limited ? " within the memory of this shell or job" : "");
            } else
                reason = text("its reader ended (exit ", WEXITSTATUS(status), ")");
        }
        // Libraries take a want of memory badly; whoever limits it more than we do hears of that first.
        if (limited && kind == ErrorKind::data && space.rlim_cur < limits_.memory) {
            kind = ErrorKind::resources;
            reason += ", within the memory of this shell or job (ulimit -v)";
        }
        lost_ = text("'", name_, "': ", kind == ErrorKind::data ? "damaged: " : "", reason);
        lost_kind_ = kind;
    }
    throw Error(lost_kind_, lost_);
}

} // namespace vkt
