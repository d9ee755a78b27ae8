// Children that parse, played by shell scripts: what becomes of the process that asks when they misbehave.
// SPDX-License-Identifier: MIT
#include "amr_helper.h"

#include "libvkt/io/parser.h"

#include <cerrno>
#include <chrono>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

using namespace amr_test;

namespace {

/// The message by which a child says that its libraries have started: its length, then one number, in octal.
constexpr char const* greets = "printf '\\010\\0\\0\\0\\0\\0\\0\\0ydaer\\0\\0\\0' >&3";

/// What a program says that does this instead of answering, once it is ready or without ever being so.
Error end_of(std::string const& script, int patience = 30, char const* first = greets) {
    TemporaryFile const file("parser");
    std::ofstream(file.path()) << "#!/bin/sh\n" << first << "\n" << script << "\n";
    ::chmod(file.path().c_str(), 0700);
    int const bytes = ::open(file.path().c_str(), O_RDONLY | O_CLOEXEC);
    ParserLimits limits;
    limits.memory = std::size_t{1} << 30;
    limits.patience = patience;
    std::optional<Error> said;
    try {
        Parser parser(file.path(), "module", bytes, "a.vdb", limits);
        try {
            parser.ask(Message());
        } catch (Error const& e) {
            said = e;
        }
        EXPECT_THROW(parser.ask(Message()), Error); // and so does everything afterwards
    } catch (Error const& e) {
        said = e;
    }
    ::close(bytes);
    return said.value_or(Error(ErrorKind::failure, "nothing"));
}

void expect_data(Error const& error, std::string const& words) {
    EXPECT_EQ(error.kind(), ErrorKind::data);
    EXPECT_NE(std::string(error.what()).find("a.vdb"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
}

TEST(Parser, CrashesAreBadData) {
    expect_data(end_of("kill -SEGV $$"), "crashed (SIGSEGV)");
    expect_data(end_of("kill -ABRT $$"), "crashed (SIGABRT)");
    expect_data(end_of("exit 9"), "exit 9");
    expect_data(end_of("kill -XCPU $$"), "processor time");
}

TEST(Parser, WhoCannotBeginIsNoBadData) {
    EXPECT_EQ(end_of("exit 127").kind(), ErrorKind::failure);
    EXPECT_EQ(end_of("kill -KILL $$").kind(), ErrorKind::resources); // as the kernel does when memory ends
    int const bytes = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
    EXPECT_THROW(Parser("/nowhere/vkt_parser", "module", bytes, "a.vdb", {}), Error);
    ::close(bytes);
}

TEST(Parser, LoopsAreGivenUp) { expect_data(end_of("while :; do :; done", 1), "no progress"); }

TEST(Parser, SilenceIsGivenUp) { expect_data(end_of("exec sleep 1000", 1), "did nothing at all for 4 s"); }

// As where a library waits, while it starts, for a thread for which there was no memory.
TEST(Parser, WhoNeverIsReadyIsGivenUpSoonAndIsNoBadData) {
    using Clock = std::chrono::steady_clock;
    Clock::time_point const begin = Clock::now();
    Error const silent = end_of("exec sleep 1000", 30, ":");
    EXPECT_LT(Clock::now() - begin, std::chrono::seconds(60)); // not 120, and so says the message
    EXPECT_EQ(silent.kind(), ErrorKind::failure);
    EXPECT_NE(std::string(silent.what()).find("cannot be started: it did nothing at all for 5 s"), std::string::npos)
        << silent.what();
    Error const crashed = end_of("kill -SEGV $$", 30, ":");
    EXPECT_EQ(crashed.kind(), ErrorKind::failure);
    EXPECT_NE(std::string(crashed.what()).find("cannot be started: it crashed (SIGSEGV)"), std::string::npos)
        << crashed.what();
    EXPECT_EQ(end_of("while :; do :; done", 1, ":").kind(), ErrorKind::failure);
}

TEST(Parser, NonsenseIsNoAnswer) {
    expect_data(end_of("printf 'abcdefghijklmnop' >&3; exec sleep 1000"), "no sense");
    expect_data(end_of("printf '\\0\\0\\0\\0\\0\\0\\0\\0' >&3; exec sleep 1000"), "no sense"); // an empty answer
}

TEST(Parser, LeavesNoProcess) {
    end_of("while :; do :; done", 1);
    EXPECT_EQ(::waitpid(-1, nullptr, WNOHANG), -1);
    EXPECT_EQ(errno, ECHILD);
}

TEST(Parser, MemoryGrowsWithBudgetAndFile) {
    constexpr std::size_t mebi = std::size_t{1} << 20;
    EXPECT_EQ(parser_limits(100 * mebi, 1000).memory, 356 * mebi);
    EXPECT_EQ(parser_limits(100 * mebi, 10 * mebi).memory, 896 * mebi);
    EXPECT_EQ(parser_limits(0, std::int64_t{5} << 30).seconds, 5368);
    EXPECT_GT(parser_limits(~std::size_t{0}, std::numeric_limits<std::int64_t>::max()).memory, std::size_t{1} << 50);
}

TEST(ParserMessage, ComesBackAsItWas) {
    Message message;
    message.put(std::int64_t{-7});
    message.put(std::string_view("text \0 with a zero", 18));
    message.put(0.1);
    std::vector<Brick> const bricks{{{1, 2, 3}, {4, 5, 6}, 7}};
    message.put_table(std::span<Brick const>(bricks));
    Message read(message.bytes());
    EXPECT_EQ(read.number(), -7);
    EXPECT_EQ(read.text(), std::string("text \0 with a zero", 18));
    EXPECT_EQ(read.real(), 0.1);
    EXPECT_EQ(read.table<Brick>(), bricks);
    EXPECT_THROW(read.number(), Error);
    Message huge;
    huge.put(std::numeric_limits<std::int64_t>::max());
    EXPECT_THROW(Message(huge.bytes()).text(), Error);
}

} // namespace
