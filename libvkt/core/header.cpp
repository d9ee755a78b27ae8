// Headers as JSON, and their validity.
// SPDX-License-Identifier: MIT
#include "libvkt/core/header.h"

#include "libvkt/core/error.h"
#include "libvkt/core/report.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

namespace vkt {
namespace {

using Json = nlohmann::ordered_json;

/// Nested steps are read by recursion; what lies deeper is counted.
constexpr std::size_t deepest_step = most_history_steps;
/// Objects and arrays within each other. The library needs memory, but no stack, for each.
constexpr int deepest_nesting = 2'000'000;

Json to_value(Index3 v) { return Json::array({v.x, v.y, v.z}); }
Json to_value(Vec3 v) { return Json::array({v.x, v.y, v.z}); }

Json to_value(History const& history) {
    Json result;
    result["command"] = history.command;
    if (history.earlier > 0) result["earlier"] = history.earlier;
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

constexpr std::array<char const*, 4> certainties{"exact", "bound", "estimate", "unknown"};

Json to_value(VolumeError const& error) {
    Json result;
    result["kind"] = certainties[static_cast<std::size_t>(error.kind)];
    if (error.kind == Certainty::bound || error.kind == Certainty::estimate) result["at_most"] = error.at_most;
    if (error.values) result["values"] = Json::array({error.values->low, error.values->high});
    if (!error.because.empty()) result["because"] = error.because;
    return result;
}

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

/// The words and the count of one step.
History step_of(Json const& value) {
    if (!value.is_object()) malformed("\"history\" is malformed");
    History result;
    Json const& command = member(value, "command");
    if (!command.is_array()) malformed("\"history\" is malformed");
    for (auto const& word : command) result.command.push_back(string(word, "history"));
    if (auto const i = value.find("earlier"); i != value.end()) result.earlier = integer(*i, "history");
    if (result.earlier < 0) malformed("\"history\" is malformed");
    result.earlier = std::min(result.earlier, step_count({{}, {}, result.earlier}));
    return result;
}

/// What a step read; none if there is nothing.
Json const* inputs_of(Json const& value) {
    auto const inputs = value.find("inputs");
    if (inputs == value.end()) return nullptr;
    if (!inputs->is_array()) malformed("\"history\" is malformed");
    return &*inputs;
}

/// The steps of a branch, without recursion, because it may be long.
std::int64_t count_steps(Json const& value) {
    std::int64_t count = 0;
    for (std::vector<Json const*> next{&value}; !next.empty();) {
        Json const& step = *next.back();
        next.pop_back();
        count = step_count({{}, {step_of(step)}, count});
        if (Json const* const inputs = inputs_of(step))
            for (auto const& input : *inputs) next.push_back(&input);
    }
    return count;
}

History history(Json const& value, std::size_t depth) {
    if (depth == deepest_step) return {{}, {}, count_steps(value)};
    History result = step_of(value);
    if (Json const* const inputs = inputs_of(value))
        for (auto const& input : *inputs) result.inputs.push_back(history(input, depth + 1));
    return result;
}

VolumeError volume_error(Json const& value) {
    if (!value.is_object()) malformed("\"error\" is not an object");
    VolumeError error;
    std::string const kind = string(member(value, "kind"), "error");
    auto const known = std::ranges::find(certainties, kind);
    // What a later version knows to say is not understood here.
    if (known == certainties.end()) return VolumeError::lost(text("its kind, '", kind, "', is not known here"));
    error.kind = static_cast<Certainty>(known - certainties.begin());
    if (error.kind == Certainty::bound || error.kind == Certainty::estimate) {
        error.at_most = number(member(value, "at_most"), "error");
        if (!std::isfinite(error.at_most) || error.at_most < 0)
            malformed("\"error\" is not a finite number that is at least 0");
    }
    if (auto const i = value.find("values"); i != value.end()) {
        if (!i->is_array() || i->size() != 2) malformed("\"error\" has \"values\" that are not two numbers");
        error.values = ValueInterval{number((*i)[0], "error"), number((*i)[1], "error")};
        if (!error.values->finite() || error.values->low > error.values->high)
            malformed("\"error\" has \"values\" that are no range");
    }
    if (auto const i = value.find("because"); i != value.end()) error.because = string(*i, "error");
    return error;
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
    if (auto const i = object.find("error"); i != object.end()) header.error = volume_error(*i);
    if (auto const i = object.find("history"); i != object.end()) header.history = folded(history(*i, 0));
    header.dry_run = boolean(object, "dry_run");
    if (auto const i = object.find("planned"); i != object.end()) header.planned = folded(history(*i, 0));
    header.timing = boolean(object, "timing");
}

/// Refuses nesting that would cost far more memory than the text before the JSON library sees it.
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
            if (++depth > deepest_nesting) malformed("nesting is too deep");
        } else if (c == ']' || c == '}') {
            --depth;
        }
    }
}

