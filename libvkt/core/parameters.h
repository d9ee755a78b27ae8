// Parameters declared once: the same list serves the command line, help, completion, history and the C API.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/roi.h"
#include "libvkt/core/text.h"
#include "libvkt/core/types.h"

#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace vkt {

/// One option or positional argument, bound to a variable through its set and get functions.
struct Parameter {
    std::string name;                 ///< without dashes
    std::vector<std::string> aliases; ///< other long spellings, without dashes
    char letter = 0;                  ///< one-letter form, 0 for none
    std::string value_name;           ///< placeholder in help; empty for flags
    std::string help;
    bool positional = false;
    bool flag = false;
    bool required = false;
    bool in_history = true;             ///< part of the provenance: it decides the voxels
    int min_values = 1, max_values = 1; ///< words it takes; max_values -1 takes all that follow
    bool numbers = false;               ///< takes any number of numbers: the first other word ends the list
    bool triple = false;                ///< takes "X,Y,Z" in one word
    std::vector<std::string> choices;
    bool given = false;

    /// What messages call it: "--axis", or "AXIS" of a positional.
    std::string spelling() const { return positional ? value_name : "--" + name; }

    /// Takes exactly so many words, or one with commas between: "X Y Z", "X,Y,Z".
    bool is_tuple() const { return min_values == max_values && min_values > 1; }

    std::function<void(std::vector<std::string> const&)> set; ///< throws Error{usage}
    std::function<std::vector<std::string>()> get;            ///< words that set() would take

    Parameter& alias(std::string other) {
        aliases.push_back(std::move(other));
        return *this;
    }
    Parameter& short_form(char c) {
        letter = c;
        return *this;
    }
    Parameter& needed() {
        required = true;
        return *this;
    }
    Parameter& optional() {
        required = false;
        return *this;
    }
    Parameter& not_in_history() {
        in_history = false;
        return *this;
    }
    Parameter& values(int least, int most) {
        min_values = least;
        max_values = most;
        return *this;
    }
};

/// Names of an enumeration's values, for parsing and help. Specialise: static std::vector<std::pair<E, char const*>>
/// all().
template <class E> struct EnumNames;

template <class E> std::string enum_name(E value) {
    for (auto const& [candidate, name] : EnumNames<E>::all())
        if (candidate == value) return name;
    return "?";
}

template <class E> E parse_enum(std::string_view word, std::string_view what) {
    std::vector<std::string> names;
    for (auto const& [candidate, name] : EnumNames<E>::all()) {
        if (word == name) return candidate;
        names.emplace_back(name);
    }
    std::string const near = nearest_name(word, names);
    throw Error(ErrorKind::usage, text(what, ": '", word, "' is not one of ", join(names, ", ")),
                near.empty() ? "" : text("did you mean '", near, "'?"));
}

template <> struct EnumNames<Boundary> {
    static std::vector<std::pair<Boundary, char const*>> all() {
        return {{Boundary::mirror, "mirror"},
                {Boundary::clamp, "clamp"},
                {Boundary::wrap, "wrap"},
                {Boundary::border, "border"}};
    }
};
template <> struct EnumNames<Axis> {
    static std::vector<std::pair<Axis, char const*>> all() { return {{Axis::x, "x"}, {Axis::y, "y"}, {Axis::z, "z"}}; }
};

/// Reads a value from its words and writes it back. Specialised for every type that parameters may have. `name` is what
/// messages call the parameter: "--axis", or "AXIS" of a positional.
template <class T, class Enable = void> struct ValueText;

template <class T> constexpr bool is_list_of_numbers = false;
template <class T> constexpr bool is_list_of_numbers<std::vector<T>> = std::is_arithmetic_v<T>;
template <class T> constexpr bool is_triple = std::is_same_v<T, Vec3>;
template <class T> constexpr bool is_triple<std::optional<T>> = is_triple<T>;

/// The declared parameters of an operation or command. References returned stay valid while the list lives.
class Parameters {
public:
    /// `--name VALUE`
    template <class T> Parameter& option(std::string name, T& target, std::string value_name, std::string help) {
        std::string const spelling = "--" + name;
        return add<T>(std::move(name), target, std::move(value_name), std::move(help), spelling);
    }
    /// A word without dashes, in the order of declaration.
    template <class T> Parameter& positional(std::string name, T& target, std::string help) {
        std::string upper = name;
        for (char& c : upper) c = static_cast<char>(c >= 'a' && c <= 'z' ? c - 32 : c);
        Parameter& p = add<T>(std::move(name), target, upper, std::move(help), upper);
        p.positional = true;
        p.required = true;
        return p;
    }
    /// `--name`
    Parameter& flag(std::string name, bool& target, std::string help);

