// Editing of transfer functions, without a window: knots, colours, presets, axes, undo.
// SPDX-License-Identifier: MIT
#include "libvkt/render/transfer_file.h"
#include "shell/viewer/transfer_edit.h"
#include "tests/unit/render_testing.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include <unistd.h>

namespace vkt::shell::viewer {
namespace {

TransferEdit three() {
    TransferEdit edit;
    edit.lower = 0, edit.upper = 10;
    edit.knots = {{0, 0}, {4, 0.5}, {10, 0.75}};
    return edit;
}

TEST(TransferEdit, knotsStayInOrder) {
    TransferEdit edit = three();
    EXPECT_EQ(add_knot(edit, {6, 2}), 2U);
    EXPECT_EQ(edit.knots[2], (OpacityKnot{6, 1}));
    move_knot(edit, 1, {99, -1});
    EXPECT_EQ(edit.knots[1], (OpacityKnot{6, 0})); // as far as its neighbour
    move_knot(edit, 1, {std::nan(""), 0.25});
    EXPECT_EQ(edit.knots[1], (OpacityKnot{6, 0.25}));
    while (edit.knots.size() > 1) remove_knot(edit, 0);
    remove_knot(edit, 0);
    EXPECT_EQ(edit.knots, (std::vector<OpacityKnot>{{10, 0.75}}));
}

TEST(TransferEdit, opacityIsStraightInExtinction) {
    TransferEdit const edit = three();
    // Half way, the extinction is the mean: two such layers hold back as much as the thinner and the thicker one.
    double const middle = alpha_at(edit, 7);
    EXPECT_NEAR((1 - middle) * (1 - middle), (1 - 0.5) * (1 - 0.75), 1e-12);
    EXPECT_EQ(alpha_at(edit, -5), 0);
    EXPECT_EQ(alpha_at(edit, 50), 0.75);
    TransferEdit step = edit;
    step.knots = {{5, 0}, {5, 1}};
    EXPECT_EQ(alpha_at(step, 4.999), 0);
    EXPECT_EQ(alpha_at(step, 5), 1);
}

TEST(TransferEdit, theDomainMovesColoursAndAlongWithItKnots) {
    TransferEdit edit = three();
    set_domain(edit, 5, 2, false);
    EXPECT_EQ(edit, three()); // no domain
    set_domain(edit, 0, 20, false);
    EXPECT_EQ(edit.knots, three().knots);
    edit = three();
    set_domain(edit, 100, 200, true);
    EXPECT_EQ(edit.knots, (std::vector<OpacityKnot>{{100, 0}, {140, 0.5}, {200, 0.75}}));
    edit.logarithmic = true;
    set_domain(edit, -1, 1, true);
    EXPECT_FALSE(edit.logarithmic); // there are no logarithms
}

TEST(TransferEdit, ownColoursBeginAsTheMap) {
    TransferEdit edit = three();
    TransferEdit const map = edit;
    own_colors(edit, 65);
    for (double v = -1; v < 12; v += 0.37) {
        EXPECT_NEAR(color_at(edit, v).red, color_at(map, v).red, 0.003);
        EXPECT_NEAR(color_at(edit, v).blue, color_at(map, v).blue, 0.003);
    }
    std::size_t const added = add_color(edit, 3.3);
    EXPECT_EQ(edit.colors[added].value, 3.3);
    move_color(edit, added, -100);
    EXPECT_EQ(edit.colors[added].value, edit.colors[added - 1].value);
    while (edit.colors.size() > 1) remove_color(edit, 0);
    remove_color(edit, 0);
    EXPECT_EQ(edit.colors.size(), 1U);
}

TEST(TransferEdit, functionsComeBackAsTheyWere) {
    TransferEdit const edit = three();
    TransferEdit const back = edit_of(function_of(edit), "viridis");
    EXPECT_EQ(back.knots, edit.knots); // without those that only the colours need
    EXPECT_EQ(back.lower, 0);
    TransferEdit const own = edit_of(function_of(edit), "");
    for (double v = 0; v <= 10; v += 0.1) {
        EXPECT_NEAR(alpha_at(own, v), alpha_at(edit, v), 0.01);
        EXPECT_NEAR(color_at(own, v).green, color_at(edit, v).green, 0.01);
    }
}

TEST(TransferEdit, bothWaysToSayItShowTheSame) {
    Volume const volume = render::testing::blobs({20, 16, 24}, DataType::uint8);
    TransferEdit edit = three();
    edit.lower = 0, edit.upper = 200;
    edit.knots = {{30, 0}, {90, 0.1}, {200, 0.6}};
    render::RenderSettings words, function;
    words.width = words.height = function.width = function.height = 32;
    words.shade = function.shade = 0;
    apply(edit, words);
    EXPECT_FALSE(words.transfer);
    function.transfer = function_of(edit);
    EXPECT_LT(render::testing::greatest_difference(render::testing::render_one(volume, words).image,
                                                   render::testing::render_one(volume, function).image),
              1e-5);
}

TEST(TransferEdit, paraViewPresetsSurvive) {
    TransferEdit const edit = three();
    render::TransferFunction const function = function_of(edit);
    render::TransferFunction const back = render::transfer_from_json(render::transfer_to_paraview(function, "a name"));
    TransferEdit const read = edit_of(back, "");
    for (double v = 0; v <= 10; v += 0.05) {
        // ParaView's lines are straight in opacity: eight of them for each of ours.
        EXPECT_NEAR(alpha_at(read, v), alpha_at(edit, v), 0.01) << v;
        EXPECT_NEAR(color_at(read, v).red, color_at(edit, v).red, 0.01) << v;
    }
}

TEST(TransferEdit, aPresetAsParaViewWritesIt) {
    // The form of its exports: two colours, opacities 0 at 0 and 1 at 10 in a straight line.
    auto const function = render::transfer_from_json(
        R"([{"ColorSpace": "RGB", "Name": "p", "Points": [0, 0, 0.5, 0, 10, 1, 0.5, 0],
             "RGBPoints": [0, 0, 0, 1, 10, 1, 0, 0]}])");
    TransferEdit const edit = edit_of(function, "");
    EXPECT_NEAR(alpha_at(edit, 2.5), 0.25, 0.01);
    EXPECT_NEAR(color_at(edit, 5).red, 0.5, 0.01);
    EXPECT_NEAR(color_at(edit, 5).blue, 0.5, 0.01);
    EXPECT_THROW(render::transfer_from_json(R"([{"Name": "p"}])"), Error);
    EXPECT_THROW(render::transfer_from_json(R"([{"RGBPoints": [0, 1, 2]}])"), Error);
    EXPECT_THROW(render::transfer_from_json(R"([{"RGBPoints": [0, 1, 2, "x"]}])"), Error);
    EXPECT_THROW(render::transfer_from_json("[1]"), Error);
}

