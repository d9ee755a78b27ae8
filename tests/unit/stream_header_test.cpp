// Streams whose headers make no sense: refused, and nothing is allocated for what they claim.
// SPDX-License-Identifier: MIT
#include "ipc/frame.h"
#include "ipc/stream.h"
#include "libvkt/core/error.h"
#include "libvkt/core/report.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/pipeline.h"

#include <algorithm>
#include <cstring>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

namespace {

using namespace vkt;

std::string const good = R"({
 "kind": "structured",
 "dims": [3,2,2],
 "dtype": "uint8",
 "spacing": [1.0,1.0,1.0],
 "origin": [0.0,0.0,0.0],
 "direction": [[1.0,0.0,0.0],[0.0,1.0,0.0],[0.0,0.0,1.0]],
 "slope": 1.0,
 "intercept": 0.0
})";

std::string with(std::string const& old, std::string const& replacement) {
    std::string json = good;
    std::size_t const at = json.find(old);
    EXPECT_NE(at, std::string::npos) << old;
    return json.replace(at, old.size(), replacement);
}

void append(std::string& stream, ipc::FrameType type, std::string_view payload) {
    ipc::FrameHeader frame;
    frame.type = type;
    frame.flags = ipc::flag_required;
    frame.length = payload.size();
    frame = ipc::sealed(frame);
    stream.append(reinterpret_cast<char const*>(&frame), sizeof frame);
    stream.append(payload);
}

/// A stream of one volume of 12 bytes in one slab; its frames hold whatever the header says.
std::string stream_of(std::string const& json, std::string_view magic = {ipc::magic.data(), ipc::magic.size()}) {
    std::string stream(magic);
    append(stream, ipc::FrameType::header, json);
    ipc::SlabHeader const slab{0, 2, ipc::Residence::here, 0, 12};
    std::string payload(reinterpret_cast<char const*>(&slab), sizeof slab);
    append(stream, ipc::FrameType::slab, payload + "abcdefghijkl");
    ipc::EndReport end;
    end.frames = 1;
    end.bytes = 12;
    std::uint64_t const none = 0;
    end.checksum = ipc::hash(std::as_bytes(std::span(&none, 1)));
    append(stream, ipc::FrameType::end, to_json(end));
    return stream;
}

void read_all(std::string const& stream) {
    int const file = ::memfd_create("stream", MFD_CLOEXEC);
    ASSERT_EQ(::write(file, stream.data(), stream.size()), static_cast<ssize_t>(stream.size()));
    ::lseek(file, 0, SEEK_SET);
    ipc::StreamSource source(std::make_unique<ByteSource>(file, "stream"), {});
    while (source.next_volume()) {
        if (source.header().kind == Kind::hierarchical)
            source.take_bricks().whole();
        else
            load(source, {});
    }
}

void expect_refused(std::string const& stream, std::string const& what) {
    try {
        read_all(stream);
        ADD_FAILURE() << "accepted: " << what;
    } catch (Error const& e) {
        // A size that could be is refused for want of memory.
        EXPECT_EQ(e.kind(), what == "[1099511627776,1,1]" ? ErrorKind::resources : ErrorKind::data)
            << what << ": " << e.what();
    }
}

TEST(StreamHeader, SoundOnesAreRead) { EXPECT_NO_THROW(read_all(stream_of(good))); }

TEST(StreamHeader, AbsurdDimsAreRefused) {
    for (char const* dims : {"[1099511627776,1,1]", "[1099511627776,1099511627776,1099511627776]",
                             "[4294967296,4294967296,2]", "[-3,2,2]", "[0,2,2]", "[3,2]", "[3,2,2,1]", "[3.5,2,2]",
                             "[\"3\",2,2]", "[1e300,2,2]", "null", "[9223372036854775807,3,1]", "[3,2,4]"})
        expect_refused(stream_of(with("[3,2,2]", dims)), dims);
}

TEST(StreamHeader, NumbersThatAreNoneAreRefused) {
    for (char const* value : {"NaN", "nan", "null", "1e999", "-1e999", "\"1\"", "Infinity"}) {
        expect_refused(stream_of(with("[1.0,1.0,1.0]", std::string("[") + value + ",1.0,1.0]")), value);
        expect_refused(stream_of(with("[0.0,0.0,0.0]", std::string("[") + value + ",0.0,0.0]")), value);
        expect_refused(stream_of(with("[[1.0,0.0,0.0]", std::string("[[") + value + ",0.0,0.0]")), value);
        expect_refused(stream_of(with("\"slope\": 1.0", std::string("\"slope\": ") + value)), value);
        expect_refused(stream_of(with("\"intercept\": 0.0", std::string("\"intercept\": ") + value)), value);
    }
    expect_refused(stream_of(with("[1.0,1.0,1.0]", "[0,1,1]")), "no spacing");
    expect_refused(stream_of(with("[1.0,1.0,1.0]", "[-1,1,1]")), "negative spacing");
    expect_refused(stream_of(with("[0.0,1.0,0.0]", "[1.0,0.0,0.0]")), "parallel directions");
    expect_refused(stream_of(with("\"slope\": 1.0", "\"slope\": 0")), "no slope");
}

TEST(StreamHeader, WordsThatAreUnknownAreRefused) {
    expect_refused(stream_of(with("uint8", "uint9")), "type");
    expect_refused(stream_of(with("structured", "unstructured")), "kind");
    expect_refused(stream_of("[]"), "no object");
    expect_refused(stream_of("{"), "no JSON");
    expect_refused(stream_of(""), "nothing");
    expect_refused(stream_of(std::string(100000, '[')), "deep");
}

