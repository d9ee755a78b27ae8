// Refusals that formats share.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/refusals.h"

#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <string>
#include <utility>

namespace vkt {

std::string raw_description(std::string const& name, ReadOptions const& options, std::string_view missing) {
    if (options.asked_by.empty()) return std::string(missing);
    return text("vkt read ", name == "standard input" ? "-" : shell_quoted(name), " ", missing, " | ",
                options.asked_by);
}

void refuse_bricks(Header const& header, std::string_view what) {
    if (header.kind != Kind::structured)
        throw Error(ErrorKind::usage, text(what, " cannot hold bricks"), "make a grid of them first: vkt resample");
}

void refuse_series(bool& begun, std::string_view file, std::string_view extension) {
    if (std::exchange(begun, true))
        throw Error(ErrorKind::usage, text("the input holds several volumes, ", file, " of vkt holds one"),
                    text("write one each: name it like out_%04d", extension));
}

void refuse_bricks_and_series(Header const& header, bool& begun, std::string_view what, std::string_view file,
                              std::string_view extension) {
    refuse_bricks(header, what);
    refuse_series(begun, file, extension);
}

void tell_private_values(WriteOptions const& options, Header const& header, std::string_view format,
                         std::string_view but_for) {
    if (header.values == ValueMap{} || !options.notice) return;
    options.notice(text("other programs take the values of ", format, " files as they are stored,",
                        but_for.empty() ? std::string() : text(" but for ", but_for, ","), " here ",
                        header.values.slope, " * stored + ", header.values.intercept,
                        " is meant; to store what is meant: vkt convert --dtype float32"));
}

std::string part_to_write(std::string const& path, std::string_view what, std::string_view example) {
    auto const [file, part] = file_part(path);
    std::string const hint = text("e.g. -o ", shell_quoted(text(file, ":", example)));
    // That of HDF5 begins with a slash, which is no part of a name.
    std::size_t const begin = example.starts_with('/') && part.starts_with('/') ? 1 : 0;
    if (file == path) return {};
    if (part.size() == begin || part.ends_with('/'))
        throw Error(ErrorKind::usage, text("'", path, "' names no ", what, ": its name is missing"), hint);
    for (std::string const& name : split(part.substr(begin), '/'))
        if (name.empty() || name == "." || name == "..")
            throw Error(ErrorKind::usage,
                        text("'", path, "' names no ", what, ": ",
                             name.empty() ? "a name in it is empty" : text("'", name, "' is no name")),
                        hint);
    return part;
}

namespace {

/// "the attributes a, b, c and 4 more".
std::string listed(std::vector<std::string> const& names) {
    constexpr std::size_t shown = 3;
    if (names.size() == 1) return text("the attribute ", printable(names.front()));
    std::vector<std::string> first;
    for (std::size_t i = 0; i < std::min(shown, names.size()); ++i) first.push_back(printable(names[i]));
    return text("the attributes ", join(first, " "),
                names.size() > shown ? text(" and ", static_cast<std::int64_t>(names.size() - shown), " more") : "");
}

/// Attributes that the format has no place for, and of which nothing else speaks.
std::vector<std::string> lost_attributes(Header const& header, Kept const& kept, bool& labels) {
    std::vector<std::string> names;
    for (auto const& [name, value] : header.attributes) {
        bool const apart = name == "sidecar" || name == "space" || name == "space units";
        if (apart || std::find(kept.named.begin(), kept.named.end(), name) != kept.named.end()) continue;
        if (name.starts_with("Segment"))
            labels = true;
        else
            names.push_back(name);
    }
    return names;
}

} // namespace

void tell_losses(WriteOptions const& options, Header const& header, std::string_view what, Kept const& kept) {
    Geometry const plain, &g = header.geometry;
    std::vector<std::string> lost;
    if (!kept.spacing && !(g.spacing == plain.spacing && g.origin == plain.origin)) lost.emplace_back("the place");
    if (!kept.directions && g.direction != plain.direction) lost.emplace_back("the directions");
    if (!kept.frame && !frame_of(header).empty()) lost.emplace_back("the frame");
    if (!kept.frame && header.attributes.contains("space units")) lost.emplace_back("the unit of lengths");
    if (!kept.values && header.values != ValueMap{}) lost.emplace_back("the map of values");
    for (std::string_view const what_else : kept.besides) lost.emplace_back(what_else);
    if (!kept.values && !header.units.empty()) lost.emplace_back("units");
    if (!kept.attributes) {
        bool labels = false;
        std::vector<std::string> const names = lost_attributes(header, kept, labels);
        if (labels) lost.emplace_back("labels");
        if (!names.empty()) lost.push_back(listed(names));
    }
    if (!kept.sidecar && header.attributes.contains("sidecar")) lost.emplace_back("what stood in the JSON file beside");
    if (lost.empty() || !options.notice) return;
    if (!kept.provenance && !header.error.exact() && !header.error.silent()) lost.emplace_back("the error");
    if (!kept.provenance && !kept.history && header.history) lost.emplace_back("the history");
    options.notice(text(what, " do not hold ", join(lost, ", "), ": not kept"));
}

} // namespace vkt
