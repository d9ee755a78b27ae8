// Printing reports.
// SPDX-License-Identifier: MIT
#include "libvkt/core/report.h"

#include "libvkt/core/text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace vkt {
namespace {

std::string csv_word(std::string const& any_text) {
    std::string word = printable(any_text);
    if (word.find_first_of(",\"\n\r") == std::string::npos) return word;
    std::string quoted = "\"";
    for (char const c : word) {
        if (c == '"') quoted += c;
        quoted += c;
    }
    quoted += '"';
    return quoted;
}

/// What JSON has no number for is null.
std::string_view json_number(std::string_view digits) {
    return digits.find_first_of("ni") == std::string_view::npos ? digits : "null"; // nan, inf
}

void append_word(std::string& line, std::string const& word) {
    if (!line.empty()) line += ',';
    line += csv_word(word);
}

} // namespace

std::string json_string(std::string_view text) {
    std::string result = "\"";
    while (!text.empty()) {
        Character const c = first_character(text);
        if (!c.valid) {
            result += "\xef\xbf\xbd"; // U+FFFD
        } else if (c.code == '\n' || c.code == '\t' || c.code == '\r') {
            result += c.code == '\n' ? "\\n" : c.code == '\t' ? "\\t" : "\\r";
        } else if (!c.visible()) {
            std::array<char, 8> escape{};
            std::snprintf(escape.data(), escape.size(), "\\u%04x", static_cast<unsigned>(c.code));
            result += escape.data();
        } else {
            if (c.code == '"' || c.code == '\\') result += '\\';
            result += text.substr(0, c.bytes);
        }
        text.remove_prefix(c.bytes);
    }
    return result += '"';
}

Report& Report::add(std::string name, double value) { return add_number(std::move(name), to_text(value)); }
Report& Report::add(std::string name, std::int64_t value) { return add_number(std::move(name), to_text(value)); }

Report& Report::add(std::string name, bool value) {
    fields_.push_back({std::move(name), value ? "yes" : "no", Kind::truth});
    return *this;
}

Report& Report::add(std::string name, std::string_view value) {
    fields_.push_back({std::move(name), std::string(value), Kind::word});
    return *this;
}

Report& Report::add(std::string name, Index3 value) {
    fields_.push_back({std::move(name), to_text(value), Kind::triple});
    return *this;
}

Report& Report::add(std::string name, Vec3 value) {
    fields_.push_back({std::move(name), to_text(value), Kind::triple});
    return *this;
}

Report& Report::add(std::string name, std::optional<Index3> const& value) {
    if (value) return add(std::move(name), *value);
    fields_.push_back({std::move(name), "nan", Kind::triple});
    return *this;
}

Report& Report::add_number(std::string name, std::string const& digits) {
    fields_.push_back({std::move(name), digits, Kind::number});
    return *this;
}

Report& Report::add(std::string name, std::vector<Report> rows) {
    fields_.push_back({std::move(name), rows.empty() ? "none" : "", Kind::table, std::move(rows)});
    return *this;
}

Report& Report::add(std::string name, std::vector<double> const& values) {
    std::string words;
    for (double const v : values) words += vkt::text(words.empty() ? "" : " ", to_text(v));
    fields_.push_back({std::move(name), words, Kind::list});
    return *this;
}

/// Rows of a table are written by json(int).
std::string Report::Field::json() const {
    switch (kind) {
    case Kind::word:
        return json_string(text);
    case Kind::number:
        return std::string(json_number(text));
    case Kind::truth:
        return text == "yes" ? "true" : "false";
    case Kind::triple:
        if (text == "nan") return "null";
        [[fallthrough]];
    case Kind::list: {
        std::string numbers;
        for (std::string const& word : text.empty() ? std::vector<std::string>{} : split(text, ' '))
            numbers += vkt::text(numbers.empty() ? "" : ", ", json_number(word));
        return vkt::text("[", numbers, "]");
    }
    case Kind::table:
        break;
    }
    return "[]";
}

Report& Report::write_as(ReportForm form, std::string content) {
    written_[static_cast<std::size_t>(form)] = std::move(content);
    return *this;
}

std::string Report::table(std::vector<Report> const& rows) {
    std::vector<std::size_t> widths;
    for (Field const& field : rows.front().fields_) widths.push_back(printable(field.name).size());
    for (Report const& row : rows) {
        widths.resize(std::max(widths.size(), row.fields_.size()));
        for (std::size_t i = 0; i < row.fields_.size(); ++i)
            widths[i] = std::max(widths[i], printable(row.fields_[i].text).size());
    }
    std::string result;
    auto const add_line = [&](Report const& row, std::string Field::*which) {
        std::size_t const n = row.fields_.size();
        for (std::size_t i = 0; i < n; ++i) {
            std::string const word = printable(row.fields_[i].*which);
            result += word;
            if (i + 1 < n) result.append(widths[i] + 2 - word.size(), ' ');
        }
        result += '\n';
    };
    add_line(rows.front(), &Field::name);
    for (Report const& row : rows) add_line(row, &Field::text);
    return result;
}

