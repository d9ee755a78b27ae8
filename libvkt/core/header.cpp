// Headers as JSON, their validity, and history as a shell line.
// SPDX-License-Identifier: MIT
#include "libvkt/core/header.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

namespace vkt {
namespace {

using Json = nlohmann::ordered_json;

constexpr int max_history_depth = 1000;

Json to_value(Index3 v) { return Json::array({v.x, v.y, v.z}); }
Json to_value(Vec3 v) { return Json::array({v.x, v.y, v.z}); }

Json to_value(History const& history) {
    Json result;
    result["command"] = history.command;
    if (!history.inputs.empty()) {
        result["inputs"] = Json::array();
        for (auto const& input : history.inputs) result["inputs"].push_back(to_value(input));
    }
    return result;
}

void to_utf8(History& history) {
    for (auto& word : history.command) word = in_utf8(word);
    for (auto& input : history.inputs) to_utf8(input);
}

[[noreturn]] void malformed(std::string const& what) { throw Error(ErrorKind::data, text("the header's ", what)); }

Json const& member(Json const& object, char const* key) {
    auto const found = object.find(key);
    if (found == object.end()) malformed(text("\"", key, "\" is missing"));
    return *found;
}

double number(Json const& value, char const* key) {
    if (!value.is_number()) malformed(text("\"", key, "\" is not a number"));
    return value.get<double>();
}

std::int64_t integer(Json const& value, char const* key) {
    if (!value.is_number_integer()) malformed(text("\"", key, "\" is not an integer"));
    if (value.is_number_unsigned() &&
        value.get<std::uint64_t>() > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()))
        malformed(text("\"", key, "\" is out of range"));
    return value.get<std::int64_t>();
}

std::string string(Json const& value, char const* key) {
    if (!value.is_string()) malformed(text("\"", key, "\" is not a string"));
    return value.get<std::string>();
}

bool boolean(Json const& object, char const* key) {
    auto const found = object.find(key);
    if (found == object.end()) return false;
    if (!found->is_boolean()) malformed(text("\"", key, "\" is not true or false"));
    return found->get<bool>();
}

void check_triple(Json const& value, char const* key) {
    if (!value.is_array() || value.size() != 3) malformed(text("\"", key, "\" is not an array of three"));
}

Index3 index(Json const& value, char const* key) {
    check_triple(value, key);
    return {integer(value[0], key), integer(value[1], key), integer(value[2], key)};
}

Vec3 vector(Json const& value, char const* key) {
    check_triple(value, key);
    return {number(value[0], key), number(value[1], key), number(value[2], key)};
}

History history(Json const& value, int depth) {
    if (depth > max_history_depth || !value.is_object()) malformed("\"history\" is malformed");
    History result;
    Json const& command = member(value, "command");
    if (!command.is_array()) malformed("\"history\" is malformed");
    for (auto const& word : command) result.command.push_back(string(word, "history"));
    auto const inputs = value.find("inputs");
    if (inputs == value.end()) return result;
    if (!inputs->is_array()) malformed("\"history\" is malformed");
    for (auto const& input : *inputs) result.inputs.push_back(history(input, depth + 1));
    return result;
}

void read_optional(Json const& object, Header& header) {
    if (auto const i = object.find("units"); i != object.end()) header.units = string(*i, "units");
    if (auto const i = object.find("attributes"); i != object.end()) {
        if (!i->is_object()) malformed("\"attributes\" is not an object");
        for (auto const& [key, value] : i->items()) header.attributes[key] = string(value, "attributes");
    }
    if (auto const i = object.find("part"); i != object.end()) {
        if (!i->is_object()) malformed("\"part\" is not an object");
        header.part = Part{index(member(*i, "global_dims"), "part"), index(member(*i, "offset"), "part"),
                           index(member(*i, "halo"), "part")};
    }
    if (auto const i = object.find("history"); i != object.end()) header.history = history(*i, 0);
    header.dry_run = boolean(object, "dry_run");
    header.timing = boolean(object, "timing");
}

/// Refuses nesting that would exhaust the parser's or our stack before the JSON library sees it.
void check_nesting(std::string_view json) {
    int depth = 0;
    bool in_string = false;
    for (std::size_t i = 0; i < json.size(); ++i) {
        char const c = json[i];
        if (in_string) {
            if (c == '\\') ++i;
            if (c == '"') in_string = false;
        } else if (c == '"') {
            in_string = true;
        } else if (c == '[' || c == '{') {
            if (++depth > 2 * max_history_depth + 10) malformed("nesting is too deep");
        } else if (c == ']' || c == '}') {
            --depth;
        }
    }
}

std::string command_line(History const& step) {
    std::string line = "vkt";
    std::size_t next_substitution = 1; // inputs[0] arrives on standard input, the others by substitution
    for (auto const& word : step.command) {
        if (word == "<(…)" && next_substitution < step.inputs.size())
            line += text(" <(", history_as_shell(step.inputs[next_substitution++]), ")");
        else
            line += text(" ", shell_quoted(word));
    }
    return line;
}

} // namespace