/// JSON in which a terminal finds nothing to act on: the library escapes only what JSON asks for. Such characters can
/// only stand within strings.
std::string with_escapes(std::string_view json) {
    std::string result;
    while (!json.empty()) {
        Character const c = first_character(json);
        if (c.visible() || c.code < 0x7f)
            result += json.substr(0, c.bytes);
        else
            result += json_string(json.substr(0, c.bytes)).substr(1, 6);
        json.remove_prefix(c.bytes);
    }
    return result;
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

std::string to_json(VolumeError const& error) {
    return with_escapes(to_value(error).dump(-1, ' ', false, Json::error_handler_t::replace));
}

VolumeError volume_error_from_json(std::string_view json) {
    check_nesting(json);
    Json const object = Json::parse(json, nullptr, false);
    if (object.is_discarded()) malformed("\"error\" is not an object");
    return volume_error(object);
}

std::string to_sentence(VolumeError const& error, std::string const& units) {
    if (error.exact()) return "exact";
    if (!error.known()) return error.because.empty() ? "unknown" : text("unknown: ", error.because);
    // Two digits that are not below the number, but for what rounding added to it.
    std::string digits;
    for (double v = error.at_most;; v = std::max(1.01 * v, std::nextafter(v, HUGE_VAL))) { // subnormals stay at 1.01
        digits = two_digits(v);
        if (!(std::strtod(digits.c_str(), nullptr) < error.at_most * (1 - 1e-9))) break;
    }
    std::string const amount = text(digits, units.empty() ? "" : " ", units);
    return error.kind == Certainty::bound ? text("within ", amount, " of exact")
                                          : text("about ", amount, " from exact");
}

std::optional<ValueInterval> values_of(DataType type, ValueMap const& map) {
    if (!is_integer(type)) return {};
    double const first = map.physical(lowest_of(type)), last = map.physical(highest_of(type));
    return ValueInterval{std::min(first, last), std::max(first, last)};
}

std::optional<ValueInterval> values_of(Header const& header) {
    auto const limit = values_of(header.dtype, header.values);
    if (!header.error.values) return limit;
    return limit ? header.error.values->within(*limit) : header.error.values;
}

void mark_as_given(Header& header) {
    if (header.error.silent() && !header.history) header.error = VolumeError::given();
}

Header in_utf8(Header header) {
    header.units = in_utf8(header.units);
    std::map<std::string, std::string> attributes;
    for (auto const& [key, value] : header.attributes) attributes[in_utf8(key)] = in_utf8(value);
    header.attributes = std::move(attributes);
    header.error.because = in_utf8(header.error.because);
    if (header.history) to_utf8(*header.history);
    if (header.planned) to_utf8(*header.planned);
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
    if (!header.error.silent()) result["error"] = to_value(header.error);
    if (header.dry_run) result["dry_run"] = true;
    if (header.dry_run && header.planned) result["planned"] = to_value(folded(*header.planned));
    if (header.timing) result["timing"] = true;
    if (header.history) result["history"] = to_value(folded(*header.history));
    // One key a line: a person who looks into a stream shall see what it is.
    std::string text = "{";
    for (auto const& [key, value] : result.items())
        text += vkt::text(text.size() > 1 ? ",\n " : "\n ", Json(key).dump(), ": ",
                          with_escapes(value.dump(-1, ' ', false, Json::error_handler_t::replace)));
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

} // namespace vkt
