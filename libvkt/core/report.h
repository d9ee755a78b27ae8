// Reports: named values that print as an aligned table for people, and as JSON or CSV for programs.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace vkt {

enum class ReportForm : std::uint8_t { text, json, csv };

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
    /// An index; one that does not exist is "nan".
    Report& add(std::string name, std::optional<Index3> const& value);
    /// A table: reports of the same fields.
    Report& add(std::string name, std::vector<Report> rows);
    /// The same of so many rows that they are made as they are printed, each time: of data that the function holds.
    Report& add(std::string name, std::size_t count, std::function<Report(std::size_t)> row);
    /// A list of numbers.
    Report& add(std::string name, std::vector<double> const& values);
    /// A number given as its decimal text ("nan" and "inf" are null in JSON).
    Report& add_number(std::string name, std::string const& digits);

    /// What is printed in this form instead of the fields: lines, or a JSON value without a newline at its end.
    Report& write_as(ReportForm form, std::string content);

    std::string text() const;               ///< one "name   value" line per field, printable()
    std::string json(int indent = 0) const; ///< one object

    /// Takes what is printed piece by piece, at most a row of a table at once.
    using Printer = std::function<void(std::string_view)>;

    /// One report as it is, several as a list. CSV is a line of names and a line of values for each report, or for each
    /// row of its tables, which begins with what the report says besides; names again where they change. Of three
    /// numbers each has a column: NAME_x, NAME_y, NAME_z.
    static void print(std::vector<Report> const& reports, ReportForm form, Printer const& to);
    /// The same for printers that are not to be called for every row: of blocks of a MiB, unless a row is longer.
    static void print_blocks(std::vector<Report> const& reports, ReportForm form, Printer const& to);
    static std::string print(std::vector<Report> const& reports, ReportForm form);
    static std::string json(std::vector<Report> const& reports);
    /// Reports of the same fields as columns under a line of names.
    static std::string table(std::vector<Report> const& rows);

private:
    /// What a field's text is: JSON and CSV are made from it when they are printed, for a table may have a row a slice.
    enum class Kind : std::uint8_t { word, number, truth, triple, list, table };
    /// Of a table: made already, or one by one when they are printed.
    struct Rows {
        std::vector<Report> made;
        std::size_t count = 0;
        std::function<Report(std::size_t)> row{}; ///< makes one, instead of those
        /// Calls visit(row) for each.
        template <class Visit> void for_each(Visit const& visit) const {
            for (std::size_t i = 0; i < count; ++i)
                if (row)
                    visit(row(i));
                else
                    visit(made[i]);
        }
    };
    struct Field {
        std::string name, text; ///< numbers of a triple and of a list with a space between
        Kind kind = Kind::word;
        std::shared_ptr<Rows const> rows{}; ///< of a table, instead of the text; elsewhere, since most fields have none
        std::string json() const;
        bool has_rows() const { return rows && rows->count > 0; }
    };
    static void print_texts(std::vector<Report> const& reports, Printer const& to);
    static void print_jsons(std::vector<Report> const& reports, Printer const& to);
    static void print_csvs(std::vector<Report> const& reports, Printer const& to);
    void print_text(Printer const& to) const;
    void print_json(Printer const& to, int indent) const;
    void print_csv(Printer const& to, std::string& last_names) const;
    template <class Visits> static void print_table(Report const& first, Visits const& for_each_row, Printer const& to);
    std::optional<std::string> const& written(ReportForm form) const {
        return written_[static_cast<std::size_t>(form)];
    }

    std::vector<Field> fields_;
    std::array<std::optional<std::string>, 3> written_; ///< by form
};

/// A JSON string literal. Bytes that are no UTF-8 become U+FFFD; what is not visible() is escaped.
std::string json_string(std::string_view text);

} // namespace vkt
