// Help.
// SPDX-License-Identifier: MIT
#include "shell/help.h"

#include "libvkt/core/error.h"

#include <algorithm>
#include <map>

namespace vkt::shell {
namespace {

constexpr std::size_t column = 30;

std::string padded(std::string line, std::size_t width) {
    if (line.size() + 1 < width) return line.append(width - line.size(), ' ');
    return line + "\n" + std::string(width, ' ');
}

std::string synopsis(Parameter const& p) {
    std::string names = p.letter != 0 ? text("-", std::string(1, p.letter), ", --", p.name) : text("    --", p.name);
    for (auto const& alias : p.aliases) names += text(", --", alias);
    return p.value_name.empty() ? names : text(names, " ", p.value_name);
}

std::string option_lines(Parameters const& parameters) {
    std::string lines;
    for (auto const& p : parameters.all()) {
        if (p.positional) {
            for (auto const& alias : p.aliases)
                lines += text(padded(text("      --", alias, " ", p.value_name), column), "the argument ", p.value_name,
                              ", said as an option\n");
            continue;
        }
        std::string help = p.help;
        if (!p.choices.empty() && p.choices.size() <= 8) help += text(" [", join(p.choices, "|"), "]");
        if (!p.flag && !p.required) {
            auto const value = p.get();
            std::string const shown = join(value, " ");
            if (!shown.empty()) help += text(" (default ", printable(shown), ")");
        }
        lines += text(padded("  " + synopsis(p), column), help, "\n");
    }
    return lines;
}

std::string usage_line(Invocation& invocation) {
    std::string line = "vkt " + invocation.verb().name;
    for (auto const& p : invocation.own_parameters().all())
        if (p.positional) line += p.required ? text(" ", p.value_name) : text(" [", p.value_name, "]");
    if (!invocation.command().verbs.empty()) line += " METHOD";
    int const inputs =
        invocation.operation() ? (invocation.operation()->input_names().empty() ? invocation.operation()->inputs() : 0)
        : invocation.consumer() && invocation.consumer()->input_names().empty() ? invocation.consumer()->inputs()
                                                                                : 0;
    for (int i = 0; i < inputs; ++i) line += " [IN]";
    if (invocation.command().takes_output) return line + " [OUT | -o OUT] [options]";
    if (invocation.yields_volumes()) line += " [-o OUT]";
    return line + " [options]";
}

void examples_into(std::string& lines, Command const& command) {
    for (auto const& example : command.texts.examples) lines += example.line + "\n";
    for (auto const& verb : command.verbs) examples_into(lines, verb.command);
}

/// What people call a command who do not know our word for it.
std::map<std::string, std::string> const& synonyms() {
    static std::map<std::string, std::string> const words{
        {"arith", "clamp difference subtract add multiply divide invert negate"},
        {"brick", "tile chunk block decompose subdivide ghost"},
        {"clahe", "contrast equalize equalise adaptive histogram enhance"},
        {"convert", "cast quantize normalize rescale"},
        {"copy", "paste insert cp"},
        {"crop", "cut trim subvolume clip roi"},
        {"delete", "erase clear blank remove"},
        {"diff", "compare equal cmp"},
        {"distance", "edt euclidean transform depth thickness signed"},
        {"dump", "print values"},
        {"fill-holes", "cavities solid enclosed holes"},
        {"filter bilateral", "denoise edge-preserving"},
        {"filter box", "mean average uniform"},
        {"filter dog", "difference gaussians band blob"},
        {"filter gaussian", "blur smooth denoise gauss"},
        {"filter gradient", "derivative slope edge difference"},
        {"filter kernel", "convolve convolution correlate correlation stencil"},
        {"filter laplacian", "derivative edge curvature"},
        {"filter log", "laplacian gaussian blob edge"},
        {"filter median", "despeckle rank salt pepper"},
        {"filter nlmeans", "denoise non-local means nlm noise"},
        {"filter sharpen", "unsharp unsharp-mask crisp"},
        {"filter sobel", "edge derivative gradient"},
        {"flip", "mirror reverse"},
        {"histogram", "hist histo distribution bins counts frequency"},
        {"info", "metadata header"},
        {"label", "connected components segmentation islands blobs largest"},
        {"chart", "pareto tradeoff accuracy speed benchmark"},
        {"make", "generate create phantom"},
        {"mesh", "isosurface isosurfaces surface contour marching cubes triangles stl ply obj"},
        {"merge", "join assemble stitch compose bricks"},
        {"pad", "extend enlarge border frame margin"},
        {"permute", "transpose swap orientation"},
        {"project", "mip projection reduce flatten"},
        {"morphology", "erode dilate open close tophat erosion dilation opening closing minimum maximum"},
        {"read", "import load open"},
        {"render", "image picture thumbnail screenshot show display plot jpg jpeg photo"},
        {"affine", "transform register registration matrix shear translate tfm"},
        {"resample", "downsample upsample resize shrink zoom"},
        {"rotate", "turn spin euler quaternion reorient"},
        {"scale", "magnify enlarge zoom"},
        {"scan", "prefix cumulative cumsum integral summed area table sat"},
        {"shm", "memory share publish ipc"},
        {"slice", "plane cut section png"},
        {"split", "unstack separate frames slices"},
        {"stack", "concatenate concat join cat mrcat fslmerge series tile"},
        {"threshold", "binarize segment mask otsu"},
        {"stress", "fuzz torture robustness test"},
        {"watershed", "basins flood split separate touching segment segmentation markers minima"},
        {"stats", "average mean sum minimum maximum variance statistics"},
        {"write", "export save"},
        {"transform", "expression formula calc compute map math function"},
    };
    return words;
}
std::string synonyms(std::string const& name) {
    auto const found = synonyms().find(name);
    return found == synonyms().end() ? std::string() : text(" ", found->second);
}

} // namespace

std::string overview() {
    std::string result =
        "vkt: a volume toolset for pipelines\n\n"
        "  vkt read scan.nrrd | vkt resample --scale 0.5 | vkt filter gaussian --sigma 2 | vkt render -o scan.png\n"
        "  vkt crop scan.nrrd --roi 25%:75%,:,: -o part.nrrd\n"
        "  vkt stats scan.nrrd --json\n\nCommands:\n";
    for (auto const& [name, command] : commands()) result += text(padded("  " + name, 16), command.texts.summary, "\n");
    return result +
           "\n'vkt COMMAND --help' explains a command, 'vkt help --search WORD' finds one, man vkt tells the rest.\n";
}

std::string verb_list() {
    std::string result;
    for (auto const& [name, command] : commands()) {
        if (command.verbs.empty()) result += name + "\n";
        for (auto const& verb : command.verbs) result += text(name, " ", verb.name, "\n");
    }
    return result;
}

std::string command_examples(Command const& command) {
    std::string lines;
    examples_into(lines, command);
    return lines;
}

std::string command_help(Invocation& invocation) {
    Command const& command = invocation.command();
    std::string result = text("vkt ", invocation.verb().name, ": ", command.texts.summary, "\n\n");
    for (auto const& example : command.texts.examples) result += text("  # ", example.what, "\n  ", example.line, "\n");
    result += text("\nUsage: ", usage_line(invocation), "\n");
    if (!command.texts.description.empty()) result += text("\n", command.texts.description, "\n");
    if (!command.verbs.empty()) {
        result += "\nMethods:\n";
        for (auto const& [name, verb] : command.verbs)
            result += text(padded("  " + name, 20), verb.texts.summary, "\n");
    }
    std::string positionals;
    for (auto const& p : invocation.own_parameters().all())
        if (p.positional)
            positionals += text(padded("  " + p.value_name, column), p.help,
                                p.choices.empty() ? "" : text(" [", join(p.choices, "|"), "]"), "\n");
    if (!positionals.empty()) result += "\nArguments:\n" + positionals;
    std::string const own = option_lines(invocation.own_parameters());
    if (!own.empty()) result += "\nOptions:\n" + own;
    if (command.operation || command.consumer || command.opener)
        result += "\nCommon options:\n" + option_lines(invocation.common_parameters());
    return result;
}

std::string common_help() {
    Common common;
    Parameters parameters;
    common.declare(parameters, {.volume_output = true, .report = true, .input = true});
    return option_lines(parameters);
}

std::string command_of_synonym(std::string const& word, std::string const& among) {
    std::string const needle = lower_case(word);
    // Who names a method and not the command that has it.
    for (auto const& [command, of] : commands())
        for (auto const& verb : of.verbs)
            if (std::string name = text(command, " ", verb.name); verb.name == needle && name.starts_with(among))
                return name;
    for (auto const& [name, words] : synonyms()) {
        if (!name.starts_with(among)) continue;
        auto const known = split(words, ' ');
        if (std::find(known.begin(), known.end(), needle) != known.end()) return name;
    }
    return {};
}

std::string search(std::string const& word) {
    std::string const needle = lower_case(word);
    std::string result;
    auto const look = [&](std::string const& name, Command const& command) {
        std::string all = name + " " + command.texts.summary + " " + command.texts.description + synonyms(name);
        Invocation invocation({name, &command, {}});
        for (auto const& p : invocation.own_parameters().all())
            all += " " + p.name + " " + p.help + " " + join(p.choices, " ");
        if (lower_case(all).find(needle) != std::string::npos)
            result += text(padded("  " + name, 22), command.texts.summary, "\n");
    };
    for (auto const& [name, command] : commands()) {
        look(name, command);
        for (auto const& [sub, verb] : command.verbs) look(name + " " + sub, verb);
    }
    return result;
}

} // namespace vkt::shell
