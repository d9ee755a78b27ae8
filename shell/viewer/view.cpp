// Views as settings and as the words of a command line.
// SPDX-License-Identifier: MIT
#include "shell/viewer/view.h"

#include "libvkt/core/text.h"
#include "libvkt/render/colormap.h"
#include "libvkt/render/settings.h"

#include <algorithm>
#include <cmath>
#include <string_view>

namespace vkt::shell::viewer {

using render::Algorithm;
using render::OptionWords;
using render::Projection;
using render::RenderSettings;

View initial_view(RenderSettings const& asked) {
    View view;
    view.width = asked.width, view.height = asked.height;
    Look& look = view.look;
    look.algorithm = asked.algorithm;
    look.colormap = asked.colormap;
    look.step = asked.step, look.exact = asked.exact, look.shade = asked.exact ? -1 : asked.shade;
    look.samples = asked.samples, look.albedo = asked.albedo, look.emission = asked.emission;
    look.unit = asked.unit, look.opacity_scale = asked.opacity_scale;
    look.clip = asked.clip.text;
    return view;
}

RenderSettings settings_of(RenderSettings const& asked, View const& view) {
    RenderSettings s = asked;
    Look const& look = view.look;
    s.width = view.width, s.height = view.height;
    s.algorithm = look.algorithm;
    s.colormap = look.colormap;
    s.exact = look.exact && look.algorithm == Algorithm::ray_marching;
    s.step = look.step;
    s.shade = s.exact ? 0 : look.shade;
    s.samples = look.samples, s.albedo = look.albedo, s.emission = look.emission;
    s.unit = look.unit, s.opacity_scale = look.opacity_scale;
    s.clip.text = look.clip;
    if (look.transfer) apply(*look.transfer, s);
    if (!look.surfaces.empty()) {
        s.isos.clear(), s.iso_colors.clear(), s.iso_opacities.clear();
        for (Surface const& surface : look.surfaces) {
            s.isos.push_back(surface.value);
            s.iso_opacities.push_back(surface.opacity);
            for (double const c : {surface.color.red, surface.color.green, surface.color.blue})
                s.iso_colors.push_back(c);
        }
        bool const opaque =
            std::all_of(s.iso_opacities.begin(), s.iso_opacities.end(), [](double a) { return a == 1; });
        if (opaque) s.iso_opacities.clear();
    }
    // What has no meaning for an algorithm is not to change its picture, as no option could say it.
    RenderSettings const plain;
    if (s.algorithm == Algorithm::implicit_iso) {
        s.opacity = plain.opacity, s.unit = plain.unit, s.opacity_scale = plain.opacity_scale;
    }
    if (s.algorithm == Algorithm::multi_scattering) s.shade = plain.shade;
    if (!view.camera) return s;
    render::CameraRequest request;
    request.eye = view.camera->eye, request.target = view.camera->target, request.up = view.camera->up;
    request.projection = view.camera->projection;
    if (request.projection == Projection::perspective)
        request.fov = view.camera->fov;
    else
        request.span = view.camera->height;
    s.camera = request;
    return s;
}

namespace {

/// Options that exclude or depend on one another: where one changes, all are said anew.
std::vector<std::vector<std::string_view>> const& groups() {
    static std::vector<std::vector<std::string_view>> const all{
        {"size"},
        {"render-algo"},
        {"transfer", "rgba-lookup-table", "colormap", "opacity", "domain"},
        {"unit-distance"},
        {"opacity-scale"},
        {"eye", "view", "azimuth", "elevation", "target", "up", "fov", "zoom", "projection", "span", "fit"},
        {"exact", "shade", "step", "no-skip"},
        {"light-direction"},
        {"ambient"},
        {"specular"},
        {"shadows"},
        {"iso", "iso-color", "iso-opacity"},
        {"spp"},
        {"first-sample"},
        {"seed"},
        {"albedo"},
        {"anisotropy"},
        {"light"},
        {"emission"},
        {"clip-box"}};
    return all;
}

bool takes_no_value(std::string_view name) {
    return name == "exact" || name == "no-skip" || name == "emission" || name == "shadows";
}
bool takes_numbers(std::string_view name) {
    return name == "iso" || name == "iso-color" || name == "iso-opacity" || name == "rgba-lookup-table";
}

std::vector<OptionWords> in_group(std::vector<OptionWords> const& options, std::vector<std::string_view> const& group) {
    std::vector<OptionWords> found;
    for (OptionWords const& o : options)
        if (std::find(group.begin(), group.end(), o.name) != group.end()) found.push_back(o);
    return found;
}

} // namespace

std::vector<std::string> words_of(std::vector<std::string> const& asked_words, RenderSettings const& asked,
                                  View const& view) {
    if (asked_words.empty()) return {}; // no history is wanted
    RenderSettings const shown = settings_of(asked, view);
    std::vector<OptionWords> const before = options_of(asked), now = options_of(shown);
    std::vector<std::string_view> without;
    std::vector<std::string> with;
    for (auto const& group : groups()) {
        std::vector<OptionWords> const said = in_group(now, group);
        if (said == in_group(before, group)) {
            // Said although it is the default, it may still be refused.
            for (std::string_view const name : group)
                if (!render::applies(name, shown.algorithm)) without.push_back(name);
            continue;
        }
        without.insert(without.end(), group.begin(), group.end());
        for (OptionWords const& o : said) {
            with.push_back("--" + o.name);
            with.insert(with.end(), o.values.begin(), o.values.end());
        }
    }
    std::vector<std::string> words{asked_words.front()}, kept;
    for (std::size_t i = 1; i < asked_words.size(); ++i) {
        std::string const& word = asked_words[i];
        bool const option = word.starts_with("--");
        std::string_view const name = option ? std::string_view(word).substr(2) : std::string_view();
        if (!option || std::find(without.begin(), without.end(), name) == without.end()) {
            kept.push_back(word);
            continue;
        }
        if (takes_no_value(name)) continue;
        ++i;
        while (takes_numbers(name) && i + 1 < asked_words.size() && is_number(asked_words[i + 1])) ++i;
    }
    // Inputs come before what takes all numbers that follow; options that are kept stay behind theirs.
    bool const input_first = asked_words.size() > 1 && !asked_words[1].starts_with("--");
    if (input_first) {
        std::size_t inputs = 0;
        while (inputs < kept.size() && !kept[inputs].starts_with("--")) words.push_back(kept[inputs++]);
        kept.erase(kept.begin(), kept.begin() + static_cast<std::ptrdiff_t>(inputs));
    }
    words.insert(words.end(), with.begin(), with.end());
    words.insert(words.end(), kept.begin(), kept.end());
    return words;
}

bool has_colormap(RenderSettings const& asked) { return !asked.transfer && asked.lut.empty(); }

std::string next_colormap(std::string const& current, std::string const& asked) {
    std::vector<std::string> names{asked};
    for (std::string const& name : render::colormap_names())
        if (name != asked) names.push_back(name);
    auto const found = std::find(names.begin(), names.end(), current);
    return found == names.end() || found + 1 == names.end() ? names.front() : *(found + 1);
}

TransferEdit editable_transfer(RenderSettings const& asked, Look const& look, render::RenderReport const& report) {
    if (look.transfer) return *look.transfer;
    std::string const map = look.colormap.empty() ? "tissue" : look.colormap;
    TransferEdit edit = edit_of(report.transfer, has_colormap(asked) ? map : "");
    return edit;
}

std::vector<Surface> editable_surfaces(Look const& look, render::RenderReport const& report) {
    if (!look.surfaces.empty()) return look.surfaces;
    std::vector<Surface> surfaces;
    if (report.transfer.points.empty()) return surfaces;
    TransferEdit const colors = edit_of(report.transfer, "");
    for (double const value : report.isos) surfaces.push_back({value, color_at(colors, value), 1});
    return surfaces;
}

std::string clip_text(Shares const& shares, Index3 dims) {
    std::string text_of;
    bool all = true;
    for (int axis = 0; axis < 3; ++axis) {
        auto const extent = static_cast<double>(dims[axis]);
        auto const& share = shares[static_cast<std::size_t>(axis)];
        std::int64_t const lower =
            std::clamp<std::int64_t>(static_cast<std::int64_t>(std::lround(share[0] * extent)), 0, dims[axis] - 1);
        std::int64_t const upper =
            std::clamp<std::int64_t>(static_cast<std::int64_t>(std::lround(share[1] * extent)), lower + 1, dims[axis]);
        bool const whole = lower == 0 && upper == dims[axis];
        all = all && whole;
        text_of += text(axis == 0 ? "" : ",", whole ? ":" : text(lower, ":", upper));
    }
    return all ? "" : text_of;
}

Shares clip_shares(std::string const& clip, Index3 dims) {
    Shares shares{{{0, 1}, {0, 1}, {0, 1}}};
    if (clip.empty()) return shares;
    Box const box = Roi{clip}.resolve(dims);
    for (int axis = 0; axis < 3; ++axis)
        shares[static_cast<std::size_t>(axis)] = {
            static_cast<double>(box.lower[axis]) / static_cast<double>(dims[axis]),
            static_cast<double>(box.upper[axis]) / static_cast<double>(dims[axis])};
    return shares;
}

} // namespace vkt::shell::viewer
