// Reports: named values that print as an aligned table for people and as JSON for programs.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace vkt {

/// Fields in the order in which they were added. Numbers keep the text they were given, so that no digit is lost; what
/// is not finite is null in JSON.
class Report {
public:
    Report& add(std::string name, double value);
    Report& add(std::string name, std::int64_t value);
    Report& add(std::string name, bool value);
    Report& add(std::string name, std::string_view value);
    Report& add(std::string name, char const* value) { return add(std::move(name), std::string_view(value)); }
    Report& add(std::string name, Index3 value);
    Report& add(std::string name, Vec3 value);
    /// A table: reports of the same fields.
    Report& add(std::string name, std::vector<Report> rows);
    /// A list of numbers.
    Report& add(std::string name, std::vector<double> const& values);
    /// A number given as its decimal text ("nan" and "inf" are null in JSON).
    Report& add_number(std::string name, std::string const& digits);

    std::string text() const;               ///< one "name   value" line per field, printable()
    std::string json(int indent = 0) const; ///< one object

    /// One report as it is, several as a list.
    static std::string text(std::vector<Report> const& reports);
    static std::string json(std::vector<Report> const& reports);
    /// Reports of the same fields as columns under a line of names.
    static std::string table(std::vector<Report> const& rows);

private:
    struct Field {
        std::string name, text, json;
        std::vector<Report> rows{}; ///< of a table, instead of text and json
    };
    std::vector<Field> fields_;
};

/// A JSON string literal. Bytes that are no UTF-8 become U+FFFD; what is not visible() is escaped.
std::string json_string(std::string_view text);

} // namespace vkt
