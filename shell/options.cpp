// CLI11 does the splitting; values are read by the parameters themselves.
// SPDX-License-Identifier: MIT
#include "shell/options.h"

#include "libvkt/core/error.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <map>

namespace vkt::shell {
namespace {

/// Stands for the sign of negative numbers while CLI11, which would take "-5" for an option, looks at the words.
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

/// A flag put behind lists of numbers: CLI11 would let them take all words that follow.
constexpr char end_of_list[] = "--_end-of-list";

void hide_minus(std::string& word) {
    if (is_negative_number(word)) word[0] = minus;
}

/// Volkit's "-dims" becomes "--dims"; "--dims 1,2,3" and "--dims=1,2,3" become four words, as CLI11 counts words;
/// negative numbers are hidden from it.
std::vector<std::string> prepared(std::vector<std::string> const& words, std::vector<Parameters*> const& lists) {
    std::vector<std::string> result;
    Parameter const* last = nullptr; // the option that the word before names
    bool in_numbers = false;
    for (std::string word : words) {
        if (!is_negative_number(word) && word.size() > 2 && word[0] == '-') {
            std::size_t const dashes = word[1] == '-' ? 2 : 1;
            last = find(lists, word.substr(dashes, word.find('=') - dashes));
            if (dashes == 1 && last != nullptr) word.insert(0, 1, '-');
            std::size_t const equals = word.find('=');
            in_numbers = last != nullptr && last->numbers && equals != std::string::npos;
            if (last == nullptr || !last->is_tuple() || equals == std::string::npos) {
                if (equals != std::string::npos) last = nullptr; // has its value
                result.push_back(std::move(word));
                continue;
            }
            result.push_back(word.substr(0, equals));
            word.erase(0, equals + 1);
        }
        bool const number = is_negative_number(word) || is_number(word);
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

/// Turns CLI11's complaint about surplus words into ours.
[[noreturn]] void unknown_word(std::string const& raw, std::vector<Parameters*> const& lists) {
    std::string const word = restored(raw);
    if (word.size() < 2 || word[0] != '-') throw Error(ErrorKind::usage, text("unexpected argument '", word, "'"));
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
    throw Error(ErrorKind::usage, text("unknown option '", bare, "'"),
                near.empty() ? "see --help" : text("did you mean '", near, "'?"));
}

} // namespace

void parse_words(std::vector<std::string> const& words, std::vector<Parameters*> const& lists) {
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
    if (auto const extra = app.remaining(); !extra.empty()) unknown_word(extra.front(), lists);
    for (Parameters* list : lists) {
        for (Parameter& p : list->all()) {
            if (options[&p]->count() == 0) {
                if (p.required)
                    throw Error(ErrorKind::usage,
                                text("missing ", p.positional ? p.value_name : "--" + p.name, ": ", p.help));
                continue;
            }
            auto& given = values[&p];
            for (auto& word : given) word = restored(word);
            auto const most = static_cast<std::size_t>(std::max(p.max_values, 0));
            if (most > 0 && given.size() > most) {
                if (p.positional) throw Error(ErrorKind::usage, text("unexpected argument '", given[most], "'"));
                throw Error(ErrorKind::usage,
                            text("--", p.name, most == 1 ? " is given more than once" : " is given too many values"));
            }
            p.set(given);
            p.given = true;
        }
    }
}

} // namespace vkt::shell
