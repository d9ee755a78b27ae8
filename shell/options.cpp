// CLI11 does the splitting; values are read by the parameters themselves.
// SPDX-License-Identifier: MIT
#include "shell/options.h"

#include "libvkt/core/error.h"
#include "libvkt/formats/request.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <map>

namespace vkt::shell {
namespace {

/// Stands for the '-' that begins a negative number, or a word after "--", while CLI11, which would take it for an
/// option, looks at the words.
constexpr char minus = '\x01';

bool is_negative_number(std::string const& word) {
    return word.size() > 1 && word[0] == '-' && (word[1] == '.' || (word[1] >= '0' && word[1] <= '9'));
}

/// A positional's aliases are options that say the same.
Parameter* find(std::vector<Parameters*> const& lists, std::string const& name) {
    for (Parameters* list : lists)
        if (Parameter* p = list->find(name); p != nullptr && (!p->positional || !p->aliases.empty())) return p;
    return nullptr;
}

/// The option that a word names as a whole, "-o", "--roi" or volkit's "-dims"; null if it names none.
Parameter const* named_option(std::vector<Parameters*> const& lists, std::string const& word) {
    if (word.size() < 2 || word[0] != '-' || is_negative_number(word)) return nullptr;
    if (word.size() == 2)
        for (Parameters* list : lists)
            for (Parameter const& p : list->all())
                if (p.letter == word[1]) return &p;
    return find(lists, word.substr(word[1] == '-' ? 2 : 1, word.find('=') - (word[1] == '-' ? 2 : 1)));
}

[[noreturn]] void missing_value(Parameter const& p, std::string const& next) {
    throw Error(ErrorKind::usage,
                next.empty() ? text("--", p.name, " has no value ", p.value_name)
                             : text("--", p.name, " is followed by '", next, "' instead of its value ", p.value_name),
                next.empty() ? "" : text("a value of that spelling is written --", p.name, "=", next));
}

/// A flag put behind lists of numbers: CLI11 would let them take all words that follow.
constexpr char end_of_list[] = "--_end-of-list";

/// "-v * 2": an argument that begins with a minus, and holds what no option does. -o may have a name behind it.
bool is_formula(std::string const& word) {
    return word.size() > 2 && word[0] == '-' && word[1] != '-' && word[1] != 'o' &&
           word.find_first_of("*+/()[]<>?^ ") != std::string::npos;
}

void hide_minus(std::string& word) {
    if (is_negative_number(word) || is_formula(word)) word[0] = minus;
}

/// Volkit's "-dims" becomes "--dims"; "--dims 1,2,3" and "--dims=1,2,3" become four words, as CLI11 counts words;
/// negative numbers are hidden from it.
std::vector<std::string> prepared(std::vector<std::string> const& words, std::vector<Parameters*> const& lists) {
    std::vector<std::string> result;
    Parameter const* last = nullptr; // the option that the word before names
    bool in_numbers = false, only_arguments = false;
    Parameter const* unfed = nullptr; // the option that the word before is, if a value must follow
    for (std::string word : words) {
        if (only_arguments) {
            if (word.size() > 1 && word[0] == '-') word[0] = minus;
            result.push_back(std::move(word));
            continue;
        }
        Parameter const* const named = named_option(lists, word);
        if (unfed != nullptr && (named != nullptr || word == "--")) missing_value(*unfed, word);
        if (named != nullptr && named->flag && word.find('=') != std::string::npos)
            throw Error(ErrorKind::usage, text("--", named->name, " takes no value"),
                        text("it is said or left out: --", named->name));
        unfed = named != nullptr && !named->flag && word.find('=') == std::string::npos ? named : nullptr;
        if (word == "--") { // all that follows are arguments, whatever they begin with
            only_arguments = true;
            last = nullptr;
            result.emplace_back(end_of_list);
            continue;
        }
        if (!is_negative_number(word) && !is_formula(word) && word.size() > 2 && word[0] == '-') {
            std::size_t const dashes = word[1] == '-' ? 2 : 1;
            last = find(lists, word.substr(dashes, word.find('=') - dashes));
            if (dashes == 1 && last != nullptr) word.insert(0, 1, '-');
            std::size_t const equals = word.find('=');
            in_numbers = last != nullptr && last->numbers && equals != std::string::npos;
            if (last == nullptr || !last->is_tuple() || equals == std::string::npos) {
                if (equals != std::string::npos) last = nullptr; // has its value
                bool const empty = equals + 1 == word.size();    // for which CLI11 would take the next word
                if (empty) word.pop_back();
                result.push_back(std::move(word));
                if (empty) result.emplace_back();
                continue;
            }
            result.push_back(word.substr(0, equals));
            word.erase(0, equals + 1);
        }
        bool const number = is_negative_number(word) || are_numbers(word);
        if (in_numbers && !number) result.emplace_back(end_of_list);
        in_numbers = number && (in_numbers || (last != nullptr && last->numbers));
        if (last != nullptr && last->is_tuple() && word.find(',') != std::string::npos) {
            for (auto& part : split(word, ',')) {
                hide_minus(part);
                result.push_back(std::move(part));
            }
        } else {
            hide_minus(word);
            result.push_back(std::move(word));
        }
        last = nullptr;
    }
    if (unfed != nullptr) missing_value(*unfed, "");
    return result;
}

std::string restored(std::string word) {
    if (!word.empty() && word[0] == minus) word[0] = '-';
    return word;
}

/// Whether a positional is given by an alias; bare words are others' then, wherever they stand.
bool is_said_as_option(Parameter const& p, std::vector<std::string> const& words) {
    return std::any_of(words.begin(), words.end(), [&](std::string const& word) {
        std::string const name = word.substr(0, word.find('='));
        return p.positional && std::any_of(p.aliases.begin(), p.aliases.end(), [&](std::string const& alias) {
                   return name == "--" + alias || name == "-" + alias;
               });
    });
}

std::string spelling(Parameter const& p, bool as_option) {
    if (as_option) return "--" + join(p.aliases, ",--");
    std::string names = p.name;
    if (!p.positional) names = text(p.letter != 0 ? text("-", std::string(1, p.letter), ",") : "", "--", p.name);
    for (auto const& alias : p.aliases) names += ",--" + alias;
    return names;
}

/// The option whose numbers, of which `word` is one, stand in words of their own, "--spacing 1 2 3", as it should be
/// written; empty if there is none.
std::string numbers_in_words(std::string const& word, std::vector<std::string> const& words,
                             std::vector<Parameters*> const& lists) {
    for (std::size_t i = 0; i + 2 < words.size(); ++i) {
        Parameter const* const p = named_option(lists, words[i]);
        if (p == nullptr || p->flag || p->numbers || words[i].find('=') != std::string::npos) continue;
        auto const first = words.begin() + static_cast<std::ptrdiff_t>(i) + 1;
        auto const end = std::find_if_not(first, words.end(), [](std::string const& next) { return is_number(next); });
        if (end - first > 1 && std::find(first + 1, end, word) != end)
            return text(words[i], " ", join({first, end}, ","));
    }
    return {};
}

/// What the words are, and where they came from.
struct Line {
    std::vector<std::string> const& words;
    std::vector<Parameters*> const& lists;
    std::string const& command;
};

[[noreturn]] void unexpected_argument(std::string const& word, Line const& line) {
    auto const& lists = line.lists;
    if (std::string const numbers = numbers_in_words(word, line.words, lists); !numbers.empty())
        throw Error(ErrorKind::usage, text("unexpected argument '", word, "'"),
                    text(std::ranges::count(numbers, ',') == 2 ? "three" : "several",
                         " numbers are written with commas: ", numbers));
    bool const writes =
        std::any_of(lists.begin(), lists.end(), [](Parameters* list) { return list->find("output") != nullptr; });
    if (word.starts_with('-') && word.size() > 1)
        throw Error(ErrorKind::usage, text("unexpected argument '", word, "'"), "options stand before --");
    throw Error(ErrorKind::usage, text("unexpected argument '", word, "'"),
                writes ? text("an output is said as -o ", word, ", a value with spaces in quotes")
                       : "a value with spaces stands in quotes");
}

/// "vkt flip AXIS IN": the arguments in their order.
std::string order_of_arguments(Line const& line) {
    std::string result = "vkt " + line.command;
    for (Parameters* list : line.lists)
        for (Parameter const& p : list->all())
            if (p.positional) result += " " + p.value_name;
    return result;
}

bool is_file(std::string const& word) {
    std::error_code error;
    return std::filesystem::is_regular_file(word, error) || std::filesystem::is_fifo(word, error);
}

/// The value of an option was left out, so that the input behind it stands in its place.
[[noreturn]] void file_instead_of_value(Parameter const& p, std::string const& word, std::string const& message) {
    std::string const refusal = text("'", word, "' is not ");
    std::size_t const at = message.find(refusal);
    std::string what = at == std::string::npos ? text("a value ", p.value_name) : message.substr(at + refusal.size());
    what = what.substr(0, what.find(';'));
    bool const several = !what.starts_with("a ") && !what.starts_with("an ");
    throw Error(ErrorKind::usage,
                text(p.spelling(), " needs ", what, ", '", word, "' is ", several ? "a file" : "not one"),
                text("its value was left out: ", p.spelling(), " ", p.value_name, " ", word));
}

/// Regions are read when the volume is known, and sizes later, but no file's name is one.
bool is_read_later(Parameter const& p, std::string const& word) {
    bool const later = p.name == "roi" || p.name == "roi-world" || p.name == "memory";
    return later && word.find_first_of(":%,") == std::string::npos && (word[0] < '0' || word[0] > '9');
}

/// Sets a parameter from its words; what they are refused for names it. A word that is none of a few and resembles none
/// of them stands in the place of another one.
void set(Parameter& p, std::vector<std::string> const& words, Line const& line) {
    bool const option = !p.positional && !p.flag && words.size() == 1;
    if (option && is_read_later(p, words.front()) && is_file(words.front()))
        file_instead_of_value(p, words.front(), "");
    try {
        p.set(words);
    } catch (Error const& e) {
        std::string const message = e.what();
        if (option && is_file(words.front())) file_instead_of_value(p, words.front(), message);
        bool const named = message.find(p.spelling()) != std::string::npos || message.find(p.name) != std::string::npos;
        bool const misplaced = p.positional && !p.choices.empty() && e.hint().empty();
        throw Error(e.kind(), named ? message : text(p.spelling(), ": ", message),
                    misplaced ? text("it comes first: ", order_of_arguments(line)) : e.hint());
    }
}

/// What describes a file is an option of the command that reads or writes it: how it is said there.
std::string at_files(std::string const& option, Line const& line) {
    Parameters reading, writing;
    ReadRequest().declare(reading);
    WriteRequest().declare(writing);
    auto const has = [&](Parameters& list) {
        return std::ranges::any_of(list.all(), [&](Parameter const& p) { return "--" + p.name == option; });
    };
    if (has(reading)) return text("vkt read takes it: vkt read FILE ", option, " … | vkt ", line.command, " …");
    if (has(writing)) return text("vkt write takes it: vkt ", line.command, " … | vkt write FILE ", option, " …");
    return {};
}

/// Turns CLI11's complaint about surplus words into ours.
[[noreturn]] void unknown_word(std::string const& raw, Line const& line) {
    auto const& lists = line.lists;
    std::string const word = restored(raw);
    if (raw.size() < 2 || raw[0] != '-') unexpected_argument(word, line);
    std::vector<std::string> names;
    for (Parameters* list : lists)
        for (auto const& p : list->all()) {
            if (!p.positional) names.push_back("--" + p.name);
            for (auto const& alias : p.aliases) names.push_back("--" + alias);
        }
    std::string const bare = word.substr(0, word.find('='));
    if (bare == "--each" || bare == "-each")
        throw Error(ErrorKind::usage, text("unknown option '", bare, "'"),
                    "every command treats each of several volumes by itself; see vkt(7)");
    std::string const near = nearest_name(bare.compare(0, 2, "--") == 0 ? bare : "-" + bare, names);
    std::string const help = text("see 'vkt ", line.command, " --help'");
    std::string const elsewhere = at_files(bare, line);
    throw Error(ErrorKind::usage, text("unknown option '", bare, "'"),
                !elsewhere.empty()              ? elsewhere
                : !near.empty()                 ? text("did you mean '", near, "'?")
                : bare.compare(0, 2, "--") == 0 ? help
                                                : text(help, "; arguments that begin with - stand behind --"));
}

} // namespace

void parse_words(std::vector<std::string> const& words, std::vector<Parameters*> const& lists,
                 std::string const& command) {
    Line const line{words, lists, command};
    CLI::App app;
    app.set_help_flag("");
    app.allow_extras();
    app.add_flag(end_of_list);
    std::map<Parameter*, CLI::Option*> options;
    std::map<Parameter*, std::vector<std::string>> values;
    for (Parameters* list : lists) {
        for (Parameter& p : list->all()) {
            if (p.flag) {
                options[&p] = app.add_flag(spelling(p, false));
                continue;
            }
            CLI::Option* const option = app.add_option(spelling(p, is_said_as_option(p, words)), values[&p]);
            option->expected(p.min_values, p.max_values < 0 ? 1 << 24 : p.max_values);
            option->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
            // A vector would swallow all words that follow: those of later positionals, the names of inputs.
            option->allow_extra_args(p.max_values < 0 || (p.max_values > 1 && !p.is_tuple()));
            options[&p] = option;
        }
    }
    std::vector<std::string> reversed = prepared(words, lists);
    std::reverse(reversed.begin(), reversed.end());
    try {
        app.parse(reversed);
    } catch (CLI::ArgumentMismatch const& e) {
        throw Error(ErrorKind::usage, lower_case(std::string(1, e.what()[0])) + (e.what() + 1));
    } catch (CLI::ParseError const& e) {
        throw Error(ErrorKind::usage, e.what());
    }
    if (auto const extra = app.remaining(); !extra.empty()) unknown_word(extra.front(), line);
    for (Parameters* list : lists) {
        for (Parameter& p : list->all()) {
            if (options[&p]->count() == 0) {
                if (p.required) throw Error(ErrorKind::usage, text("missing ", p.spelling(), ": ", p.help));
                continue;
            }
            auto& given = values[&p];
            for (auto& word : given) word = restored(word);
            auto const most = static_cast<std::size_t>(std::max(p.max_values, 0));
            if (most > 0 && given.size() > most) {
                if (p.positional) unexpected_argument(given[most], line);
                throw Error(ErrorKind::usage,
                            text("--", p.name, most == 1 ? " is given more than once" : " is given too many values"));
            }
            set(p, given, line);
            p.given = true;
        }
    }
}

} // namespace vkt::shell
