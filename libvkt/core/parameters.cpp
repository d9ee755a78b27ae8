// Reading parameter values from words and listing what was given.
// SPDX-License-Identifier: MIT
#include "libvkt/core/parameters.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace vkt {
namespace {

/// Adds what the option or argument is called to errors of the value parsers.
template <class F> auto named(std::string_view name, F const& parse) {
    try {
        return parse();
    } catch (Error const& e) {
        throw Error(e.kind(), text(name, ": ", e.what()), e.hint());
    }
}

bool is_option(std::string const& word) {
    if (word.size() < 2 || word[0] != '-') return false;
    return word[1] != '.' && (word[1] < '0' || word[1] > '9'); // "-" is an input, "-5" a number
}

Parameter& find_option(std::string const& spelling, std::vector<Parameters*> const& lists) {
    std::string const name = spelling.substr(std::min(spelling.find_first_not_of('-'), spelling.size()));
    std::vector<std::string> names;
    for (Parameters* list : lists) {
        for (Parameter& p : list->all()) {
            if (p.letter != 0 && spelling == std::string{'-', p.letter}) return p;
            names.push_back(p.name);
        }
        if (Parameter* const p = list->find(name); p != nullptr) return *p;
    }
    std::string const near = nearest_name(name, names);
    throw Error(ErrorKind::usage, text("unknown option '", spelling, "'"),
                near.empty() ? "" : text("did you mean '--", near, "'?"));
}

/// Whether a word that follows values of a parameter can be one, too.
bool continues(Parameter const& p, std::string const& word) {
    return !is_option(word) && (!p.numbers || are_numbers(word));
}

/// Words that a parameter takes from `next` on: those of a tuple may be one word, "X,Y,Z".
std::size_t words_taken(Parameter const& p, std::vector<std::string> const& words, std::size_t next) {
    auto const least = static_cast<std::size_t>(p.min_values);
    if (p.is_tuple() && next < words.size() && words[next].find(',') != std::string::npos) return 1;
    std::size_t n = 0;
    while (next + n < words.size() && (p.max_values < 0 || n < static_cast<std::size_t>(p.max_values)) &&
           (n == 0 ? !is_option(words[next]) : continues(p, words[next + n])))
        ++n;
    if (n < least)
        throw Error(ErrorKind::usage,
                    text("--", p.name, " takes ", p.min_values, " value(s), not ", static_cast<std::int64_t>(n)));
    return n;
}

} // namespace

std::vector<std::string> parts_of(std::vector<std::string> const& words, std::string_view name) {
    std::vector<std::string> parts;
    for (auto const& word : words)
        for (auto& part : split(word, ',')) parts.push_back(std::move(part));
    if (parts.size() > 1 && std::find(parts.begin(), parts.end(), "") != parts.end())
        throw Error(ErrorKind::usage, text(name, ": '", join(words, ","), "': a number is missing ",
                                           parts.front().empty() ? "before" : "after", " a comma"));
    return parts;
}

bool are_numbers(std::string_view word) {
    auto const parts = split(word, ',');
    return std::all_of(parts.begin(), parts.end(), [](std::string const& part) { return is_number(part); });
}

double ValueText<double>::read(std::vector<std::string> const& w, std::string_view name) {
    std::string const& word = w.front();
    if (word.ends_with('%') && is_number(std::string_view(word).substr(0, word.size() - 1)))
        throw Error(ErrorKind::usage, text(name, ": '", word, "' is a percentage"), "it is an absolute value here");
    return named(name, [&] { return parse_double(word); });
}

std::int64_t ValueText<std::int64_t>::read(std::vector<std::string> const& w, std::string_view name) {
    return named(name, [&] { return parse_integer(w.front()); });
}

int ValueText<int>::read(std::vector<std::string> const& w, std::string_view name) {
    std::int64_t const value = ValueText<std::int64_t>::read(w, name);
    if (value < std::numeric_limits<int>::min() || value > std::numeric_limits<int>::max())
        throw Error(ErrorKind::usage, text(name, ": '", w.front(), "' is out of range"));
    return static_cast<int>(value);
}

std::vector<std::string> ValueText<DataType>::choices() {
    std::vector<std::string> names(data_type_count);
    for (std::size_t i = 0; i < names.size(); ++i) names[i] = name_of(static_cast<DataType>(i));
    return names;
}

DataType ValueText<DataType>::read(std::vector<std::string> const& w, std::string_view name) {
    return named(name, [&] { return parse_data_type(w.front()); });
}

Index3 ValueText<Index3>::read(std::vector<std::string> const& w, std::string_view name) {
    std::vector<std::string> const parts = parts_of(w, name);
    if (parts.size() != 3)
        throw Error(ErrorKind::usage, text(name, ": '", join(w, " "), "' is not three integers X Y Z"));
    return named(name, [&] {
        return Index3{parse_integer(parts[0]), parse_integer(parts[1]), parse_integer(parts[2])};
    });
}

Vec3 ValueText<Vec3>::read(std::vector<std::string> const& w, std::string_view name) {
    std::vector<std::string> const parts = parts_of(w, name);
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

std::vector<std::string> read_words(std::vector<std::string> const& words, std::vector<Parameters*> const& lists) {
    std::map<Parameter const*, std::vector<std::string>> values;
    std::vector<std::string> bare;
    for (std::size_t i = 0; i < words.size();) {
        if (words[i] == "--") { // no options from here on
            bare.insert(bare.end(), words.begin() + static_cast<std::ptrdiff_t>(i + 1), words.end());
            break;
        }
        if (!is_option(words[i])) {
            bare.push_back(words[i++]);
            continue;
        }
        std::size_t const equals = words[i].find('=');
        Parameter& p = find_option(words[i].substr(0, equals), lists);
        bool const again = values.count(&p) > 0;
        if (again && !p.flag && p.max_values >= 0)
            throw Error(ErrorKind::usage, text("--", p.name, " is given more than once"));
        auto& given = values[&p];
        if (equals != std::string::npos) {
            if (p.flag) throw Error(ErrorKind::usage, text("--", p.name, " takes no value"));
            given.push_back(words[i++].substr(equals + 1));
            bool const complete = p.max_values == 1 || (p.is_tuple() && given.back().find(',') != std::string::npos);
            if (complete) continue;
            // The other words of a tuple or list follow.
            while (i < words.size() && (p.max_values < 0 || given.size() < static_cast<std::size_t>(p.max_values)) &&
                   continues(p, words[i]))
                given.push_back(words[i++]);
            continue;
        }
        std::size_t const n = p.flag ? 0 : words_taken(p, words, ++i);
        given.insert(given.end(), words.begin() + static_cast<std::ptrdiff_t>(i),
                     words.begin() + static_cast<std::ptrdiff_t>(i + n));
        i += p.flag ? 1 : n;
    }
    // Positionals take the words without a name in the order of declaration; all values are set in that order, too.
    std::size_t next = 0;
    for (Parameters* list : lists)
        for (Parameter& p : list->all()) {
            if (p.positional && values.count(&p) == 0 && next < bare.size()) {
                std::size_t const n = words_taken(p, bare, next);
                values[&p].assign(bare.begin() + static_cast<std::ptrdiff_t>(next),
                                  bare.begin() + static_cast<std::ptrdiff_t>(next + n));
                next += n;
            }
            if (values.count(&p) > 0) {
                p.set(values[&p]);
                p.given = true;
            } else if (p.required) {
                throw Error(ErrorKind::usage, text("missing ", p.spelling(), ": ", p.help));
            }
        }
    return {bare.begin() + static_cast<std::ptrdiff_t>(next), bare.end()};
}

} // namespace vkt
