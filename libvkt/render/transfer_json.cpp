// Transfer functions as JSON files.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/render/transfer.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace vkt::render {

using Json = nlohmann::json;

namespace {

Error malformed() {
    return Error(ErrorKind::data, "the transfer function file is malformed",
                 R"(it looks like {"points": [[value, r, g, b, a], …], "unit": 1})");
}

TransferFunction checked(TransferFunction transfer) {
    try {
        transfer.check_and_sort();
    } catch (Error const& error) {
        throw Error(ErrorKind::data, error.what(), error.hint());
    }
    return transfer;
}

/// Rows of four numbers from one flat list.
std::vector<std::array<double, 4>> rows_of(Json const& list) {
    if (!list.is_array() || list.empty() || list.size() % 4 != 0) throw malformed();
    std::vector<std::array<double, 4>> rows(list.size() / 4);
    for (std::size_t i = 0; i < list.size(); ++i) {
        if (!list[i].is_number()) throw malformed();
        rows[i / 4][i % 4] = list[i].get<double>();
    }
    std::stable_sort(rows.begin(), rows.end(), [](auto const& a, auto const& b) { return a[0] < b[0]; });
    return rows;
}

/// The straight lines through the rows at a value: columns 1 to 3.
std::array<double, 3> at_value(std::vector<std::array<double, 4>> const& rows, double value) {
    auto const above = std::find_if(rows.begin(), rows.end(), [&](auto const& r) { return r[0] >= value; });
    if (above == rows.end()) return {rows.back()[1], rows.back()[2], rows.back()[3]};
    if (above == rows.begin()) return {above->at(1), above->at(2), above->at(3)};
    auto const &a = *(above - 1), &b = *above;
    double const f = (value - a[0]) / (b[0] - a[0]);
    return {std::lerp(a[1], b[1], f), std::lerp(a[2], b[2], f), std::lerp(a[3], b[3], f)};
}

/// ParaView's opacities are straight lines (its midpoints and sharpness are left at 0.5 and 0); ours are straight in
/// extinction, so that points lie between.
TransferFunction from_paraview(Json const& preset) {
    if (!preset.is_object() || !preset.contains("RGBPoints")) throw malformed();
    auto const colors = rows_of(preset["RGBPoints"]);
    std::vector<std::array<double, 4>> opacities{{colors.front()[0], 0, 0.5, 0}, {colors.back()[0], 1, 0.5, 0}};
    if (preset.contains("Points") && !preset["Points"].is_null()) opacities = rows_of(preset["Points"]);
    std::vector<double> values;
    for (auto const& c : colors) values.push_back(c[0]);
    constexpr int parts = 16;
    for (std::size_t i = 0; i < opacities.size(); ++i) {
        values.push_back(opacities[i][0]);
        if (i > 0 && opacities[i][1] != opacities[i - 1][1])
            for (int k = 1; k < parts; ++k)
                values.push_back(std::lerp(opacities[i - 1][0], opacities[i][0], k / static_cast<double>(parts)));
    }
    std::sort(values.begin(), values.end());
    values.erase(std::unique(values.begin(), values.end()), values.end());
    TransferFunction transfer;
    for (double const v : values) {
        auto const c = at_value(colors, v), a = at_value(opacities, v);
        transfer.points.push_back({v, {c[0], c[1], c[2]}, a[0]});
    }
    if (preset.contains("ScalarOpacityUnitDistance") && preset["ScalarOpacityUnitDistance"].is_number())
        transfer.unit = preset["ScalarOpacityUnitDistance"].get<double>();
    return checked(std::move(transfer));
}

} // namespace

TransferFunction transfer_from_json(std::string const& json) {
    Json const root = Json::parse(json, nullptr, false);
    if (root.is_array() && !root.empty()) return from_paraview(root.front());
    if (root.is_object() && root.contains("RGBPoints")) return from_paraview(root);
    if (!root.is_object() || !root.contains("points") || !root["points"].is_array()) throw malformed();
    TransferFunction transfer;
    double lower = 0, width = 1;
    if (root.contains("domain")) {
        Json const& domain = root["domain"];
        if (!domain.is_array() || domain.size() != 2 || !domain[0].is_number() || !domain[1].is_number())
            throw malformed();
        lower = domain[0].get<double>();
        width = domain[1].get<double>() - lower;
    }
    for (Json const& point : root["points"]) {
        if (!point.is_array() || point.size() != 5) throw malformed();
        for (Json const& number : point)
            if (!number.is_number()) throw malformed();
        transfer.points.push_back({lower + width * point[0].get<double>(),
                                   {point[1].get<double>(), point[2].get<double>(), point[3].get<double>()},
                                   point[4].get<double>()});
    }
    if (root.contains("unit")) {
        if (!root["unit"].is_number() || !(root["unit"].get<double>() > 0)) throw malformed();
        transfer.unit = root["unit"].get<double>();
    }
    if (root.contains("colors")) {
        if (root["colors"] != "srgb" && root["colors"] != "linear") throw malformed();
        transfer.linear_colors = root["colors"] == "linear";
    }
    return checked(std::move(transfer));
}

std::string transfer_to_json(TransferFunction const& transfer) {
    Json points = Json::array();
    for (ControlPoint const& p : transfer.points)
        points.push_back({p.value, p.color.red, p.color.green, p.color.blue, p.alpha});
    Json root{{"points", points}, {"colors", transfer.linear_colors ? "linear" : "srgb"}};
    if (transfer.unit > 0) root["unit"] = transfer.unit;
    return root.dump();
}

double alpha_between(double a, double b, double share) {
    if (share <= 0) return a;
    if (share >= 1) return b;
    return -std::expm1(-std::lerp(extinction_of(a), extinction_of(b), share));
}

std::string transfer_to_paraview(TransferFunction const& transfer, std::string const& name) {
    Json colors = Json::array(), opacities = Json::array();
    auto const shown = [&](double c) { return transfer.linear_colors ? linear_to_srgb(c) : c; };
    constexpr int parts = 8;
    for (std::size_t i = 0; i < transfer.points.size(); ++i) {
        ControlPoint const& p = transfer.points[i];
        if (i > 0 && transfer.points[i - 1].alpha != p.alpha && transfer.points[i - 1].value < p.value)
            for (int k = 1; k < parts; ++k) {
                double const share = k / static_cast<double>(parts);
                for (double const v : {std::lerp(transfer.points[i - 1].value, p.value, share),
                                       alpha_between(transfer.points[i - 1].alpha, p.alpha, share), 0.5, 0.0})
                    opacities.push_back(v);
            }
        for (double const v : {p.value, p.alpha, 0.5, 0.0}) opacities.push_back(v);
        for (double const v : {p.value, shown(p.color.red), shown(p.color.green), shown(p.color.blue)})
            colors.push_back(v);
    }
    Json preset{{"Name", name}, {"ColorSpace", "RGB"}, {"RGBPoints", colors}, {"Points", opacities}};
    if (transfer.unit > 0) preset["ScalarOpacityUnitDistance"] = transfer.unit;
    return Json::array({preset}).dump(2) + "\n";
}

} // namespace vkt::render