std::int64_t depth_of(History const& history) {
    std::int64_t deepest = 0;
    for (History const& input : history.inputs) deepest = std::max(deepest, depth_of(input));
    return 1 + deepest;
}

// Written with more steps than any reader could take, a volume was lost.
TEST(StreamHeader, LongHistoriesAreFoldedAndNeverCostTheVolume) {
    for (std::int64_t const steps : {1, 399, 400, 401, 2500, 100000}) {
        std::string json = R"({"command": ["make", "ramp"]})";
        std::string open, close;
        for (std::int64_t i = 1; i < steps; ++i) {
            open += R"({"command": ["flip", "x"], "inputs": [)";
            close += "]}";
        }
        std::string const whole = with("\"intercept\": 0.0", "\"intercept\": 0.0, \"history\": " + open + json + close);
        EXPECT_NO_THROW(read_all(stream_of(whole))) << steps;
        Header const header = header_from_json(whole);
        ASSERT_TRUE(header.history);
        EXPECT_EQ(step_count(*header.history), steps);
        EXPECT_EQ(depth_of(*header.history), std::min<std::int64_t>(steps, 401));
        EXPECT_EQ(header_from_json(to_json(header)), header) << steps;
        History oldest = *header.history;
        while (!oldest.inputs.empty()) oldest = History(oldest.inputs.front());
        EXPECT_EQ(oldest.earlier, steps > 400 ? steps - 400 : 0);
        EXPECT_EQ(oldest.command.empty(), steps > 400);
    }
}

// A volume added to itself has twice the steps each time.
TEST(StreamHeader, HistoriesOfSeveralInputsStaySmall) {
    History history{{"make", "ramp"}, {}};
    for (int i = 0; i < 200; ++i) history = folded({{"arith", "add", "-", "<(…)"}, {history, history}});
    EXPECT_EQ(step_count(history), std::int64_t{1} << 50);
    Header header;
    header.history = history;
    EXPECT_LT(to_json(header).size(), 100000U);
    EXPECT_EQ(header_from_json(to_json(header)), header);
    // A long command or many of them: the newest is always told.
    History const words{{"set", std::string(1 << 20, 'x')}, {{{"set", std::string(1000, 'y')}, {}}}};
    EXPECT_EQ(folded(words).command, words.command);
    EXPECT_EQ(folded(words).inputs.front().earlier, 1);
}

TEST(StreamHeader, ImpossibleHistoriesAreRefused) {
    for (char const* history : {"[]", R"({"command": 3})", R"({"command": [], "earlier": -1})",
                                R"({"command": [], "earlier": "many"})", R"({"command": [], "earlier": 1e30})",
                                R"({"command": [], "inputs": {}})", R"({"command": [], "inputs": [7]})"})
        expect_refused(
            stream_of(with("\"intercept\": 0.0", std::string("\"intercept\": 0.0, \"history\": ") + history)), history);
}

// What a terminal acts on, by UTF-8's own definition.
TEST(StreamHeader, TextForPeopleHoldsNothingThatTerminalsActOn) {
    EXPECT_EQ(printable("plain: é µ 体 \\n"), "plain: é µ 体 \\n");
    EXPECT_EQ(printable("a\nb\tc\rd"), "a\\nb\\tc\\rd");
    EXPECT_EQ(printable("\x1b[31m\x7f"), "\\x1b[31m\\x7f");
    EXPECT_EQ(printable("\xc2\x9b"
                        "31m"),
              "\\u009b31m");
    EXPECT_EQ(printable("\u202e\u2028"), "\\u202e\\u2028");
    EXPECT_EQ(printable("\xe9t\xff \xc0\x8a \xed\xa0\x80"),
              "\\xe9t\\xff \\xc0\\x8a \\xed\\xa0\\x80"); // Latin-1, overlong, half
    EXPECT_EQ(json_string("a\"\\\n\x1b\xc2\x9b\xff"), R"("a\"\\\n\u001b\u009b�")");
    Header header;
    header.units = "\x1b[2J\xc2\x9b\x7f\u202e";
    for (char const c : to_json(header)) EXPECT_TRUE(c == '\n' || (c >= ' ' && c < 0x7f));
    EXPECT_EQ(header_from_json(to_json(header)).units, header.units);
    for (std::string const word : {"a\nb", "\x1b[31m 'x' \\n $HOME", "\xff",
                                   "\xc2\x9b"
                                   "7",
                                   "it's", "é"}) {
        std::string const quoted = shell_quoted(word);
        EXPECT_EQ(printable(quoted), quoted);
        EXPECT_EQ(shell_words("a " + quoted + " b"), (std::vector<std::string>{"a", word, "b"})) << quoted;
    }
    EXPECT_EQ(shell_words(R"($'\x41\102\e\'' $x)"), (std::vector<std::string>{"AB\x1b'", "$x"}));
    EXPECT_THROW(shell_words("$'open"), Error);
}

TEST(StreamHeader, OtherVersionsAreRefused) {
    expect_refused(stream_of(good, "VKT2\r\n\x1a\n"), "version 2");
    expect_refused(stream_of(good, "VKT1\n\x1a\n"), "line ends rewritten");
    try {
        read_all(stream_of(good, "VKT2\r\n\x1a\n"));
    } catch (Error const& e) {
        EXPECT_NE(std::string(e.what()).find("version"), std::string::npos) << e.what();
    }
}

} // namespace
