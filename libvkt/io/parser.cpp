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
constexpr char const* nonsense = "gave an answer that makes no sense";

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
    // A small file has nothing that takes long between two reads; pictures of a large one may be decoded after all of
    // it was read.
    if (!sanitized_build)
        limits.patience = static_cast<int>(std::clamp<std::int64_t>(10 + file_size / 4000000, 10, 60));
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

void Parser::dismiss() {
    if (socket_ >= 0) ::close(std::exchange(socket_, -1));
    if (process_ >= 0) ::kill(process_, SIGKILL); // and waited for at the end
    lost_ = text("'", name_, "': its reader was dismissed");
    lost_kind_ = ErrorKind::failure;
}

void Parser::send(Message const& request) {
    if (!lost_.empty()) lost();
    if (!send_message(socket_, request)) nobody_there();
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
    if (!send_message(socket_, request, memory)) nobody_there();
    ++under_way_;
    receive();
    return window_;
}

Message Parser::next_message() {
    wait_for_message();
    std::optional<Received> received = receive_message(socket_);
    if (!received) lost();
    if (received->descriptor >= 0) ::close(received->descriptor);
    if (received->message.bytes().size() < sizeof(std::int64_t)) lost(nonsense);
    return std::move(received->message);
}

Message Parser::receive() {
    if (!lost_.empty()) lost();
    if (!ready_) {
        if (next_message().number() != parser_ready) lost(nonsense);
        ready_ = true;
    }
    Message answer = next_message();
    --under_way_;
    std::int64_t const kind = answer.number();
    if (kind == 0) return answer;
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
void Parser::wait_for_message() {
    constexpr int turn = 250; // ms
    std::int64_t const patience = limits_.patience, second = std::max(1L, ::sysconf(_SC_CLK_TCK));
    // Libraries that start, start at once. With too little memory some wait for threads that were never made.
    std::int64_t const rest = ready_ ? 4 * patience : std::max<std::int64_t>(5, patience / 6);
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
        // For a disk, for somebody, for a processor.
        bool const waits = now.state == 'D' || now.state == 'T' || now.state == 't' || now.state == 'R';
        idle = now.ticks == before.ticks && !read_on && !waits ? idle + 1 : 0;
        before = now;
        if (now.ticks - since > patience * second) lost(text("made no progress in ", patience, " s of processor time"));
        if (idle * turn > rest * 1000) lost(text("did nothing at all for ", rest, " s"));
    }
}

/// The child has closed its side. That it was ready before may not have been heard yet.
void Parser::nobody_there() {
    std::optional<Received> first = ready_ ? std::nullopt : receive_message(socket_);
    ready_ = ready_ ||
             (first && first->message.bytes().size() == sizeof parser_ready && first->message.number() == parser_ready);
    lost();
}

/// What became of a child that has closed its side or sent what is no message.
Parser::End Parser::wait_for_end() {
    int status = 0;
    pid_t ended = 0;
    for (int i = 0; i < 400 && ended == 0; ++i) {
        ended = ::waitpid(process_, &status, WNOHANG);
        if (ended < 0 && errno == EINTR) ended = 0;
        if (ended == 0) ::usleep(5000);
    }
    if (ended == 0) end(true);
    process_ = -1;
    end(false);
    if (ended == 0) return {nonsense};
    if (ended < 0) return {"ended"}; // somebody else waits for this program's children
    if (!WIFSIGNALED(status)) {
        int const code = WEXITSTATUS(status);
        return {text("ended (exit ", code, ")"), code == parser_unusable ? ErrorKind::failure : ErrorKind::data};
    }
    int const signal = WTERMSIG(status);
    if (signal == SIGXCPU) return {text("took more than ", limits_.seconds, " s of processor time")};
    if (signal == SIGKILL) return {"was killed, which the system does when memory ends", ErrorKind::resources};
    return {text("crashed (", signal_text(signal), ")")};
}

/// Why there is no answer: what it did, or without that what its end tells.
void Parser::lost(std::string const& deed) {
    if (lost_.empty()) {
        if (!deed.empty()) end(true);
        auto [did, kind] = deed.empty() ? wait_for_end() : End{deed};
        rlimit space{};
        bool const limited = ::getrlimit(RLIMIT_AS, &space) == 0 && space.rlim_cur != RLIM_INFINITY;
        // Libraries take a want of memory badly; whoever limits it more than we do hears of that first.
        char const* const within = limited ? " within the memory of this shell or job (ulimit -v)" : "";
        if (kind == ErrorKind::failure || (!ready_ && kind == ErrorKind::data)) {
            did = text("cannot be started", within, ": it ", did);
            kind = limited ? ErrorKind::resources : ErrorKind::failure;
        } else if (kind == ErrorKind::data && limited && space.rlim_cur < limits_.memory) {
            did += within;
            kind = ErrorKind::resources;
        }
        lost_ = text("'", name_, "': ", kind == ErrorKind::data ? "damaged: " : "", "its reader ", did);
        lost_kind_ = kind;
    }
    throw Error(lost_kind_, lost_, lost_kind_ == ErrorKind::data ? "copy it again from where it came from" : "");
}

} // namespace vkt
