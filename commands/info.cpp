// vkt info: what the header of a volume says.
// SPDX-License-Identifier: MIT
#include "libvkt/core/text.h"
#include "shell/command.h"

namespace vkt::shell {
namespace {

/// Two columns; absent values are left out.
std::string described(Header const& header) {
    std::string lines;
    auto const line = [&](std::string const& key, std::string const& value) {
        if (!value.empty()) lines += key + std::string(key.size() < 11 ? 11 - key.size() : 1, ' ') + value + "\n";
    };
    Geometry const& g = header.geometry;
    bool const hierarchical = header.kind == Kind::hierarchical;
    line("kind", hierarchical ? "hierarchical" : "structured");
    line("dims", to_text(header.dims));
    if (hierarchical)
        line("bricks",
             text(header.brick_count, " of ", header.level_count, " levels with ", header.cell_count, " cells"));
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
    for (auto const& [key, value] : header.attributes) line("attribute", text(key, ": ", value));
    if (header.history) line("history", history_as_shell(*header.history));
    return lines;
}

class Info : public Consumer {
public:
    void parameters(Parameters& p) override {
        p.flag("first", first_, "only the first volume: what comes after its header is not read, nor proven whole");
    }
    bool reports() const override { return true; }

    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override {
        Source& source = *inputs.front();
        std::vector<Header> headers;
        while (source.next_volume()) {
            headers.push_back(source.header());
            headers.back().timing = false;
            if (headers.back().dry_run) source.finish();
            if (first_) break;
        }
        context.print(context.json() ? as_json(headers) : as_text(headers));
        return 0;
    }

private:
    /// One object, or an array of them if there are several volumes.
    static std::string as_json(std::vector<Header> const& headers) {
        if (headers.size() == 1) return to_json(headers.front()) + "\n";
        std::string result = "[";
        for (std::size_t i = 0; i < headers.size(); ++i) result += text(i > 0 ? ",\n" : "\n", to_json(headers[i]));
        return result + "\n]\n";
    }

    static std::string as_text(std::vector<Header> const& headers) {
        if (headers.size() == 1) return described(headers.front());
        std::string result;
        for (std::size_t i = 0; i < headers.size(); ++i)
            result += text(i > 0 ? "\n" : "", "volume     ", static_cast<std::int64_t>(i + 1), " of ",
                           std::ssize(headers), "\n", described(headers[i]));
        return result;
    }

    bool first_ = false;
};

} // namespace

Command info_command() {
    return consumer_command<Info>(
        {"Print what the header of a volume says: dims, type, geometry, attributes, history.",
         "Of files only headers are read. A stream is read to its end, which lists every volume and proves that all "
         "of\n"
         "it is whole; --first stops after the first header, and the command before is cut off.",
         {{"A file", "vkt info volume.nrrd"},
          {"For scripts", "vkt info volume.nrrd --json"},
          {"What comes out of a pipeline", "vkt crop volume.nrrd --roi :,:,0:10 | vkt info"}}});
}

} // namespace vkt::shell