void check(Header const& header) {
    double bytes = static_cast<double>(size_of(header.dtype));
    for (int axis = 0; axis < 3; ++axis) {
        if (header.dims[axis] < 1 || header.dims[axis] > max_extent)
            throw Error(ErrorKind::data, text("dims ", header.dims, " are not between 1 and 2^40 on each axis"));
        if (header.kind == Kind::structured) bytes *= static_cast<double>(header.dims[axis]);
    }
    if (header.kind == Kind::hierarchical) bytes *= static_cast<double>(header.cell_count);
    if (!(bytes < 4.6e18))
        throw Error(ErrorKind::data, text("dims ", header.dims, " of ", header.dtype, " exceed 2^62 bytes"));
    if (header.kind == Kind::hierarchical &&
        (header.brick_count < 0 || header.cell_count < 0 || header.level_count < 1 || header.level_count > 40))
        throw Error(ErrorKind::data, "brick, cell or level counts are impossible");
    check(header.geometry);
    if (!std::isfinite(header.values.slope) || header.values.slope == 0 || !std::isfinite(header.values.intercept))
        throw Error(ErrorKind::data, "the value map's slope or intercept is not finite, or the slope is zero");
}

Header in_utf8(Header header) {
    header.units = in_utf8(header.units);
    std::map<std::string, std::string> attributes;
    for (auto const& [key, value] : header.attributes) attributes[in_utf8(key)] = in_utf8(value);
    header.attributes = std::move(attributes);
    if (header.history) to_utf8(*header.history);
    return header;
}

std::string to_json(Header const& given) {
    Header const header = in_utf8(given);
    Json result;
    result["kind"] = header.kind == Kind::structured ? "structured" : "hierarchical";
    result["dims"] = to_value(header.dims);
    result["dtype"] = std::string(name_of(header.dtype));
    result["spacing"] = to_value(header.geometry.spacing);
    result["origin"] = to_value(header.geometry.origin);
    result["direction"] = Json::array();
    for (auto const& column : header.geometry.direction) result["direction"].push_back(to_value(column));
    result["slope"] = header.values.slope;
    result["intercept"] = header.values.intercept;
    if (header.kind == Kind::hierarchical) {
        result["levels"] = header.level_count;
        result["bricks"] = header.brick_count;
        result["cells"] = header.cell_count;
    }
    if (!header.units.empty()) result["units"] = header.units;
    if (!header.attributes.empty()) result["attributes"] = header.attributes;
    if (header.part) {
        result["part"]["global_dims"] = to_value(header.part->global_dims);
        result["part"]["offset"] = to_value(header.part->offset);
        result["part"]["halo"] = to_value(header.part->halo);
    }
    if (header.dry_run) result["dry_run"] = true;
    if (header.timing) result["timing"] = true;
    if (header.history) result["history"] = to_value(*header.history);
    // One key a line: a person who looks into a stream shall see what it is.
    std::string text = "{";
    for (auto const& [key, value] : result.items())
        text += vkt::text(text.size() > 1 ? ",\n " : "\n ", Json(key).dump(), ": ", value.dump());
    return text + "\n}";
}

Header header_from_json(std::string_view json) {
    check_nesting(json);
    Json const object = Json::parse(json, nullptr, false);
    if (object.is_discarded() || !object.is_object()) throw Error(ErrorKind::data, "the header is not a JSON object");
    Header header;
    std::string const kind = string(member(object, "kind"), "kind");
    if (kind != "structured" && kind != "hierarchical") malformed(text("kind '", kind, "' is unknown"));
    header.kind = kind == "structured" ? Kind::structured : Kind::hierarchical;
    header.dims = index(member(object, "dims"), "dims");
    try {
        header.dtype = parse_data_type(string(member(object, "dtype"), "dtype"));
    } catch (Error const& e) {
        throw Error(ErrorKind::data, e.what());
    }
    header.geometry.spacing = vector(member(object, "spacing"), "spacing");
    header.geometry.origin = vector(member(object, "origin"), "origin");
    Json const& direction = member(object, "direction");
    check_triple(direction, "direction");
    for (std::size_t axis = 0; axis < 3; ++axis) header.geometry.direction[axis] = vector(direction[axis], "direction");
    header.values = {number(member(object, "slope"), "slope"), number(member(object, "intercept"), "intercept")};
    if (header.kind == Kind::hierarchical) {
        std::int64_t const levels = integer(member(object, "levels"), "levels");
        if (levels < 1 || levels > 40) malformed("\"levels\" is out of range");
        header.level_count = static_cast<int>(levels);
        header.brick_count = integer(member(object, "bricks"), "bricks");
        header.cell_count = integer(member(object, "cells"), "cells");
    }
    read_optional(object, header);
    check(header);
    return header;
}

std::string history_as_shell(History const& history) {
    std::string const line = command_line(history);
    return history.inputs.empty() || history.inputs.front().command.empty()
               ? line
               : text(history_as_shell(history.inputs.front()), " | ", line);
}

} // namespace vkt