    std::deque<Parameter> const& all() const { return list_; }
    std::deque<Parameter>& all() { return list_; }
    Parameter* find(std::string_view name); ///< by name or alias, options and positionals alike
    bool given(std::string_view name) const;
    /// Sets one by name; throws Error{usage} for unknown names (with a suggestion) and unreadable values.
    void set(std::string_view name, std::vector<std::string> const& words);
    /// Canonical words of all given parameters that decide the result: positionals first, then options.
    std::vector<std::string> words() const;

private:
    template <class T>
    Parameter& add(std::string name, T& target, std::string value_name, std::string help, std::string spelling) {
        Parameter p;
        p.name = std::move(name);
        p.value_name = std::move(value_name);
        p.help = std::move(help);
        p.min_values = ValueText<T>::min_words;
        p.max_values = ValueText<T>::max_words;
        p.numbers = is_list_of_numbers<T>;
        p.choices = ValueText<T>::choices();
        p.triple = is_triple<T>;
        p.set = [&target, called = std::move(spelling)](std::vector<std::string> const& words) {
            target = ValueText<T>::read(words, called);
        };
        p.get = [&target] { return ValueText<T>::write(target); };
        list_.push_back(std::move(p));
        return list_.back();
    }

    std::deque<Parameter> list_;
};

/// Reads the words of a command line into the lists and returns the words that no positional took. Options may be
/// spelled `--name VALUE…`, `--name=VALUE` or, as volkit does, `-name`; positionals also `--name VALUE`. Throws
/// Error{usage}. This is for callers inside the process; the shell has a parser of its own for what people type.
std::vector<std::string> read_words(std::vector<std::string> const& words, std::vector<Parameters*> const& lists);

/// The numbers of "X Y Z" or "X,Y,Z". Throws Error{usage} where one is missing at a comma.
std::vector<std::string> parts_of(std::vector<std::string> const& words, std::string_view name);
/// A number, or several with commas between.
bool are_numbers(std::string_view word);

/// Base for values of exactly one word.
struct OneWord {
    static constexpr int min_words = 1, max_words = 1;
    static std::vector<std::string> choices() { return {}; }
};

template <> struct ValueText<std::string> : OneWord {
    static std::string read(std::vector<std::string> const& w, std::string_view) { return w.front(); }
    static std::vector<std::string> write(std::string const& v) { return {v}; }
};
template <> struct ValueText<double> : OneWord {
    static double read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(double v) { return {to_text(v)}; }
};
template <> struct ValueText<std::int64_t> : OneWord {
    static std::int64_t read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(std::int64_t v) { return {to_text(v)}; }
};
template <> struct ValueText<int> : OneWord {
    static int read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(int v) { return {to_text(v)}; }
};
template <> struct ValueText<DataType> : OneWord {
    static std::vector<std::string> choices();
    static DataType read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(DataType v) { return {to_text(v)}; }
};
template <> struct ValueText<Roi> : OneWord {
    static Roi read(std::vector<std::string> const& w, std::string_view name) { return {w.front(), std::string(name)}; }
    static std::vector<std::string> write(Roi const& v) { return {v.text}; }
};
template <> struct ValueText<WorldRoi> : OneWord {
    static WorldRoi read(std::vector<std::string> const& w, std::string_view) { return {w.front()}; }
    static std::vector<std::string> write(WorldRoi const& v) { return {v.text}; }
};
/// Three words "X Y Z" or one "X,Y,Z".
template <> struct ValueText<Index3> {
    static constexpr int min_words = 3, max_words = 3;
    static std::vector<std::string> choices() { return {}; }
    static Index3 read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(Index3 v) { return {to_text(v.x), to_text(v.y), to_text(v.z)}; }
};
/// One word: "S" for all axes or "X,Y,Z".
template <> struct ValueText<Vec3> : OneWord {
    static Vec3 read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(Vec3 v) { return {text(v.x, ",", v.y, ",", v.z)}; }
};
template <class E> struct ValueText<E, std::enable_if_t<std::is_enum_v<E> && !std::is_same_v<E, DataType>>> : OneWord {
    static std::vector<std::string> choices() {
        std::vector<std::string> names;
        for (auto const& entry : EnumNames<E>::all()) names.emplace_back(entry.second);
        return names;
    }
    static E read(std::vector<std::string> const& w, std::string_view name) { return parse_enum<E>(w.front(), name); }
    static std::vector<std::string> write(E v) { return {enum_name(v)}; }
};
template <class T> struct ValueText<std::optional<T>> {
    static constexpr int min_words = ValueText<T>::min_words, max_words = ValueText<T>::max_words;
    static std::vector<std::string> choices() { return ValueText<T>::choices(); }
    static std::optional<T> read(std::vector<std::string> const& w, std::string_view name) {
        return ValueText<T>::read(w, name);
    }
    static std::vector<std::string> write(std::optional<T> const& v) {
        return v ? ValueText<T>::write(*v) : std::vector<std::string>{};
    }
};
/// All words that follow, one element each; numbers may stand in one word, "X,Y,Z", too.
template <class T> struct ValueText<std::vector<T>> {
    static constexpr int min_words = 1, max_words = -1;
    static std::vector<std::string> choices() { return ValueText<T>::choices(); }
    static std::vector<T> read(std::vector<std::string> const& w, std::string_view name) {
        return collect(std::is_arithmetic_v<T> ? parts_of(w, name) : w,
                       [&](std::string const& word) { return ValueText<T>::read({word}, name); });
    }
    static std::vector<std::string> write(std::vector<T> const& v) {
        return collect(v, [](T const& element) { return ValueText<T>::write(element).front(); });
    }
};

} // namespace vkt