TEST(TransferEdit, presetsCanBeShown) {
    for (DataType const type : {DataType::uint8, DataType::float32}) {
        Volume const volume = render::testing::blobs({20, 16, 24}, type);
        render::Renderer const renderer(volume, {});
        for (std::string const& name : preset_names()) {
            TransferEdit const edit = preset(name, renderer.histogram(), three());
            EXPECT_LT(edit.lower, edit.upper) << name;
            ASSERT_FALSE(edit.knots.empty()) << name;
            for (std::size_t i = 1; i < edit.knots.size(); ++i)
                EXPECT_LE(edit.knots[i - 1].value, edit.knots[i].value) << name;
            render::RenderSettings s;
            s.width = s.height = 4;
            apply(edit, s);
            EXPECT_NO_THROW(renderer.render(s)) << name;
        }
    }
    EXPECT_THROW(preset("nonsense", {}, three()), Error);
}

TEST(Axes, goThereAndBack) {
    for (ValueAxis const axis : {ValueAxis{-5, 20, false}, ValueAxis{0.01, 100, true}})
        for (double const x : {0.0, 0.2, 1.0}) EXPECT_NEAR(axis.place(axis.value(x)), x, 1e-12);
    EXPECT_NEAR((ValueAxis{0.01, 100, true}.value(0.5)), 1, 1e-12);
    for (bool const logarithmic : {false, true})
        for (double const x : {0.0, 0.3, 1.0})
            EXPECT_NEAR(OpacityAxis{logarithmic}.place(OpacityAxis{logarithmic}.alpha(x)), x, 1e-12);
    EXPECT_GT(OpacityAxis{true}.place(0.01), 0.4); // there is room for faint things
}

TEST(Axes, columnsShareOutWhatIsCounted) {
    render::Histogram histogram;
    histogram.least = 0, histogram.greatest = 8;
    histogram.bins = {100, 0, 0, 0, 0, 0, 0, 50};
    auto const same = log_columns(histogram, {0, 8, false}, 8);
    EXPECT_EQ(same[0], 1);
    EXPECT_EQ(same[1], 0);
    EXPECT_NEAR(same[7], std::log1p(50) / std::log1p(100), 1e-6);
    // Four times as wide: what lies below and above is not piled up at the ends.
    auto const wide = log_columns(histogram, {-12, 20, false}, 32);
    EXPECT_EQ(wide[0], 0);
    EXPECT_EQ(wide[12], 1);
    EXPECT_EQ(wide[31], 0);
}

