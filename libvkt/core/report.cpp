// Printing reports.
// SPDX-License-Identifier: MIT
#include "libvkt/core/report.h"

#include "libvkt/core/text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

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
    std::size_t const count = rows.size();
    auto table = std::make_shared<Rows const>(Rows{std::move(rows), count});
    fields_.push_back({std::move(name), count == 0 ? "none" : "", Kind::table, std::move(table)});
    return *this;
}

Report& Report::add(std::string name, std::size_t count, std::function<Report(std::size_t)> row) {
    auto table = std::make_shared<Rows const>(Rows{{}, count, std::move(row)});
    fields_.push_back({std::move(name), count == 0 ? "none" : "", Kind::table, std::move(table)});
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
    std::string result;
    print_table(
        rows.front(), [&](auto const& visit) { std::for_each(rows.begin(), rows.end(), visit); },
        [&](std::string_view line) { result += line; });
    return result;
}

template <class Visits> void Report::print_table(Report const& first, Visits const& for_each_row, Printer const& to) {
    std::vector<std::size_t> widths;
    auto const widen = [&](Report const& row, std::string Field::*which) {
        widths.resize(std::max(widths.size(), row.fields_.size()));
        for (std::size_t i = 0; i < row.fields_.size(); ++i)
            widths[i] = std::max(widths[i], printable(row.fields_[i].*which).size());
    };
    auto const add_line = [&](Report const& row, std::string Field::*which) {
        std::size_t const n = row.fields_.size();
        std::string line;
        for (std::size_t i = 0; i < n; ++i) {
            std::string const word = printable(row.fields_[i].*which);
            line += word;
            if (i + 1 < n) line.append(widths[i] + 2 - word.size(), ' ');
        }
        to(line += '\n');
    };
    widen(first, &Field::name);
    for_each_row([&](Report const& row) { widen(row, &Field::text); });
    add_line(first, &Field::name);
    for_each_row([&](Report const& row) { add_line(row, &Field::text); });
}

std::string Report::text() const {
    std::string result;
    print_text([&](std::string_view piece) { result += piece; });
    return result;
}

void Report::print_text(Printer const& to) const {
    if (written(ReportForm::text)) return to(*written(ReportForm::text));
    std::size_t width = 0;
    for (auto const& field : fields_) width = std::max(width, printable(field.name).size());
    for (auto const& field : fields_) {
        std::string const name = printable(field.name);
        if (field.has_rows()) {
            Rows const& rows = *field.rows;
            print_table(
                rows.row ? rows.row(0) : rows.made.front(), [&](auto const& visit) { rows.for_each(visit); }, to);
            continue;
        }
        to(vkt::text(name, std::string(width + 2 - name.size(), ' '), printable(field.text), "\n"));
    }
}

std::string Report::json(int indent) const {
    std::string result;
    print_json([&](std::string_view piece) { result += piece; }, indent);
    return result;
}

void Report::print_json(Printer const& to, int indent) const {
    if (written(ReportForm::json)) return to(*written(ReportForm::json));
    std::string const margin(static_cast<std::size_t>(indent), ' ');
    to("{");
    for (std::size_t i = 0; i < fields_.size(); ++i) {
        Field const& field = fields_[i];
        to(vkt::text(i == 0 ? "\n" : ",\n", margin, "  ", json_string(field.name), ": "));
        if (!field.has_rows()) {
            to(field.json());
            continue;
        }
        bool first = true;
        field.rows->for_each([&](Report const& row) {
            to(vkt::text(std::exchange(first, false) ? "[\n" : ",\n", margin, "    ", row.json(indent + 4)));
        });
        to(vkt::text("\n", margin, "  ]"));
    }
    to(vkt::text("\n", margin, "}"));
}

void Report::print_texts(std::vector<Report> const& reports, Printer const& to) {
    if (reports.size() == 1) return reports.front().print_text(to); // without a copy: it may have a table of many rows
    for (std::size_t i = 0; i < reports.size(); ++i) {
        Report numbered;
        // Tables begin with their own line.
        if (!reports[i].written(ReportForm::text))
            numbered.add("volume", vkt::text(static_cast<std::int64_t>(i + 1), " of ", std::ssize(reports)));
        numbered.fields_.insert(numbered.fields_.end(), reports[i].fields_.begin(), reports[i].fields_.end());
        if (i > 0) to("\n");
        numbered.written_ = reports[i].written_;
        numbered.print_text(to);
    }
}

std::string Report::json(std::vector<Report> const& reports) { return print(reports, ReportForm::json); }

void Report::print_jsons(std::vector<Report> const& reports, Printer const& to) {
    if (reports.size() == 1) {
        reports.front().print_json(to, 0);
        return to("\n");
    }
    to("[");
    for (std::size_t i = 0; i < reports.size(); ++i) {
        to(i == 0 ? "\n  " : ",\n  ");
        reports[i].print_json(to, 2);
    }
    to("\n]\n");
}

void Report::print_csv(Printer const& to, std::string& last_names) const {
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
        if (line_names != last_names) to(vkt::text(line_names, "\n"));
        last_names = line_names;
        to(vkt::text(line_values, "\n"));
    };
    add_fields(names, values, *this);
    bool any_table = false;
    for (Field const& field : fields_) {
        any_table = any_table || field.kind == Kind::table;
        if (!field.has_rows()) continue;
        field.rows->for_each([&](Report const& row) {
            std::string row_names = names, row_values = values;
            add_fields(row_names, row_values, row);
            add_line(row_names, row_values);
        });
    }
    if (!any_table) add_line(names, values);
}

void Report::print_csvs(std::vector<Report> const& reports, Printer const& to) {
    std::string last_names;
    for (std::size_t i = 0; i < reports.size(); ++i) {
        Report const& report = reports[i];
        if (report.written(ReportForm::csv))
            to(vkt::text(i > 0 ? "\n" : "", *report.written(ReportForm::csv)));
        else
            report.print_csv(to, last_names);
    }
}

void Report::print(std::vector<Report> const& reports, ReportForm form, Printer const& to) {
    return form == ReportForm::csv    ? print_csvs(reports, to)
           : form == ReportForm::json ? print_jsons(reports, to)
                                      : print_texts(reports, to);
}

void Report::print_blocks(std::vector<Report> const& reports, ReportForm form, Printer const& to) {
    constexpr std::size_t at_once = 1 << 20;
    std::string block;
    print(reports, form, [&](std::string_view piece) {
        block += piece;
        if (block.size() < at_once) return;
        to(block);
        block.clear();
    });
    if (!block.empty()) to(block);
}

std::string Report::print(std::vector<Report> const& reports, ReportForm form) {
    std::string result;
    print(reports, form, [&](std::string_view piece) { result += piece; });
    return result;
}

} // namespace vkt
