// Partial statistics as JSON, and back.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/grouped_statistics.h"

#include <nlohmann/json.hpp>

#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace vkt {
namespace {

using Json = nlohmann::ordered_json;

constexpr char mark[] = "vkt stats 1";
constexpr std::pair<GroupedBy, char const*> kinds[] = {{GroupedBy::volume, "volume"},
                                                       {GroupedBy::label, "label"},
                                                       {GroupedBy::x, "x"},
                                                       {GroupedBy::y, "y"},
                                                       {GroupedBy::z, "z"}};

/// Long double has no decimal of 17 digits: all of its bits, as C prints and reads them.
std::string bits(long double value) {
    char text[64];
    std::snprintf(text, sizeof text, "%La", value);
    return text;
}

Json extreme(Extreme const& e, bool integer) {
    if (!e.valid) return nullptr;
    return {{"value", integer ? to_text(e.integer) : bits(e.value)}, {"at", {e.where.x, e.where.y, e.where.z}}};
}

/// Reads members of one kind or says that the file is none.
class Reader {
public:
    explicit Reader(std::string const& name) : name_(name) {}

    Error malformed() const {
        return Error(ErrorKind::data, text("'", name_, "' is no partial statistics"),
                     "they are what vkt stats --mergeable prints");
    }
    Json const& member(Json const& object, char const* key) const {
        if (!object.is_object() || !object.contains(key)) throw malformed();
        return object[key];
    }
    std::string word(Json const& value) const {
        if (!value.is_string()) throw malformed();
        return value.get<std::string>();
    }
    std::int64_t count(Json const& value) const {
        if (!value.is_number_unsigned() || value.get<std::uint64_t>() > std::uint64_t{1} << 62) throw malformed();
        return value.get<std::int64_t>();
    }
    double number(Json const& value) const {
        if (!value.is_number()) throw malformed();
        return value.get<double>();
    }
    long double real(Json const& value) const {
        std::string const digits = word(value);
        char* end = nullptr;
        long double const result = std::strtold(digits.c_str(), &end);
        if (digits.empty() || *end != '\0') throw malformed();
        return result;
    }
    /// Up to 39 digits, of which a sign is one.
    Int128 whole(Json const& value) const {
        std::string const digits = word(value);
        bool const negative = digits.starts_with("-");
        std::size_t const first = negative ? 1 : 0;
        if (digits.size() == first || digits.size() > first + 38 ||
            digits.find_first_not_of("0123456789", first) != std::string::npos)
            throw malformed();
        Int128 result = 0;
        for (std::size_t i = first; i < digits.size(); ++i) result = 10 * result + (digits[i] - '0');
        return negative ? -result : result;
    }
    Extreme extreme(Json const& value, bool integer) const {
        Extreme e;
        if (value.is_null()) return e;
        Json const& at = member(value, "at");
        if (!at.is_array() || at.size() != 3) throw malformed();
        e.valid = true;
        e.where = {count(at[0]), count(at[1]), count(at[2])};
        if (integer) e.integer = whole(member(value, "value"));
        e.value = integer ? static_cast<double>(e.integer) : static_cast<double>(real(member(value, "value")));
        return e;
    }

private:
    std::string const& name_;
};

Json json_of(PartialStatistics const& p, bool integer) {
    Moments const& m = p.moments;
    Json json{{"finite", m.finite}, {"nan", m.nan}, {"inf", m.positive_infinity}, {"minus_inf", m.negative_infinity}};
    if (integer)
        json["sum"] = to_text(m.integer_sum);
    else
        json["sum"] = {bits(m.sum), bits(m.sum_error)};
    json["squares"] = to_text(static_cast<Int128>(m.squares));
    json["origin"] = integer ? to_text(p.origin.integer) : bits(p.origin.value);
    json["mean"] = bits(m.mean);
    json["deviations"] = {bits(m.deviations), bits(m.deviations_error)};
    json["min"] = extreme(p.min, integer);
    json["max"] = extreme(p.max, integer);
    json["product"] = {bits(p.product.mantissa), p.product.exponent};
    return json;
}

PartialStatistics partial_of(Json const& json, bool integer, Reader const& read) {
    PartialStatistics p;
    Moments& m = p.moments;
    auto const pair = [&](char const* key) -> Json const& {
        Json const& value = read.member(json, key);
        if (!value.is_array() || value.size() != 2) throw read.malformed();
        return value;
    };
    m.finite = read.count(read.member(json, "finite"));
    m.nan = read.count(read.member(json, "nan"));
    m.positive_infinity = read.count(read.member(json, "inf"));
    m.negative_infinity = read.count(read.member(json, "minus_inf"));
    if (integer) {
        m.integer_sum = read.whole(read.member(json, "sum"));
    } else {
        m.sum = read.real(pair("sum")[0]);
        m.sum_error = read.real(pair("sum")[1]);
    }
    m.squares = static_cast<Unsigned128>(read.whole(read.member(json, "squares")));
    p.origin.known = m.finite > 0;
    Json const& origin = read.member(json, "origin");
    if (integer) p.origin.integer = read.whole(origin);
    p.origin.value = integer ? static_cast<double>(p.origin.integer) : static_cast<double>(read.real(origin));
    m.mean = read.real(read.member(json, "mean"));
    m.deviations = read.real(pair("deviations")[0]);
    m.deviations_error = read.real(pair("deviations")[1]);
    p.min = read.extreme(read.member(json, "min"), integer);
    p.max = read.extreme(read.member(json, "max"), integer);
    p.product.mantissa = read.real(pair("product")[0]);
    if (!pair("product")[1].is_number_integer()) throw read.malformed();
    p.product.exponent = pair("product")[1].get<std::int64_t>();
    return p;
}

GroupedResult result_of(Json const& json, Reader const& read) {
    GroupedResult result;
    if (!json.is_object() || !json.contains("mergeable") || json["mergeable"] != mark) throw read.malformed();
    std::string const by = read.word(read.member(json, "by"));
    bool known = false;
    for (auto const& [kind, name] : kinds)
        if (by == name) {
            result.by = kind;
            known = true;
        }
    if (!known) throw read.malformed();
    try {
        result.type = parse_data_type(read.word(read.member(json, "dtype")));
    } catch (Error const&) {
        throw read.malformed();
    }
    result.values = {read.number(read.member(json, "slope")), read.number(read.member(json, "intercept"))};
    Json const& groups = read.member(json, "groups");
    if (!groups.is_array()) throw read.malformed();
    for (Json const& group : groups) {
        Json const& key = read.member(group, "key");
        if (!key.is_number_integer()) throw read.malformed();
        bool const large = key.is_number_unsigned() && key.get<std::uint64_t>() >> 63 != 0;
        result.unsigned_keys = result.unsigned_keys || large;
        auto const place = large ? static_cast<std::int64_t>(key.get<std::uint64_t>()) : key.get<std::int64_t>();
        result.groups[place].append(partial_of(group, is_integer(result.type), read), result.type);
    }
    return result;
}

} // namespace

