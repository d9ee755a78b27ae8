// What is known about a volume without its voxels: the header, and what a tree consists of.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/reconstruct.h"
#include "libvkt/amr/tree.h"
#include "libvkt/core/collect.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/series.h"

#include <cmath>
#include <optional>
#include <string>
#include <vector>

namespace vkt {

namespace {

/// What there is to say about a volume.
struct Description {
    std::string name; ///< of the file, where there are several
    Header header;
    std::string format;                  ///< may be empty
    std::string promised;                ///< another one, that the file's name promises; may be empty
    std::vector<std::string> not_read{}; ///< what else the file holds
    std::optional<TreeSummary> tree{};   ///< of trees whose bricks are known
};

/// Of a tree as a grid of its finest cells. A double: it may be more than any machine has.
double grid_bytes(Header const& header) { return volume_of(header.dims) * static_cast<double>(size_of(header.dtype)); }

std::string count_text(double n) { return n < 0x1p53 ? to_text(static_cast<std::int64_t>(n)) : to_text(n); }

std::string json_of(Description const& description) {
    std::string json = to_json(description.header);
    json.resize(json.size() - 2); // the object goes on: without its "\n}"
    if (!description.name.empty()) json += text(",\n \"name\": ", json_string(description.name));
    if (!description.format.empty()) json += text(",\n \"format\": \"", description.format, "\"");
    if (!description.promised.empty()) json += text(",\n \"format_of_name\": \"", description.promised, "\"");
    if (!description.not_read.empty())
        json += text(",\n \"not_read\": [", join(collect(description.not_read, json_string), ", "), "]");
    if (!description.tree) return json + "\n}";
    json += text(",\n \"table_bytes\": ", static_cast<std::uint64_t>(description.tree->table_bytes),
                 ",\n \"grid_bytes\": ", count_text(grid_bytes(description.header)),
                 ",\n \"holes\": ", description.tree->hole_share(), ",\n \"level_list\": [");
    char const* separator = "";
    for (LevelSummary const& level : description.tree->levels) {
        Index3 const width = cell_width(description.header.dims, level.level);
        json += text(separator, "\n  {\"level\": ", level.level, ", \"bricks\": ", level.bricks,
                     ", \"cells\": ", level.cells, ", \"cell_width\": [", width.x, ",", width.y, ",", width.z, "]}");
        separator = ",";
    }
    return json + "\n ]\n}";
}

/// People read a line for each thing that is known; programs find all of the header.
Report report_of(Description const& description) {
    Header const& header = description.header;
    Report report;
    auto const line = [&](std::string name, std::string_view value) {
        if (!value.empty()) report.add(std::move(name), value);
    };
    Geometry const& g = header.geometry;
    bool const hierarchical = header.kind == Kind::hierarchical;
    line("name", description.name);
    std::string const& promised = description.promised;
    line("format",
         promised.empty() ? description.format : text(description.format, " (not ", promised, ", as the name says)"));
    line("kind", hierarchical ? "hierarchical" : "structured");
    line("dims", to_text(header.dims));
    if (hierarchical && header.attributes.count("roi") > 0) line("region", text(region_of(header).dims()));
    if (hierarchical)
        line("bricks",
             text(header.brick_count, " of ", header.level_count, " levels with ", header.cell_count, " cells"));
    if (description.tree) {
        for (LevelSummary const& level : description.tree->levels)
            line(text("level ", level.level), text(level.bricks, " bricks, ", level.cells, " cells ",
                                                   cell_width(header.dims, level.level), " finest cells wide"));
        line("holes", text(100 * description.tree->hole_share(), " %"));
    }
    line("dtype", to_text(header.dtype));
    auto const bytes = [](double n) { return text(count_text(n), " (", bytes_text(n), ")"); };
    line("bytes", bytes(static_cast<double>(header.bytes())));
    if (description.tree) {
        auto const table = static_cast<double>(description.tree->table_bytes), grid = grid_bytes(header);
        line("table", bytes(table));
        line("as a grid",
             text(bytes(grid), ", ", std::round(10 * grid / (static_cast<double>(header.bytes()) + table)) / 10,
                  " times as much as cells and table"));
    }
    line("spacing", to_text(g.spacing));
    line("origin", to_text(g.origin));
    line("direction", text(g.direction[0], "  ", g.direction[1], "  ", g.direction[2]));
    if (header.values != ValueMap{}) line("values", text(header.values.slope, " * stored + ", header.values.intercept));
    line("units", header.units);
    line("error", to_sentence(header.error, header.units));
    if (header.part)
        line("part", text(header.part->offset, " of ", header.part->global_dims, ", halo ", header.part->halo));
    for (std::string const& what : description.not_read) line("not read", what);
    for (auto const& [key, value] : header.attributes) line("attribute", text(key, ": ", value));
    if (header.history) line("history", history_as_shell(*header.history));
    report.write_as(ReportForm::json, json_of(description));
    return report;
}

/// The format that a stream's name promises where it is another one, as after `vkt crop … > out.nrrd`. This is said,
/// because other programs will not read it.
std::string promised_format(std::string const& format, std::string const& name, StageInfo const& info) {
    if (format != "vkt" || name == "-" || lower_case(name).ends_with(".vkt")) return {};
    std::string promised = format_of_name(name);
    if (!promised.empty() && info.listener)
        info.listener(
            info.name,
            text("'", name, "' is a vkt stream, whatever its name says: -o ", name, " writes a file, '>' does not"),
            false);
    return promised;
}

bool lists_variables(Header const& header) { return header.attributes.count("variables") > 0; }

/// Reports the header of each volume; of hierarchical ones also bricks and cells by level.
class Info : public Operation {
public:
    std::vector<std::string> files;
    bool head = false; ///< only of the first volume, of which nothing more is read

