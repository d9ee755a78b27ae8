// Expressions: precedence, folding, sharing, columns of mistakes, limits, and the slots of programs.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/operations/voxels/expression.h"
#include "libvkt/operations/voxels/program.h"
#include "libvkt/operations/voxels/transform_each.h"

#include <cmath>
#include <gtest/gtest.h>

using namespace vkt;

namespace {

/// The number that an expression of numbers is.
double number(std::string_view text) {
    Expression const expression = Expression::parse(text);
    EXPECT_EQ(expression.nodes().size(), 1u) << text;
    EXPECT_EQ(expression.nodes().back().op, Op::number) << text;
    return expression.nodes().back().number;
}

std::size_t parts(std::string_view text) { return Expression::parse(text).nodes().size(); }

std::string mistake(std::string const& text) {
    try {
        Expression::parse(text);
    } catch (Error const& e) {
        EXPECT_EQ(e.kind(), ErrorKind::usage);
        return e.what();
    }
    return "none";
}

std::string repeated(std::string const& part, int times) {
    std::string result;
    for (int i = 0; i < times; ++i) result += part;
    return result;
}

} // namespace

TEST(Expression, PrecedenceAndAssociativity) {
    EXPECT_EQ(number("1 + 2 * 3 - 4 / 2"), 5);
    EXPECT_EQ(number("10 - 4 - 3"), 3);
    EXPECT_EQ(number("64 / 4 / 2"), 8);
    EXPECT_EQ(number("2 ^ 3 ^ 2"), 512);
    EXPECT_EQ(number("-2 ** 2"), -4);
    EXPECT_EQ(number("2 ^ -1"), 0.5);
    EXPECT_EQ(number("1 or 0 and 0"), 1);
    EXPECT_EQ(number("not 1 > 2"), 1);
    EXPECT_EQ(number("!1 < 2"), 1);
    EXPECT_EQ(number("1 + 1 == 2 and 3 != 4"), 1);
    EXPECT_EQ(number("0 ? 1 : 0 ? 2 : 3"), 3);
    EXPECT_EQ(number("1 ? 0 ? 1 : 2 : 3"), 2);
    EXPECT_EQ(number("1e2+.5+2.e-1"), 100.7);
    EXPECT_EQ(number("max(1, 5, 3) - min(4, 2)"), 3);
    EXPECT_EQ(number("mod(-7, 3) * 10 + fmod(-7, 3)"), 19);
    EXPECT_EQ(number("round(2.5) + round(3.5)"), 6);
    EXPECT_EQ(number("step(2, 2) + step(2, 1)"), 1);
    EXPECT_TRUE(std::isnan(number("nan")));
    EXPECT_TRUE(Expression::parse("v > inf").says_infinite());
}

TEST(Expression, EqualPartsAreMadeOnce) {
    EXPECT_EQ(parts("v"), 1u);
    EXPECT_EQ(parts("(v + 1) * (v + 1)"), 4u);
    EXPECT_EQ(parts("v * (2 * pi)"), 3u);
    EXPECT_EQ(parts("v ^ 4"), 3u);
    EXPECT_EQ(parts("1 ? v : sin(a)"), 1u);                      // what is not needed is left out,
    EXPECT_EQ(Expression::parse("1 ? v : sin(a)").volumes(), 2); // but was named
    EXPECT_EQ(parts("v[0,0,0] + v"), 2u);
    EXPECT_EQ(Expression::parse("x / (nx - 1)").with_extent({5, 6, 7}).nodes().size(), 3u);
    EXPECT_EQ(Expression::parse("nx * ny + nz").with_extent({5, 6, 7}).nodes().back().number, 37);
    EXPECT_EQ(offsets_of(Expression::parse("v[-2,0,3] + v[1,0,0] + a[9,9,9]"), 0), (Box{{-2, 0, 0}, {1, 0, 3}}));
}

TEST(Expression, MistakesNameTheColumn) {
    EXPECT_EQ(mistake("v +"), "expression, column 4, at the end: a value is expected");
    EXPECT_EQ(mistake("\xc3\xa9"), "expression, column 1, at '\xc3\xa9': a value is expected");
    EXPECT_EQ(mistake("v \xc3\xa9 v"), "expression, column 3, at '\xc3\xa9': an operator or the end is expected");
    EXPECT_EQ(mistake("1 \xff"), "expression, column 3, at '\\xff': an operator or the end is expected");
    EXPECT_EQ(mistake("sin(v,)"), "expression, column 7, at ')': a value is expected");
    EXPECT_EQ(mistake("atan2(v)"), "expression, column 1, at 'atan2': takes 2 arguments, not 1");
    EXPECT_EQ(mistake("v[0,0,99999999999999999999]"),
              "expression, column 7, at '99999999999999999999': neighbours are at most 128 voxels away");
    EXPECT_EQ(mistake(std::string("v\0", 2)).substr(0, 24), "expression, column 2, at");
}

