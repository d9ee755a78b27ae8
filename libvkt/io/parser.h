// Children that parse: files of formats that need foreign libraries are read by a process of their own, with limits of
// memory and time, so that what a damaged file does to such a library ends there.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/error.h"
#include "libvkt/io/message.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include <sys/types.h>

namespace vkt {

/// What a child may use.
struct ParserLimits {
    std::size_t memory = 0; ///< bytes of its own, code and tables of the library included
    /// Seconds of processor time without reading on in the file; four times as long doing nothing at all, but only a
    /// sixth of it, or five seconds if that is more, before its libraries have started.
    int patience = 30;
    int seconds = 600; ///< of processor time in all
};

/// Memory: the stage's budget or 64 times the file, whichever is more, and 256 MiB for the library itself. No format
/// whose tree lies in memory packs it more tightly than 1:64 (masks are not compressed); cells pass through in
/// portions. Time: VKT_PARSER_PATIENCE seconds of the processor without reading on (10, and one for each 4 MB of the
/// file, up to 60), and ten minutes in all, longer for files above 600 MB: one second for each of their megabytes.
/// Throws Error{usage} if the variable is no number of seconds.
ParserLimits parser_limits(std::size_t budget, std::int64_t file_size);

/// The child, seen by the process that asks it. It is started by posix_spawn from a small program of its own and not by
/// fork alone: the process that asks may have threads (OpenMP's, Python's), whose locks a forked child would inherit
/// held. The child gets the open file and this socket, nothing else: no standard streams, no other descriptors. It dies
/// with this process, however that dies, and leaves no core, no name in /dev/shm and no temporary file.
/// One thread at a time.
class Parser {
public:
    /// Starts `program`, which loads `module` and hands it the file. `name` is what messages call it.
    /// Throws Error{resources} where there can be no process, Error{failure} if the program cannot be run.
    Parser(std::string const& program, std::string module, int file, std::string name, ParserLimits const& limits);
    ~Parser();
    Parser(Parser const&) = delete;
    Parser& operator=(Parser const&) = delete;

    /// Sends a request. Several may be under way; answers come in their order.
    void send(Message const& request);
    /// The answer to the oldest request. Throws what the child threw; Error{data} if it crashed, ran out of memory or
    /// got nowhere; Error{resources} or Error{failure} if it never was ready, in a process with or without a limit of
    /// its address space. After that every call throws the same.
    Message receive();
    /// Request and answer, once those under way that nobody waits for have come.
    Message ask(Message const& request);

    /// Ends the child, of which nothing is wanted any more; its memory goes while this process works on.
    void dismiss();

    /// Memory that both sides see, which the child may fill while this side reads another part of it. Once.
    std::span<std::byte const> share(std::size_t bytes);

private:
    struct Activity;
    Activity activity() const;
    Message next_message();
    void wait_for_message();
    /// What became of a child, and whose fault that is.
    struct End {
        std::string did;
        ErrorKind kind = ErrorKind::data;
    };
    End wait_for_end();
    [[noreturn]] void nobody_there();
    [[noreturn]] void lost(std::string const& deed = {});
    void end(bool kill);

    std::string module_, name_;
    ParserLimits limits_;
    pid_t process_ = -1;
    int socket_ = -1;
    bool ready_ = false; ///< its libraries have started
    int under_way_ = 0;  ///< requests without an answer yet
    std::string lost_;   ///< why there will be no more answers
    ErrorKind lost_kind_ = ErrorKind::data;
    std::span<std::byte> window_;
};

} // namespace vkt