    std::string_view name() const override { return "info"; }
    Texts texts() const override {
        return {"Print what the header of a volume says: dims, type, geometry, attributes, history.",
                "Of files only headers are read. A stream is read to its end, which lists every volume and proves that "
                "all of\n"
                "it is whole; --head stops after the first header, and the command before is cut off."
                "\n\n"
                "Accuracy: Exact.",
                {{"A file", "vkt info volume.nrrd"},
                 {"Several, by name", "vkt flip x volume.nrrd -o flipped.mha && vkt info volume.nrrd flipped.mha"},
                 {"For scripts", "vkt info volume.nrrd --json"},
                 {"What comes out of a pipeline", "vkt crop volume.nrrd --roi :,:,0:10 | vkt info"}}};
    }

    Shape shape() const override { return Shape::reduction; }
    int inputs() const override { return static_cast<int>(input_names().size()); }
    std::vector<std::string> input_names() const override {
        return files.empty() ? std::vector<std::string>{"-"} : files;
    }
    void parameters(Parameters& p) override {
        p.positional("in", files, "inputs: files of any known format, a stream, or '-' (the default)").optional();
        p.flag("head", head, "only the first volume: what comes after its header is not read, nor proven whole");
    }

    Plan plan(std::span<Header const> inputs) const override {
        Plan plan;
        plan.output = inputs.front();
        plan.cost = 0;
        return plan;
    }

    void run(std::span<ConstView const>, AnyView, Execution const&) override {}
    void measure(Measurement& to) override {
        auto const names = input_names();
        for (std::size_t i = 0; i < names.size(); ++i)
            to.attempt(names.size(), [&] { measure_input(*to.inputs[i], names[i], to); });
    }

private:
    void measure_input(Source& source, std::string const& name, Measurement& to) {
        file_ = 0;
        std::string opened, promised;
        while (source.next_volume()) {
            // Of a series each file is opened when it is its turn.
            std::string const now = to.info.format ? to.info.format(name) : "";
            if (now != opened) promised = promised_format(now, name, to.info);
            opened = now;
            Description volume{files.size() > 1 && to.named ? name : "", source.header(), now, promised,
                               source.not_read()};
            Header& header = volume.header;
            header.timing = false;
            bool const planned = header.dry_run;
            if (planned) source.finish();
            bool const has_bricks = header.kind == Kind::hierarchical && !planned && !head;
            // A file of several variables says this for all of them among its attributes.
            if (has_bricks && !lists_variables(header))
                volume.tree = summarise(header.dims, source.take_bricks().bricks());
            else if (has_bricks && to.form == ReportForm::json && !now.empty() && now != "vkt")
                volume.tree = tree_of_next_file(name, to.execution);
            to.report(report_of(volume));
            if (head) break;
        }
    }

    /// Of the next input file that holds several variables: they share one tree, whose bricks come with any of them.
    std::optional<TreeSummary> tree_of_next_file(std::string const& name, Execution const& execution) {
        ReadOptions options;
        options.memory = execution.memory;
        auto const matching = matching_files(name == "-" ? "/dev/stdin" : name);
        while (file_ < matching.size()) {
            std::string const& file = matching[file_++];
            auto const listed = open_volume(open_bytes(file), options);
            if (!listed->next_volume() || !lists_variables(listed->header())) continue;
            constexpr std::string_view before = "variable ";
            auto const first = listed->header().attributes.lower_bound(std::string(before));
            options.variable = first->first.substr(before.size());
            auto const chosen = open_volume(open_bytes(file), options);
            chosen->next_volume();
            return summarise(chosen->header().dims, chosen->take_bricks().bricks());
        }
        return {};
    }

    std::size_t file_ = 0; ///< of an input, the next to look for a tree in
};

} // namespace

VKT_OPERATION(Info, "info")

} // namespace vkt