std::string Report::text() const {
    if (written(ReportForm::text)) return *written(ReportForm::text);
    std::size_t width = 0;
    for (auto const& field : fields_) width = std::max(width, printable(field.name).size());
    std::string result;
    for (auto const& field : fields_) {
        std::string const name = printable(field.name);
        if (!field.rows.empty()) {
            result += table(field.rows);
            continue;
        }
        result += name;
        result.append(width + 2 - name.size(), ' ');
        result += printable(field.text);
        result += '\n';
    }
    return result;
}

std::string Report::json(int indent) const {
    if (written(ReportForm::json)) return *written(ReportForm::json);
    std::string const margin(static_cast<std::size_t>(indent), ' ');
    std::string result = "{";
    for (std::size_t i = 0; i < fields_.size(); ++i) {
        std::string value = fields_[i].rows.empty() ? fields_[i].json() : "";
        for (Report const& row : fields_[i].rows)
            value += vkt::text(value.empty() ? "[\n" : ",\n", margin, "    ", row.json(indent + 4));
        if (!fields_[i].rows.empty()) value += vkt::text("\n", margin, "  ]");
        result += vkt::text(i == 0 ? "\n" : ",\n", margin, "  ", json_string(fields_[i].name), ": ", value);
    }
    return result += vkt::text("\n", margin, "}");
}

std::string Report::text(std::vector<Report> const& reports) {
    if (reports.size() == 1) return reports.front().text(); // without a copy: it may have a table of many rows
    std::string result;
    for (std::size_t i = 0; i < reports.size(); ++i) {
        Report numbered;
        // Tables begin with their own line.
        if (!reports[i].written(ReportForm::text))
            numbered.add("volume", vkt::text(static_cast<std::int64_t>(i + 1), " of ", std::ssize(reports)));
        numbered.fields_.insert(numbered.fields_.end(), reports[i].fields_.begin(), reports[i].fields_.end());
        if (i > 0) result += '\n';
        numbered.written_ = reports[i].written_;
        result += numbered.text();
    }
    return result;
}

std::string Report::json(std::vector<Report> const& reports) {
    if (reports.size() == 1) return reports.front().json() + "\n";
    std::string result = "[";
    for (std::size_t i = 0; i < reports.size(); ++i) result += vkt::text(i == 0 ? "\n  " : ",\n  ", reports[i].json(2));
    return result += "\n]\n";
}

void Report::csv_into(std::string& lines, std::string& last_names) const {
    std::string names, values;
    auto const add_fields = [](std::string& to_names, std::string& to_values, Report const& from) {
        for (Field const& field : from.fields_) {
            if (field.kind == Kind::table) continue;
            if (field.kind != Kind::triple) {
                append_word(to_names, field.name);
                append_word(to_values, field.text);
                continue;
            }
            std::vector<std::string> const three = split(field.text, ' '); // or one "nan"
            for (std::size_t i = 0; i < 3; ++i) {
                append_word(to_names, vkt::text(field.name, std::array{"_x", "_y", "_z"}[i]));
                append_word(to_values, three[three.size() == 3 ? i : 0]);
            }
        }
    };
    auto const add_line = [&](std::string const& line_names, std::string const& line_values) {
        if (line_names != last_names) lines += vkt::text(line_names, "\n");
        last_names = line_names;
        lines += vkt::text(line_values, "\n");
    };
    add_fields(names, values, *this);
    bool any_table = false;
    for (Field const& field : fields_) {
        any_table = any_table || field.kind == Kind::table;
        for (Report const& row : field.rows) {
            std::string row_names = names, row_values = values;
            add_fields(row_names, row_values, row);
            add_line(row_names, row_values);
        }
    }
    if (!any_table) add_line(names, values);
}

std::string Report::csv(std::vector<Report> const& reports) {
    std::string lines, last_names;
    for (std::size_t i = 0; i < reports.size(); ++i) {
        Report const& report = reports[i];
        if (report.written(ReportForm::csv))
            lines += vkt::text(i > 0 ? "\n" : "", *report.written(ReportForm::csv));
        else
            report.csv_into(lines, last_names);
    }
    return lines;
}

std::string Report::print(std::vector<Report> const& reports, ReportForm form) {
    return form == ReportForm::csv ? csv(reports) : form == ReportForm::json ? json(reports) : text(reports);
}

} // namespace vkt