TEST(Axes, integersLeaveNoGaps) {
    render::Histogram histogram;
    histogram.least = 0, histogram.greatest = 4;
    histogram.bins.assign(64, 0);
    for (std::size_t const bin : {0, 16, 32, 48, 63}) histogram.bins[bin] = 7;
    for (float const height : log_columns(histogram, {0, 4, false}, 40)) EXPECT_GT(height, 0.5F);
    // Of two values alone nobody knows what lies between them.
    histogram.bins.assign(64, 0);
    histogram.bins[0] = histogram.bins[63] = 7;
    EXPECT_EQ(log_columns(histogram, {0, 4, false}, 40)[20], 0);
}

TEST(TransferEdit, filesThatAreNoneAreNotReplaced) {
    namespace fs = std::filesystem;
    fs::path const folder = fs::temp_directory_path() / ("vkt-transfer-" + std::to_string(::getpid()));
    fs::create_directory(folder);
    std::string const path = folder / "t.json", other = folder / "head.nrrd";
    std::string const json = render::transfer_to_json(function_of(three()));
    save_transfer(path, json);
    save_transfer(path, json); // its own kind
    EXPECT_EQ(render::transfer_to_json(render::read_transfer(path)), json);
    std::ofstream(other) << "NRRD0004\nprecious";
    EXPECT_THROW(save_transfer(other, json), Error);
    std::ifstream kept(other);
    std::string line;
    std::getline(kept, line);
    EXPECT_EQ(line, "NRRD0004");
    EXPECT_THROW(save_transfer(folder / "none" / "t.json", json), Error);
    fs::remove_all(folder);
}

TEST(TransferEdit, presetsAreThoseOfTheCommandLine) {
    render::Renderer const renderer(render::testing::blobs({20, 16, 24}, DataType::uint8), {});
    std::vector<std::pair<char const*, render::DataKind>> const kinds{
        {"CT: bone", render::DataKind::ct_bone},
        {"CT: soft tissue and bone", render::DataKind::ct},
        {"CT: lung", render::DataKind::ct_lung},
        {"CT: contrast and stents", render::DataKind::ct_contrast},
        {"MR", render::DataKind::mr},
        {"fluorescence", render::DataKind::fluorescence},
        {"density", render::DataKind::density}};
    for (auto const& [name, kind] : kinds) {
        render::TransferFunction const window = function_of(preset(name, renderer.histogram(), three())),
                                       words =
                                           transfer_of(render::preset_of(kind, renderer.histogram()), std::string());
        ASSERT_EQ(window.points.size(), words.points.size()) << name;
        for (std::size_t i = 0; i < words.points.size(); ++i) {
            render::ControlPoint const &a = window.points[i], &b = words.points[i];
            EXPECT_NEAR(a.value, b.value, 1e-9 * (1 + std::abs(a.value))) << name;
            EXPECT_NEAR(a.alpha, b.alpha, 1e-9) << name;
            EXPECT_NEAR(a.color.green, b.color.green, 1e-6) << name;
        }
    }
    render::RenderSettings settings;
    settings.preset = render::DataKind::mr;
    apply(three(), settings); // what is edited is shown
    EXPECT_FALSE(settings.preset);
}

TEST(Undo, goesBackAndForth) {
    Undo<int> undo(1);
    undo.record(1);
    EXPECT_FALSE(undo.can_undo());
    undo.record(2);
    undo.record(3);
    EXPECT_EQ(undo.undo(), 2);
    EXPECT_EQ(undo.undo(), 1);
    EXPECT_EQ(undo.undo(), 1);
    EXPECT_EQ(undo.redo(), 2);
    undo.record(9); // what was undone is gone
    EXPECT_FALSE(undo.can_redo());
    EXPECT_EQ(undo.undo(), 2);
    undo.change_all([](int& state) { state += 100; });
    EXPECT_EQ(undo.now(), 102);
    EXPECT_EQ(undo.redo(), 109);
    for (int i = 0; i < 1000; ++i) undo.record(i);
    EXPECT_EQ(undo.now(), 999);
}

} // namespace
} // namespace vkt::shell::viewer
