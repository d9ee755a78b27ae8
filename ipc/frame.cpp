// Checksums and the JSON payloads of END and ERR.
// SPDX-License-Identifier: MIT
#include "ipc/frame.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/kernel/hash.h"

#include <cstring>
#include <nlohmann/json.hpp>

#define XXH_INLINE_ALL
#include <xxhash.h>

namespace vkt::ipc {
namespace {

using Json = nlohmann::ordered_json;

/// With the registers of this processor.
Execution const& fastest() {
    static Execution const chosen = [] {
        Execution execution;
        execution.instructions = best_instruction_set();
        return execution;
    }();
    return chosen;
}

std::uint64_t hash_of(FrameHeader const& header) { return XXH3_64bits(&header, offsetof(FrameHeader, self)); }

Json parse(std::string_view text, char const* what) {
    Json object = Json::parse(text, nullptr, false);
    if (object.is_discarded() || !object.is_object())
        throw Error(ErrorKind::data, vkt::text("a malformed ", what, " frame"));
    return object;
}

template <class T> T value(Json const& object, char const* key, T fallback) {
    auto const found = object.find(key);
    if (found == object.end()) return fallback;
    if constexpr (std::is_same_v<T, std::string>) {
        if (!found->is_string()) return fallback;
    } else if constexpr (std::is_floating_point_v<T>) {
        if (!found->is_number()) return fallback;
    } else {
        if (!found->is_number_integer()) return fallback;
    }
    return found->get<T>();
}

} // namespace

std::uint64_t hash(std::span<std::byte const> data, std::uint64_t seed) {
    std::uint64_t result = 0;
    hash_bytes(data, seed, result, fastest());
    return result;
}

struct StreamHash::State {
    XXH3_state_t xxh;
};

StreamHash::StreamHash(std::uint64_t seed) : state_(std::make_unique<State>()) {
    // A state that is not cleared keeps its old secret if its old seed happens to be this one.
    XXH3_INITSTATE(&state_->xxh);
    XXH3_64bits_reset_withSeed(&state_->xxh, seed);
}
StreamHash::~StreamHash() = default;
void StreamHash::add(std::span<std::byte const> data) { hash_more(data, &state_->xxh, fastest()); }
std::uint64_t StreamHash::value() const { return XXH3_64bits_digest(&state_->xxh); }

FrameHeader sealed(FrameHeader header) {
    header.self = hash_of(header);
    return header;
}

bool intact(FrameHeader const& header) { return header.self == hash_of(header); }

std::string to_json(EndReport const& report) {
    Json object;
    object["frames"] = report.frames;
    object["bytes"] = report.bytes;
    object["checksum"] = report.checksum;
    if (!report.stages.empty()) {
        object["stages"] = Json::array();
        for (auto const& stage : report.stages)
            object["stages"].push_back({{"stage", stage.stage},
                                        {"wall", stage.wall},
                                        {"cpu", stage.cpu},
                                        {"wait_in", stage.wait_in},
                                        {"wait_out", stage.wait_out},
                                        {"bytes_in", stage.bytes_in},
                                        {"bytes_out", stage.bytes_out}});
    }
    return object.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string to_json(ErrorReport const& report) {
    Json const object{{"stage", report.stage}, {"message", report.message}, {"code", report.code}};
    return object.dump(-1, ' ', false, Json::error_handler_t::replace);
}

EndReport end_from_json(std::string_view json) {
    Json const object = parse(json, "END");
    EndReport report;
    report.frames = value<std::uint64_t>(object, "frames", 0);
    report.bytes = value<std::uint64_t>(object, "bytes", 0);
    report.checksum = value<std::uint64_t>(object, "checksum", 0);
    auto const stages = object.find("stages");
    if (stages == object.end() || !stages->is_array()) return report;
    for (auto const& stage : *stages) {
        if (!stage.is_object()) continue;
        report.stages.push_back({value<std::string>(stage, "stage", ""), value<double>(stage, "wall", 0),
                                 value<double>(stage, "cpu", 0), value<double>(stage, "wait_in", 0),
                                 value<double>(stage, "wait_out", 0), value<std::uint64_t>(stage, "bytes_in", 0),
                                 value<std::uint64_t>(stage, "bytes_out", 0)});
    }
    return report;
}

ErrorReport error_from_json(std::string_view json) {
    Json const object = parse(json, "ERR");
    return {value<std::string>(object, "stage", "an upstream command"), value<std::string>(object, "message", "failed"),
            value<int>(object, "code", 1)};
}

} // namespace vkt::ipc