TEST(Expression, IsBounded) {
    EXPECT_EQ(mistake(repeated("(", 90) + "v" + repeated(")", 90)),
              "expression, column 51, at '(': nested more than 100 deep");
    EXPECT_EQ(mistake(repeated("(", 40) + "v" + repeated(")", 40)), "none");
    for (std::string const deep : {"-", "!", "not ", "2^", "v?", "v?v:", "sin(", "1+(", "v<("})
        EXPECT_NE(mistake(repeated(deep, 3000) + "v").find("nested more than"), std::string::npos) << deep;
    EXPECT_EQ(mistake("v" + repeated("+v*x", 3000)), "none"); // long, but flat
    EXPECT_NE(mistake(repeated("v ", 9000)).find("more than 16384 characters"), std::string::npos);
}

TEST(Program, SlotsAreUsedAgain) {
    Program const flat = compile(Expression::parse("sin(v) + cos(v) + tan(v) + exp(v) + sqrt(v) + abs(v)"));
    EXPECT_EQ(flat.buffers, 2);
    EXPECT_EQ(flat.per_voxel.size(), 11u);
    Program const positions = compile(Expression::parse("sin(x / 10) * v + exp(z)"));
    EXPECT_EQ(positions.along_x.size(), 3u);
    EXPECT_EQ(positions.per_row.size(), 2u);
    EXPECT_EQ(positions.per_voxel.size(), 2u);
    Program const rows = compile(Expression::parse("v[1,0,0] + v[-1,0,0] + v[0,1,0] + v"));
    EXPECT_EQ(rows.rows.size(), 2u);
    EXPECT_EQ(compile(Expression::parse("v")).per_voxel.size(), 1u);
}

TEST(Program, IntervalsHoldWhatCanComeOut) {
    auto const of = [](std::string_view text) {
        Values const volume{true, 0, 255}, x{true, 0, 9}, none{false, -HUGE_VAL, HUGE_VAL};
        Values const volumes[] = {volume, none}, positions[] = {x, x, x};
        return values_of(Expression::parse(text), volumes, positions).back();
    };
    auto const expect = [&](std::string_view text, bool whole, double low, double high) {
        Values const v = of(text);
        EXPECT_EQ(v.whole, whole) << text;
        EXPECT_EQ(v.low, low) << text;
        EXPECT_EQ(v.high, high) << text;
    };
    expect("v * 2 + 1", true, 1, 511);
    expect("x - v", true, -255, 9);
    expect("-v * v", true, -65025, 0);
    expect("v / 2", false, 0, 127.5);
    expect("floor(v / 2)", true, 0, 128);
    expect("abs(x - 20)", true, 11, 20);
    expect("mod(v, 10)", true, 0, 10);
    expect("v > 3 ? x : -1", true, -1, 9);
    expect("clamp(v, 10, 20)", true, 10, 20);
    expect("a * 0", false, -HUGE_VAL, HUGE_VAL);
    expect("v / x", false, -HUGE_VAL, HUGE_VAL);
    expect("a == a", true, 0, 1);
}

TEST(TransformEach, CallsAFunctionInOrderAndHandsOnWhatItThrows) {
    Header header;
    header.dims = {1500, 2, 3}; // rows longer than what is worked on at a time
    header.dtype = DataType::uint16;
    header.values = {0.5, 3};
    Volume volume(header);
    View<std::uint16_t> const from = volume.mutable_view().as<std::uint16_t>();
    for (std::int64_t i = 0; i < header.voxels(); ++i) from.data[i] = static_cast<std::uint16_t>(i);
    std::int64_t next = 0;
    TransformEach each([&](Index3 p, double value) {
        EXPECT_EQ(next++, p.x + 1500 * (p.y + 2 * p.z));
        EXPECT_EQ(value, 0.5 * static_cast<double>(next - 1) + 3);
        return value + static_cast<double>(p.z);
    });
    Execution execution;
    Volume const result = apply(each, {volume}, execution);
    EXPECT_EQ(next, header.voxels());
    EXPECT_EQ(result.header().values, header.values);
    auto const* const to = reinterpret_cast<std::uint16_t const*>(result.view().data);
    for (std::int64_t i = 0; i < header.voxels(); ++i) ASSERT_EQ(to[i], i + 2 * (i / 3000));
    TransformEach throwing([](Index3, double) -> double { throw std::runtime_error("mine"); });
    EXPECT_THROW(apply(throwing, {volume}, execution), std::runtime_error);
}
