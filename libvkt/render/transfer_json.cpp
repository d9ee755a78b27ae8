// Transfer functions as JSON files.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/render/transfer.h"

#include <nlohmann/json.hpp>

#include <cmath>

namespace vkt::render {

using Json = nlohmann::json;

TransferFunction transfer_from_json(std::string const& json) {
    auto const malformed = [] {
        return Error(ErrorKind::data, "the transfer function file is malformed",
                     R"(it looks like {"points": [[value, r, g, b, a], …], "unit": 1})");
    };
    Json const root = Json::parse(json, nullptr, false);
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
    try {
        transfer.check_and_sort();
    } catch (Error const& error) {
        throw Error(ErrorKind::data, error.what(), error.hint());
    }
    return transfer;
}

std::string transfer_to_json(TransferFunction const& transfer) {
    Json points = Json::array();
    for (ControlPoint const& p : transfer.points)
        points.push_back({p.value, p.color.red, p.color.green, p.color.blue, p.alpha});
    Json root{{"points", points}, {"colors", transfer.linear_colors ? "linear" : "srgb"}};
    if (transfer.unit > 0) root["unit"] = transfer.unit;
    return root.dump();
}

} // namespace vkt::render
