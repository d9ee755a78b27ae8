// Reports: tables whose rows are made as they are printed.
// SPDX-License-Identifier: MIT
#include "libvkt/core/report.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {
namespace {

Report row_of(std::size_t i) {
    Report row;
    row.add("label", static_cast<std::int64_t>(i + 1));
    row.add("lower", Index3{1, static_cast<std::int64_t>(1000 * i), 3});
    row.add("share", i == 2 ? std::numeric_limits<double>::quiet_NaN() : 0.5 * static_cast<double>(i));
    return row;
}

} // namespace

TEST(Report, RowsThatAreMadeAreThoseThatAreThere) {
    for (std::size_t const count : {0U, 1U, 5U}) {
        std::vector<Report> rows;
        for (std::size_t i = 0; i < count; ++i) rows.push_back(row_of(i));
        std::vector<Report> there(2), made(2);
        for (std::size_t k = 0; k < 2; ++k) {
            there[k].add("volume", static_cast<std::int64_t>(k)).add("labels", rows);
            made[k].add("volume", static_cast<std::int64_t>(k)).add("labels", count, row_of);
        }
        for (ReportForm const form : {ReportForm::text, ReportForm::json, ReportForm::csv}) {
            EXPECT_EQ(Report::print(made, form), Report::print(there, form)) << count;
            EXPECT_EQ(Report::print({made[1]}, form), Report::print({there[1]}, form)) << count;
        }
    }
}

TEST(Report, IsPrintedRowByRow) {
    Report report;
    report.add("labels", 1000, row_of);
    for (ReportForm const form : {ReportForm::text, ReportForm::json, ReportForm::csv}) {
        std::size_t longest = 0;
        std::string all;
        Report::print({report}, form, [&](std::string_view piece) {
            longest = std::max(longest, piece.size());
            all += piece;
        });
        EXPECT_EQ(all, Report::print({report}, form));
        EXPECT_LT(longest, 200U);
    }
}

TEST(Report, IsPrintedInBlocks) {
    Report report;
    report.add("labels", 100000, row_of);
    for (ReportForm const form : {ReportForm::text, ReportForm::json, ReportForm::csv}) {
        std::vector<std::string> blocks;
        std::string all;
        Report::print_blocks({report}, form, [&](std::string_view block) {
            blocks.emplace_back(block);
            all += block;
        });
        EXPECT_EQ(all, Report::print({report}, form));
        ASSERT_GT(blocks.size(), 1U);
        for (std::string const& block : blocks) EXPECT_LT(block.size(), (1U << 20) + 200);
    }
}

} // namespace vkt
