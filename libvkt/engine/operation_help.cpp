// The registry's knowledge of operations as JSON.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/operation_help.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/execution_options.h"
#include "libvkt/engine/registry.h"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace vkt {
namespace {

using Json = nlohmann::ordered_json;

/// A name that nobody gives a file.
std::string name_of_probe(std::size_t parameter) { return text("\x02", static_cast<std::uint64_t>(parameter)); }

/// Whether the parameter names an input once it and the positionals before it are said, `choice` for the first that has
/// choices.
bool names_input(std::string_view operation, std::size_t parameter, std::string const& choice) {
    auto const probe = make_operation(operation);
    Parameters parameters;
    probe->parameters(parameters);
    bool chosen = false;
    try {
        for (std::size_t i = 0; i <= parameter; ++i) {
            Parameter const& p = parameters.all()[i];
            if (i < parameter && !p.positional) continue;
            if (!p.choices.empty()) {
                if (!choice.empty() && !chosen) p.set({choice});
                chosen = true;
            } else {
                p.set({name_of_probe(i)});
            }
        }
        auto const names = probe->input_names();
        return std::ranges::find(names, name_of_probe(parameter)) != names.end();
    } catch (Error const&) { // it takes numbers
        return false;
    }
}

bool names_input(std::string_view operation, Parameters const& parameters, std::size_t parameter) {
    Parameter const& p = parameters.all()[parameter];
    if (p.flag || !p.choices.empty()) return false;
    auto const first = std::ranges::find_if(
        parameters.all(), [](Parameter const& other) { return other.positional && !other.choices.empty(); });
    if (first == parameters.all().end()) return names_input(operation, parameter, {});
    return std::ranges::any_of(first->choices,
                               [&](std::string const& choice) { return names_input(operation, parameter, choice); });
}

/// What a parameter's values are, found by offering it some: its value must not be needed any more.
std::string kind_of(Parameter const& p) {
    auto const takes = [&](std::string const& word) {
        try {
            p.set(std::vector<std::string>(static_cast<std::size_t>(p.min_values), word));
            return true;
        } catch (Error const&) {
            return false;
        }
    };
    if (p.flag) return "flag";
    if (std::ranges::find(p.choices, "uint8") != p.choices.end()) return "type";
    // "border:0" is more than a choice.
    if (!p.choices.empty())
        return std::ranges::any_of(p.choices, [&](std::string const& word) { return takes(word + ":0"); }) ? "text"
                                                                                                           : "choice";
    if (takes("name") || takes("50%") || !takes("1")) return "text";
    if (!takes("1.5")) return "integer";
    return p.max_values == 1 && takes("1,2,3") ? "vector" : "number";
}

/// The part of a description that says how exact results are, without its heading; taken out.
std::string take_accuracy(std::string& description) {
    constexpr std::string_view heading = "Accuracy: ";
    std::size_t const at = description.starts_with(heading) ? 0 : description.find(text("\n\n", heading));
    if (at == std::string::npos) return {};
    std::string accuracy = description.substr(description.find(heading, at) + heading.size());
    description.erase(at);
    return accuracy;
}

Json described(Parameter const& p, bool volume, bool volume_file = false) {
    Json result;
    result["name"] = p.name;
    result["aliases"] = p.aliases;
    result["value"] = p.value_name;
    result["help"] = p.help;
    result["positional"] = p.positional;
    result["flag"] = p.flag;
    result["required"] = p.required;
    result["volume"] = volume;
    result["volume_file"] = volume_file;
    result["least"] = p.min_values;
    result["most"] = p.max_values;
    result["choices"] = p.choices;
    result["default"] = p.flag || p.required ? std::vector<std::string>{} : p.get();
    result["kind"] = kind_of(p);
    return result;
}

} // namespace

std::string operation_help(std::string_view name) {
    auto const operation = make_operation(name);
    Parameters own, shared;
    ExecutionOptions options;
    operation->parameters(own);
    options.declare(shared);
    Texts texts = operation->texts();
    std::string const accuracy = take_accuracy(texts.description);
    bool const among_arguments = !operation->input_names().empty();
    Json result;
    result["name"] = std::string(name);
    result["alias_of"] = std::string(operation_name(name) == name ? "" : operation_name(name));
    result["summary"] = texts.summary;
    result["description"] = texts.description;
    result["accuracy"] = accuracy;
    result["examples"] = Json::array();
    for (auto const& example : texts.examples)
        result["examples"].push_back(Json{{"what", example.what}, {"line", example.line}});
    result["result"] = operation->shape() == Shape::reduction ? "report" : "volume";
    result["inputs"] = among_arguments ? 0 : operation->inputs();
    result["parameters"] = Json::array();
    for (std::size_t i = 0; i < own.all().size(); ++i)
        result["parameters"].push_back(described(own.all()[i], among_arguments && names_input(name, own, i),
                                                 own.all()[i].name == operation->volume_file()));
    result["execution"] = Json::array();
    for (auto const& p : shared.all()) result["execution"].push_back(described(p, false));
    return result.dump(-1, ' ', false, Json::error_handler_t::replace);
}

} // namespace vkt
