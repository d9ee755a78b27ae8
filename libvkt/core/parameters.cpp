// Reading parameter values from words and listing what was given.
// SPDX-License-Identifier: MIT
#include "libvkt/core/parameters.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vkt {
namespace {

/// Adds the option's name to errors of the value parsers.
template <class F> auto named(std::string_view name, F const& parse) {
    try {
        return parse();
    } catch (Error const& e) {
        throw Error(e.kind(), text("--", name, ": ", e.what()), e.hint());
    }
}

} // namespace

double ValueText<double>::read(std::vector<std::string> const& w, std::string_view name) {
    return named(name, [&] { return parse_double(w.front()); });
}

std::int64_t ValueText<std::int64_t>::read(std::vector<std::string> const& w, std::string_view name) {
    return named(name, [&] { return parse_integer(w.front()); });
}

int ValueText<int>::read(std::vector<std::string> const& w, std::string_view name) {
    std::int64_t const value = ValueText<std::int64_t>::read(w, name);
    if (value < std::numeric_limits<int>::min() || value > std::numeric_limits<int>::max())
        throw Error(ErrorKind::usage, text("--", name, ": '", w.front(), "' is out of range"));
    return static_cast<int>(value);
}

std::vector<std::string> ValueText<DataType>::choices() {
    std::vector<std::string> names;
    for (int i = 0; i < data_type_count; ++i) names.emplace_back(name_of(static_cast<DataType>(i)));
    return names;
}

DataType ValueText<DataType>::read(std::vector<std::string> const& w, std::string_view name) {
    return named(name, [&] { return parse_data_type(w.front()); });
}

Index3 ValueText<Index3>::read(std::vector<std::string> const& w, std::string_view name) {
    std::vector<std::string> const parts = w.size() == 1 ? split(w.front(), ',') : w;
    if (parts.size() != 3)
        throw Error(ErrorKind::usage, text("--", name, ": '", join(w, " "), "' is not three integers X Y Z"));
    return named(name, [&] {
        return Index3{parse_integer(parts[0]), parse_integer(parts[1]), parse_integer(parts[2])};
    });
}

Vec3 ValueText<Vec3>::read(std::vector<std::string> const& w, std::string_view name) {
    std::vector<std::string> const parts = w.size() == 1 ? split(w.front(), ',') : w;
    return named(name, [&] {
        if (parts.size() == 1) {
            double const s = parse_double(parts[0]);
            return Vec3{s, s, s};
        }
        if (parts.size() != 3)
            throw Error(ErrorKind::usage, text("'", join(w, " "), "' is not one number or three, X,Y,Z"));
        return Vec3{parse_double(parts[0]), parse_double(parts[1]), parse_double(parts[2])};
    });
}

Parameter& Parameters::flag(std::string name, bool& target, std::string help) {
    Parameter p;
    p.name = std::move(name);
    p.help = std::move(help);
    p.flag = true;
    p.min_values = p.max_values = 0;
    p.set = [&target](std::vector<std::string> const&) { target = true; };
    p.get = [] { return std::vector<std::string>{}; };
    list_.push_back(std::move(p));
    return list_.back();
}

Parameter* Parameters::find(std::string_view name) {
    for (auto& p : list_)
        if (p.name == name || std::find(p.aliases.begin(), p.aliases.end(), name) != p.aliases.end()) return &p;
    return nullptr;
}

bool Parameters::given(std::string_view name) const {
    return std::any_of(list_.begin(), list_.end(), [&](Parameter const& p) { return p.name == name && p.given; });
}

void Parameters::set(std::string_view name, std::vector<std::string> const& words) {
    Parameter* const p = find(name);
    if (p == nullptr) {
        std::vector<std::string> names;
        for (auto const& q : list_) names.push_back(q.name);
        std::string const near = nearest_name(name, names);
        throw Error(ErrorKind::usage, text("unknown parameter '", name, "'"),
                    near.empty() ? "" : text("did you mean '", near, "'?"));
    }
    auto const n = static_cast<int>(words.size());
    if (n < p->min_values || (p->max_values >= 0 && n > p->max_values && !(n == 1 && p->min_values > 1)))
        throw Error(ErrorKind::usage, text("--", name, " takes ", p->min_values, " value(s), not ", n));
    p->set(words);
    p->given = true;
}

std::vector<std::string> Parameters::words() const {
    std::vector<std::string> result;
    for (auto const& p : list_) {
        if (!p.given || !p.in_history || !p.positional) continue;
        for (auto& word : p.get()) result.push_back(std::move(word));
    }
    for (auto const& p : list_) {
        if (!p.given || !p.in_history || p.positional) continue;
        result.push_back("--" + p.name);
        for (auto& word : p.get()) result.push_back(std::move(word));
    }
    return result;
}

} // namespace vkt
