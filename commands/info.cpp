// vkt info: what the header of a volume says.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/reconstruct.h"
#include "libvkt/amr/tree.h"
#include "libvkt/core/collect.h"
#include "libvkt/core/report.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/series.h"
#include "shell/command.h"

namespace vkt::shell {
namespace {

/// What there is to say about a volume; the summary is of trees whose bricks are known.
struct Description {
    std::string format;
    Header header;
    std::vector<std::string> not_read{}; ///< what else the file holds
    std::optional<TreeSummary> tree{};
};

/// Two columns; absent values are left out.
std::string described(Description const& description) {
    Header const& header = description.header;
    std::string lines;
    auto const line = [&](std::string const& key, std::string const& value) {
        if (!value.empty())
            lines += key + std::string(key.size() < 11 ? 11 - key.size() : 1, ' ') + printable(value) + "\n";
    };
    Geometry const& g = header.geometry;
    bool const hierarchical = header.kind == Kind::hierarchical;
    line("format", description.format);
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
    line("bytes",
         text(static_cast<std::int64_t>(header.bytes()), " (", bytes_text(static_cast<double>(header.bytes())), ")"));
    line("spacing", to_text(g.spacing));
    line("origin", to_text(g.origin));
    line("direction", text(g.direction[0], "  ", g.direction[1], "  ", g.direction[2]));
    if (header.values != ValueMap{}) line("values", text(header.values.slope, " * stored + ", header.values.intercept));
    line("units", header.units);
    if (header.part)
        line("part", text(header.part->offset, " of ", header.part->global_dims, ", halo ", header.part->halo));
    for (std::string const& what : description.not_read) line("not read", what);
    for (auto const& [key, value] : header.attributes) line("attribute", text(key, ": ", value));
    if (header.history) line("history", history_as_shell(*header.history));
    return lines;
}

std::string json_of(Description const& description) {
    std::string json = to_json(description.header);
    json.resize(json.size() - 2); // the object goes on: without its "\n}"
    json += text(",\n \"format\": \"", description.format, "\"");
    if (!description.not_read.empty())
        json += text(",\n \"not_read\": [", join(collect(description.not_read, json_string), ", "), "]");
    if (!description.tree) return json + "\n}";
    json += text(",\n \"holes\": ", description.tree->hole_share(), ",\n \"level_list\": [");
    char const* separator = "";
    for (LevelSummary const& level : description.tree->levels) {
        Index3 const width = cell_width(description.header.dims, level.level);
        json += text(separator, "\n  {\"level\": ", level.level, ", \"bricks\": ", level.bricks,
                     ", \"cells\": ", level.cells, ", \"cell_width\": [", width.x, ",", width.y, ",", width.z, "]}");
        separator = ",";
    }
    return json + "\n ]\n}";
}

class Info : public Consumer {
public:
    void parameters(Parameters& p) override {
        p.flag("head", first_, "only the first volume: what comes after its header is not read, nor proven whole");
    }
    bool reports() const override { return true; }

    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override {
        Source& source = *inputs.front();
        std::vector<Description> volumes;
        while (source.next_volume()) {
            // Of a series each file is opened when it is its turn.
            if (context.format() != opened_) format_ = described_format(context);
            opened_ = context.format();
            Header& header = volumes.emplace_back(Description{format_, source.header()}).header;
            header.timing = false;
            volumes.back().not_read = source.not_read();
            if (header.dry_run) source.finish();
            if (first_) break;
            // A file of several variables says this for all of them among its attributes.
            bool const has_bricks = header.kind == Kind::hierarchical && !header.dry_run;
            if (has_bricks && header.attributes.count("variables") == 0)
                volumes.back().tree = summarise(header.dims, source.take_bricks().bricks());
            else if (has_bricks && context.json())
                volumes.back().tree = tree_of_next_file(context);
        }
        context.print(context.json() ? as_json(volumes) : as_text(volumes));
        return 0;
    }

private:
    /// The format; where a file is a stream under the name of another format, as after `vkt crop … > out.nrrd`, this is
    /// said, because other programs will not read it.
    static std::string described_format(Context& context) {
        std::string format = context.format();
        std::string const name = context.stage_info().input_names.front();
        if (format == "vkt" && name != "-" && !lower_case(name).ends_with(".vkt")) {
            std::string const promised = format_of_name(name);
            if (!promised.empty()) {
                context.note(text("'", name, "' is a vkt stream, whatever its name says: -o ", name,
                                  " writes a file, '>' does not"));
                format += text(" (not ", promised, ", as the name says)");
            }
        }
        return format;
    }

    /// Of the next input file that holds several variables: they share one tree, whose bricks come with any of them.
    std::optional<TreeSummary> tree_of_next_file(Context& context) {
        std::string const name = context.stage_info().input_names.front();
        auto const files = matching_files(name == "-" ? "/dev/stdin" : name);
        while (file_ < files.size()) {
            std::string const& file = files[file_++];
            auto const listed = context.open(file);
            if (!listed->next_volume() || listed->header().attributes.count("variables") == 0) continue;
            constexpr std::string_view before = "variable ";
            auto const first = listed->header().attributes.lower_bound(std::string(before));
            ReadOptions choice;
            choice.variable = first->first.substr(before.size());
            auto const chosen = context.open(file, choice);
            chosen->next_volume();
            return summarise(chosen->header().dims, chosen->take_bricks().bricks());
        }
        return {};
    }

    /// One object, or an array of them if there are several volumes.
    static std::string as_json(std::vector<Description> const& volumes) {
        if (volumes.size() == 1) return json_of(volumes.front()) + "\n";
        std::string result = "[";
        for (std::size_t i = 0; i < volumes.size(); ++i) result += text(i > 0 ? ",\n" : "\n", json_of(volumes[i]));
        return result + "\n]\n";
    }

    static std::string as_text(std::vector<Description> const& volumes) {
        if (volumes.size() == 1) return described(volumes.front());
        std::string result;
        for (std::size_t i = 0; i < volumes.size(); ++i)
            result += text(i > 0 ? "\n" : "", "volume     ", static_cast<std::int64_t>(i + 1), " of ",
                           std::ssize(volumes), "\n", described(volumes[i]));
        return result;
    }

    bool first_ = false;
    std::string opened_, format_; ///< of the file, and what is said of it
    std::size_t file_ = 0;        ///< of the inputs, the next to look for a tree in
};

} // namespace

Command info_command() {
    return consumer_command<Info>(
        {"Print what the header of a volume says: dims, type, geometry, attributes, history.",
         "Of files only headers are read. A stream is read to its end, which lists every volume and proves that all "
         "of\n"
         "it is whole; --head stops after the first header, and the command before is cut off.",
         {{"A file", "vkt info volume.nrrd"},
          {"For scripts", "vkt info volume.nrrd --json"},
          {"What comes out of a pipeline", "vkt crop volume.nrrd --roi :,:,0:10 | vkt info"}}});
}

} // namespace vkt::shell