std::string to_json(GroupedResult const& r) {
    Json head{{"mergeable", mark}};
    for (auto const& [kind, name] : kinds)
        if (kind == r.by) head["by"] = name;
    head["dtype"] = std::string(name_of(r.type));
    head["slope"] = r.values.slope;
    head["intercept"] = r.values.intercept;
    std::string json = head.dump(1);
    json.resize(json.size() - 2); // the object goes on: without its "\n}"
    json += ",\n \"groups\": [";
    char const* separator = "\n  ";
    for (auto const& [key, partial] : r.groups) {
        std::string const group = json_of(partial, is_integer(r.type)).dump();
        json += text(separator, "{\"key\":", r.key_text(key), ",", group.substr(1));
        separator = ",\n  ";
    }
    return json + "\n ]\n}";
}

GroupedResult grouped_from_json(std::string_view json, std::string const& name) {
    Reader const read(name);
    Json const root = Json::parse(json, nullptr, false);
    if (!root.is_object() && !root.is_array()) throw read.malformed();
    std::optional<GroupedResult> sum;
    for (Json const& part : root.is_array() ? root : Json::array({root})) {
        GroupedResult result = result_of(part, read);
        if (sum)
            sum->add(result);
        else
            sum = std::move(result);
    }
    if (!sum) throw read.malformed();
    return *sum;
}

} // namespace vkt
