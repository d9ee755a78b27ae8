// The viewer without a window: camera movements, views as settings and words, effort.
// SPDX-License-Identifier: MIT
#include "libvkt/render/settings.h"
#include "shell/viewer/interaction.h"
#include "shell/viewer/view.h"
#include "tests/unit/render_testing.h"

#include "libvkt/core/text.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <unistd.h>

namespace vkt::shell::viewer {
namespace {

using render::Camera;
using render::Projection;
using render::RenderSettings;

double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
double length(Vec3 a) { return std::sqrt(dot(a, a)); }
double distance(Vec3 a, Vec3 b) { return length(a - b); }

Camera front() {
    Camera camera;
    camera.eye = {0, -10, 0};
    camera.up = {0, 0, 1};
    return camera;
}
Camera flat_front() {
    Camera camera = front();
    camera.projection = Projection::orthographic;
    camera.height = 4;
    return camera;
}

TEST(Orbit, keepsTargetDistanceAndRightAngles) {
    Camera camera = front();
    for (int i = 0; i < 200; ++i) {
        camera = orbit(camera, {0.031 * (i % 7), 0.02 * (i % 11) - 0.05});
        EXPECT_NEAR(length(camera.eye), 10, 1e-9);
        EXPECT_NEAR(dot(camera.up, camera.eye), 0, 1e-8);
        EXPECT_NEAR(length(camera.up), 1, 1e-9);
    }
    EXPECT_EQ(camera.target, front().target);
}

TEST(Reprojection, isThePictureItselfUntilTheCameraMoves) {
    for (Camera const& camera : {front(), flat_front()}) {
        auto const places = reprojected(camera, 1.5, camera, 1.5, 4);
        ASSERT_EQ(places.size(), 25U);
        for (std::size_t k = 0; k < 25; ++k) {
            EXPECT_NEAR(places[k][0], static_cast<double>(k % 5) / 4, 1e-12);
            EXPECT_NEAR(places[k][1], std::floor(static_cast<double>(k) / 5) / 4, 1e-12);
        }
    }
}

TEST(Reprojection, goesAlongWithTheHand) {
    for (Camera const& camera : {front(), flat_front()}) {
        // A tenth of the height to the right is a fifteenth of a width of 3/2.
        auto const moved = reprojected(camera, 1.5, pan(camera, {0.1, 0.2}), 1.5, 2);
        ASSERT_EQ(moved.size(), 9U);
        EXPECT_NEAR(moved[4][0], 0.5 + 0.1 / 1.5, 1e-12);
        EXPECT_NEAR(moved[4][1], 0.7, 1e-12);
        EXPECT_NEAR(moved[8][0] - moved[0][0], 1, 1e-12);
        // Two notches: 0.9 squared.
        auto const larger = reprojected(camera, 1, zoom(camera, 2, camera), 1, 2);
        EXPECT_NEAR(larger[8][0] - larger[0][0], 1 / 0.81, 1e-12);
        EXPECT_NEAR(larger[4][0], 0.5, 1e-12);
        // Turned by 36 degrees, the target stays, and what is beside it comes closer to it.
        auto const turned = reprojected(camera, 1, orbit(camera, {0.2, 0}), 1, 2);
        EXPECT_NEAR(turned[4][0], 0.5, 1e-12);
        EXPECT_NEAR(turned[4][1], 0.5, 1e-12);
        if (camera.projection == Projection::orthographic) {
            EXPECT_NEAR(turned[5][0] - 0.5, 0.5 * std::cos(0.2 * 3.14159265358979), 1e-12);
        }
        // From behind and from the edge there is nothing to show.
        EXPECT_TRUE(reprojected(camera, 1, orbit(camera, {0.9, 0}), 1, 2).empty());
        EXPECT_TRUE(reprojected(camera, 1, orbit(camera, {0.5, 0}), 1, 2).empty());
    }
}

TEST(Orbit, thingsFollowTheHand) {
    // A quarter turn to the right by hand shows what was on the left, -x.
    Camera const right = orbit(front(), {0.5, 0});
    EXPECT_LT(distance(right.eye, {-10, 0, 0}), 1e-9);
    // Downwards by hand shows the top.
    Camera const down = orbit(front(), {0, 0.5});
    EXPECT_LT(distance(down.eye, {0, 0, 10}), 1e-9);
    EXPECT_LT(distance(down.up, {0, 1, 0}), 1e-9);
}

TEST(Orbit, goesBackAndOverThePoles) {
    Camera const there = orbit(front(), {0, 0.4}), back = orbit(there, {0, -0.4});
    EXPECT_LT(distance(back.eye, front().eye), 1e-9);
    // Half a turn over the top: behind, head down.
    Camera const over = orbit(orbit(front(), {0, 0.5}), {0, 0.5});
    EXPECT_LT(distance(over.eye, {0, 10, 0}), 1e-9);
    EXPECT_LT(distance(over.up, {0, 0, -1}), 1e-9);
}

TEST(Orbit, worksWhereTheCameraLooksAlongUp) {
    Camera camera = front();
    camera.eye = {0, 0, 10};
    Camera const moved = orbit(camera, {0.1, 0.1});
    EXPECT_NEAR(length(moved.eye), 10, 1e-9);
    EXPECT_TRUE(std::isfinite(moved.up.x));
}

TEST(Pan, whatIsAtTheTargetStaysUnderTheHand) {
    // The height of the picture at the target is 2 tan(15°) 10; half of it to the right moves the camera as far left.
    double const span = 20 * std::tan(15 * std::acos(-1.0) / 180);
    Camera const moved = pan(front(), {0.5, 0.25});
    EXPECT_LT(distance(moved.target, {-span / 2, 0, span / 4}), 1e-9);
    EXPECT_LT(distance(moved.eye - moved.target, front().eye), 1e-9);
    Camera const flat = pan(flat_front(), {0.5, 0.25});
    EXPECT_LT(distance(flat.target, {-2, 0, 1}), 1e-9);
}

TEST(Zoom, scalesWhatThePictureSpansWithinLimits) {
    Camera const near = zoom(front(), 1, front());
    EXPECT_NEAR(length(near.eye), 9, 1e-9);
    EXPECT_NEAR(length(zoom(near, -1, front()).eye), 10, 1e-9);
    EXPECT_NEAR(zoom(flat_front(), 2, flat_front()).height, 4 * 0.81, 1e-9);
    EXPECT_EQ(zoom(flat_front(), 2, flat_front()).eye, flat_front().eye);
    EXPECT_NEAR(length(zoom(front(), 1000, front()).eye), 0.01, 1e-9);
    EXPECT_NEAR(length(zoom(front(), -1000, front()).eye), 10000, 1e-6);
}

TEST(Views, theUntouchedViewIsTheCommandLine) {
    RenderSettings asked;
    asked.width = 300, asked.camera.azimuth = 12;
    RenderSettings const s = settings_of(asked, initial_view(asked));
    EXPECT_EQ(s.width, 300);
    EXPECT_EQ(s.camera.azimuth, 12);
    EXPECT_FALSE(s.camera.eye);
    std::vector<std::string> const words{"render", "--azimuth", "12", "--size", "300x512", "a.nrrd"};
    EXPECT_EQ(words_of(words, asked, initial_view(asked)), words);
}

TEST(Views, wordsSayWhatWasChanged) {
    RenderSettings const asked;
    View view = initial_view(asked);
    view.width = 640, view.look.colormap = "grey";
    view.camera = front();
    std::vector<std::string> const words{"render", "--view", "x", "--shade", "none", "--colormap", "heat", "a.nrrd"};
    EXPECT_EQ(join(words_of(words, asked, view), " "),
              "render --size 640x512 --colormap grey --eye 0,-10,0 --target 0,0,0 --up 0,0,1 --fov 30 --shade none "
              "a.nrrd");
    view = initial_view(asked);
    view.camera = flat_front();
    EXPECT_EQ(join(words_of({"render", "--projection", "orthographic", "a.nrrd"}, asked, view), " "),
              "render --eye 0,-10,0 --target 0,0,0 --up 0,0,1 --projection orthographic --span 4 a.nrrd");
    EXPECT_TRUE(words_of({}, asked, view).empty());
}

TEST(Views, aCameraSurvivesTheWayThroughSettings) {
    Volume const volume = render::testing::blobs({20, 16, 24}, DataType::uint8);
    for (Projection const projection : {Projection::perspective, Projection::orthographic}) {
        RenderSettings asked;
        asked.width = 48, asked.height = 32;
        asked.camera.projection = projection;
        auto const first = render::testing::render_one(volume, asked);
        View view = initial_view(asked);
        view.camera = first.report.camera;
        auto const again = render::testing::render_one(volume, settings_of(asked, view));
        EXPECT_NEAR(again.report.camera.height, first.report.camera.height, 1e-12);
        EXPECT_LT(render::testing::greatest_difference(first.image, again.image), 1e-3);
    }
}

TEST(Views, colourMapsComeInTurn) {
    std::string map;
    std::vector<std::string> seen;
    do {
        map = next_colormap(map, "");
        seen.push_back(map);
    } while (!map.empty() && seen.size() < 100);
    EXPECT_EQ(seen.size(), render::colormap_names().size() + 1);
    EXPECT_EQ(next_colormap("viridis:reverse", "viridis:reverse"), render::colormap_names().front());
    RenderSettings own;
    EXPECT_TRUE(has_colormap(own));
    own.lut = {1, 1, 1, 1};
    EXPECT_FALSE(has_colormap(own));
}

TEST(Effort, fullIsFull) {
    RenderSettings s;
    s.exact = true, s.samples = 7;
    RenderSettings const same = reduced(s, 1);
    EXPECT_EQ(same.width, s.width);
    EXPECT_EQ(same.step, s.step);
    EXPECT_TRUE(same.exact);
    EXPECT_EQ(same.samples, 7);
}

TEST(Effort, theWorkIsTheShare) {
    for (double const effort : {0.5, 0.25, 0.1, 0.02}) {
        RenderSettings march, iso, scatter;
        iso.algorithm = render::Algorithm::implicit_iso;
        scatter.algorithm = render::Algorithm::multi_scattering;
        auto const pixels = [](RenderSettings const& s) { return s.width * s.height / (512.0 * 512.0); };
        EXPECT_NEAR(pixels(reduced(march, effort)) * march.step / reduced(march, effort).step, effort, 0.02 * effort);
        EXPECT_NEAR(pixels(reduced(iso, effort)), effort, 0.02 * effort);
        RenderSettings const few = reduced(scatter, effort);
        EXPECT_NEAR(pixels(few) * few.samples / scatter.samples, effort, 0.05 * effort);
    }
    RenderSettings coarse;
    coarse.step = 4;
    EXPECT_EQ(reduced(coarse, 0.25).step, 4);
    EXPECT_EQ(reduced(coarse, 0.25).width, 256);
    RenderSettings tiny;
    tiny.width = 1, tiny.height = 2;
    EXPECT_EQ(reduced(tiny, least_effort(tiny)).width, 1);
}

TEST(Effort, marchingLeavesOutWhatNobodySeesWhileItMoves) {
    RenderSettings march, iso, coarse;
    iso.algorithm = render::Algorithm::implicit_iso;
    coarse.shortcut = 2;
    EXPECT_LT(most_effort(march), 1);
    EXPECT_EQ(most_effort(iso), 1);
    // The size and nearly the steps of the full picture, which leaves out nothing.
    RenderSettings const moving = reduced(march, most_effort(march));
    EXPECT_EQ(moving.shortcut, 0.5);
    EXPECT_EQ(moving.width, march.width);
    EXPECT_NEAR(moving.step, march.step, 0.02 * march.step);
    EXPECT_EQ(reduced(march, 1).shortcut, 0);
    EXPECT_EQ(reduced(iso, 0.5).shortcut, 0);
    EXPECT_EQ(reduced(coarse, 0.5).shortcut, 2);
    // However quick it is, the next frame of the movement does the same.
    EXPECT_EQ(next_effort(moving.shortcut, 1e-3, 0.03, 0.005, most_effort(march)), most_effort(march));
}

TEST(Effort, findsTheTargetAndStays) {
    // A renderer that needs 5 ms and 2 s for the full picture; then one that is fast enough.
    double effort = 1;
    for (int i = 0; i < 10; ++i) effort = next_effort(effort, 0.005 + 2 * effort, 0.03, 0.005);
    double const found = 0.005 + 2 * effort;
    EXPECT_GT(found, 0.018);
    EXPECT_LT(found, 0.043);
    EXPECT_EQ(next_effort(effort, found, 0.03, 0.005), effort);
    for (int i = 0; i < 10; ++i) effort = next_effort(effort, 0.01 * effort, 0.03, 0.005);
    EXPECT_EQ(effort, 1);
    // A renderer that cannot meet it draws little, but something.
    for (int i = 0; i < 10; ++i) effort = next_effort(effort, 1, 0.03, 0.005);
    EXPECT_EQ(effort, 0.005);
}

TEST(Effort, theFirstFrameIsSmall) {
    RenderSettings s;
    EXPECT_DOUBLE_EQ(first_effort(s), 1.0 / 16);
    s.algorithm = render::Algorithm::multi_scattering;
    s.samples = 100000;
    RenderSettings const few = reduced(s, first_effort(s));
    EXPECT_EQ(few.samples, 1);
    EXPECT_EQ(few.width, 128);
    s.width = s.height = 1, s.samples = 1;
    EXPECT_EQ(first_effort(s), 1);
}

TEST(Effort, anotherAlgorithmAndMorePathsBeginSmall) {
    RenderSettings march, scatter, more, large;
    scatter.algorithm = more.algorithm = render::Algorithm::multi_scattering;
    scatter.samples = 64, more.samples = 4096;
    large.width = 2 * march.width, large.height = 2 * march.height;
    // Marching in time with all of its rays says nothing about paths.
    EXPECT_EQ(carried_effort(most_effort(march), march, scatter), first_effort(scatter));
    EXPECT_EQ(carried_effort(0.5, scatter, march), first_effort(march));
    // As many paths, and as many pixels, as before.
    EXPECT_DOUBLE_EQ(carried_effort(0.5, scatter, more), 0.5 / 64);
    EXPECT_DOUBLE_EQ(carried_effort(0.8, march, large), 0.2);
    EXPECT_EQ(carried_effort(0.3, march, march), 0.3);
}

TEST(Effort, refinementIsDirectWhenQuick) {
    EXPECT_EQ(refined_effort(0.25, 0.03), 1);
    double effort = 0.01, sum = 0;
    int passes = 0;
    while (effort < 1 && passes < 20) {
        effort = refined_effort(effort, 10 * effort);
        sum += effort;
        ++passes;
    }
    EXPECT_EQ(effort, 1);
    EXPECT_GT(passes, 1);
    EXPECT_LT(sum, 1.7);
}

TEST(Names, neverThoseInUse) {
    auto const before = std::filesystem::current_path();
    auto const folder = std::filesystem::temp_directory_path() / text("vkt-viewer-", static_cast<int>(::getpid()));
    std::filesystem::create_directories(folder);
    std::filesystem::current_path(folder);
    EXPECT_EQ(free_picture_name("/some/where/head.nrrd"), "head.png");
    std::ofstream("head.png") << "precious";
    EXPECT_EQ(free_picture_name("head.nrrd"), "head-2.png");
    std::filesystem::create_symlink("nowhere", "head-2.png");
    EXPECT_EQ(free_picture_name("head.nrrd"), "head-3.png");
    EXPECT_EQ(free_picture_name("-"), "volume.png");
    EXPECT_EQ(output_word("head.nrrd", false), "head-3.png");
    EXPECT_EQ(output_word("my 5% head.nrrd", false), "'my 5%% head.png'");
    EXPECT_EQ(output_word("head.nrrd", true), "head-%04d.png");
    EXPECT_EQ(output_word("example4d.nii.gz", true), "example4d-%04d.png");
    EXPECT_EQ(free_picture_name("scan.2.raw.gz"), "scan.2.png");
    std::ofstream("head-0000.png") << "precious";
    EXPECT_EQ(output_word("head.nrrd", true), "head-2-%04d.png");
    std::filesystem::current_path(before);
    std::filesystem::remove_all(folder);
}

TEST(DoubleClicks, areTwoClicksAtRestAtOnePlace) {
    DoubleClick clicks;
    auto const click = [&](double x, double now, double moved = 0) {
        clicks.press(x, 10, now);
        if (moved > 0) clicks.move(x + moved, 10), clicks.move(x, 10);
        return clicks.release();
    };
    EXPECT_FALSE(click(10, 0));
    EXPECT_TRUE(click(11, 0.2));
    EXPECT_FALSE(click(11, 0.25)); // a third one begins anew
    EXPECT_TRUE(click(11, 0.3));
    EXPECT_FALSE(click(10, 2));
    EXPECT_FALSE(click(10, 2.4)); // too late, but the first one of the next
    EXPECT_TRUE(click(10, 2.5, 2));
    EXPECT_FALSE(click(10, 4));
    EXPECT_FALSE(click(30, 4.1)); // elsewhere
    EXPECT_TRUE(click(30, 4.2));
    // Drags, first, second and both; also those that come back to where they began.
    EXPECT_FALSE(click(10, 6, 40));
    EXPECT_FALSE(click(10, 6.1));
    EXPECT_FALSE(click(10, 6.2, 40));
    EXPECT_FALSE(click(10, 6.3, 40));
    EXPECT_FALSE(click(10, 6.4));
    EXPECT_FALSE(clicks.release()); // without a press
}

TEST(Views, labelsTakeThePlaceOfEditedColoursAndNotOfThoseAskedFor) {
    RenderSettings asked;
    View view = initial_view(asked);
    view.look.transfer = TransferEdit{};
    view.look.surfaces = {Surface{}};
    EXPECT_EQ(settings_of(asked, view).labels, render::LabelMode::automatic);
    EXPECT_TRUE(may_draw_labels(asked, view.look));
    draw_labels(view.look, render::LabelMode::always);
    EXPECT_EQ(settings_of(asked, view).labels, render::LabelMode::always);
    EXPECT_EQ(words_of({"render", "v.nrrd", "--size", "64"}, asked, view),
              (std::vector<std::string>{"render", "v.nrrd", "--labels", "always", "--size", "64"}));
    view.look.algorithm = render::Algorithm::multi_scattering;
    EXPECT_FALSE(may_draw_labels(asked, view.look));
    view.look.algorithm = asked.algorithm;
    asked.domain = "0:3";
    EXPECT_FALSE(may_draw_labels(asked, view.look));
}

TEST(Cameras, axisViewsAreThoseOfTheCommandLine) {
    Volume const volume = render::testing::blobs({20, 16, 24}, DataType::uint8);
    std::array<char const*, 6> const names{"x", "-x", "y", "-y", "z", "-z"};
    for (int i = 0; i < 6; ++i) {
        RenderSettings s;
        s.width = s.height = 8, s.camera.fit = render::Fit::volume;
        s.camera.view = names[static_cast<std::size_t>(i)];
        Camera const asked = render::testing::render_one(volume, s).report.camera;
        Camera const got = axis_view(front(), i / 2, i % 2 == 1);
        Vec3 const a = asked.eye - asked.target, b = got.eye - got.target;
        EXPECT_NEAR(dot(a, b), length(a) * length(b), 1e-9) << names[static_cast<std::size_t>(i)];
        EXPECT_LT(distance(axes_of(asked).up, axes_of(got).up), 1e-9) << names[static_cast<std::size_t>(i)];
        EXPECT_LT(distance(got.target, front().target), 1e-12);
    }
}

TEST(Cameras, linesMeetThePlacesThatTheyComeFrom) {
    for (Camera const& camera : {front(), flat_front(), orbit(front(), {0.2, 0.1})})
        for (double const x : {0.0, 0.3, 1.0})
            for (double const y : {0.1, 0.5, 0.9}) {
                Line const line = line_under(camera, x, y, 1.5);
                auto const place = place_of(camera, line.origin + line.direction * 7, 1.5);
                ASSERT_TRUE(place);
                EXPECT_NEAR((*place)[0], x, 1e-9);
                EXPECT_NEAR((*place)[1], y, 1e-9);
            }
    EXPECT_FALSE(place_of(front(), {0, -20, 0}, 1));
}

TEST(Cameras, withoutPerspectiveTheTargetStaysAsLarge) {
    Camera const flat = projected(front(), Projection::orthographic);
    EXPECT_NEAR(span_of(flat), span_of(front()), 1e-12);
    EXPECT_LT(distance(projected(flat, Projection::perspective).eye, front().eye), 1e-9);
    EXPECT_EQ(round_length(7.3), 5);
    EXPECT_EQ(round_length(0.02), 0.02);
    EXPECT_NEAR(round_length(190), 100, 1e-9);
}

/// A box of 100 in nothing, its near face at y = 12 in index space.
Volume box_volume() {
    Header header;
    header.dims = {32, 32, 32};
    Volume volume(header);
    auto* const data = reinterpret_cast<std::uint8_t*>(volume.mutable_view().data);
    for (int i = 0; i < 32 * 32 * 32; ++i) {
        int const x = i % 32, y = i / 32 % 32, z = i / 1024;
        bool const inside = x >= 12 && x < 20 && y >= 12 && y < 20 && z >= 12 && z < 20;
        data[i] = inside ? 100 : 0;
    }
    return volume;
}

TEST(Cameras, pointsAndPartsAreFoundWhereThingsAre) {
    Volume const volume = box_volume();
    render::Renderer const renderer(volume, {});
    render::TransferFunction transfer;
    transfer.points = {{50, {}, 0}, {50, {}, 1}};
    Camera camera = front();
    camera.eye = {15.5, -80, 15.5}, camera.target = {15.5, 15.5, 15.5};
    auto const met = point_met(line_under(camera, 0.5, 0.5, 1), renderer, transfer, 1, {});
    ASSERT_TRUE(met);
    EXPECT_NEAR(met->y, 11.5, 0.2);
    EXPECT_FALSE(point_met(line_under(camera, 0.05, 0.05, 1), renderer, transfer, 1, {}));
    auto const on_surface = point_met(line_under(camera, 0.5, 0.5, 1), renderer, transfer, 1, {50});
    ASSERT_TRUE(on_surface);
    EXPECT_NEAR(on_surface->y, 11.5, 0.2);
    EXPECT_FALSE(point_met(line_under(camera, 0.5, 0.5, 1), renderer, transfer, 1, {200}));

    render::RenderReport report;
    report.transfer = transfer, report.unit = 1;
    // A box around the cube's face, 8 wide at distance 91.5.
    double const half = 4 / (91.5 * std::tan(15 * std::acos(-1.0) / 180)) / 2;
    auto const part = part_in_box(camera, {0.5 - half, 0.5 - half, 0.5 + half, 0.5 + half}, 1, renderer, report);
    ASSERT_TRUE(part);
    EXPECT_NEAR(static_cast<double>(part->lower.x), 12, 1);
    EXPECT_NEAR(static_cast<double>(part->upper.x), 20, 1);
    EXPECT_NEAR(static_cast<double>(part->lower.z), 12, 1);
    EXPECT_LE(part->lower.y, 12);
    EXPECT_FALSE(part_in_box(camera, {0.01, 0.01, 0.05, 0.05}, 1, renderer, report));
    EXPECT_FALSE(part_in_box(camera, {0.5, 0.5, 0.5, 0.5}, 1, renderer, report));

    // The same in parsecs and in metres: of a galaxy, and of a crystal.
    for (double const length : {3e18, 3e-10}) {
        Header header = volume.header();
        header.geometry.spacing = {length, length, length};
        Volume scaled(header);
        std::memcpy(scaled.mutable_view().data, volume.view().data, header.bytes());
        render::Renderer const in_world(scaled, {});
        Camera there = camera;
        there.eye = camera.eye * length, there.target = camera.target * length;
        auto const place = point_met(line_under(there, 0.5, 0.5, 1), in_world, transfer, length, {});
        ASSERT_TRUE(place);
        EXPECT_NEAR(place->y, 11.5 * length, 0.2 * length);
        report.unit = length;
        auto const same = part_in_box(there, {0.5 - half, 0.5 - half, 0.5 + half, 0.5 + half}, 1, in_world, report);
        ASSERT_TRUE(same);
        EXPECT_NEAR(static_cast<double>(same->lower.x), 12, 1);
        EXPECT_NEAR(static_cast<double>(same->upper.z), 20, 1);
    }
}

/// What a parser of command lines makes of the words.
RenderSettings parsed(std::vector<std::string> words) {
    words.erase(words.begin());
    render::SettingsParameters options;
    Parameters list;
    options.declare(list);
    read_words(words, {&list});
    options.check();
    return options.settings();
}

TEST(Views, theCommandDrawsWhatIsSeen) {
    Volume const volume = render::testing::blobs({20, 16, 24}, DataType::uint8);
    RenderSettings asked;
    asked.width = 40, asked.height = 32, asked.domain = "0:255", asked.shade = 0, asked.step = 0.25;
    std::vector<std::string> const words{"render",  "--size", "40x32",  "--domain", "0:255",
                                         "--shade", "none",   "--step", "0.25"};
    std::vector<View> views(15, initial_view(asked));
    TransferEdit edit;
    edit.lower = 20.5, edit.upper = 200;
    edit.knots = {{20.5, 0}, {90, 1.0 / 3}, {150, 0.9}};
    views[0].camera = orbit(front(), {0.1, 0.2});
    views[0].camera->target = {10, 8, 12}, views[0].camera->eye = {40, -60, 30};
    views[1].look.transfer = edit;
    views[2].look.transfer = edit, views[2].look.transfer->logarithmic = true, views[2].look.shade = 0.8;
    views[3].look.transfer = edit, own_colors(*views[3].look.transfer), views[3].look.unit = "2.5";
    views[3].look.opacity_scale = 0.3, views[3].look.clip = "2:18,:,4:20";
    views[4].look.algorithm = render::Algorithm::implicit_iso;
    views[4].look.surfaces = {{60.25, {1, 0.5, 0.25}, 0.5}, {120, {0.1, 0.2, 0.3}, 1}};
    views[5].look.algorithm = render::Algorithm::implicit_iso;
    views[5].look.transfer = edit, views[5].look.opacity_scale = 7;
    views[6].look.algorithm = render::Algorithm::multi_scattering;
    views[6].look.samples = 5, views[6].look.albedo = 0.75, views[6].look.emission = true;
    views[7].look.exact = true, views[7].look.transfer = edit;
    views[8].width = 24, views[8].look.step = 1.5, views[8].look.colormap = "ember:reverse";
    for (std::size_t i = 9; i < 13; ++i) {
        views[i].look.light_direction = Vec3{1, -0.5, 0.25};
        views[i].look.shadows = true, views[i].look.ambient = 0.4, views[i].look.ambient_occlusion = 7;
        views[i].look.clip_planes = {0, 1, 0.5, 4, 1, 0, 0, 3};
    }
    views[9].look.shade = -1; // a light is there to be seen
    views[10].look.algorithm = render::Algorithm::implicit_iso, views[10].look.shade = -1;
    views[11].look.exact = true;                                                   // has no light, and keeps its planes
    views[12].look.shadows = false, views[12].look.shade = 0;                      // occlusion alone
    views[13].look.light_direction = Vec3{1, 0, 0}, views[13].look.shadows = true; // without surfaces
    views[14].look.light_direction = Vec3{1, 0, 0}, views[14].look.shade = 0;      // of no effect
    for (View const& view : views) {
        std::vector<std::string> const said = words_of(words, asked, view);
        RenderSettings const shown = settings_of(asked, view), again = parsed(said);
        EXPECT_EQ(render::options_of(again), render::options_of(shown)) << join(said, " ");
        EXPECT_EQ(render::testing::render_one(volume, again).image.pixels,
                  render::testing::render_one(volume, shown).image.pixels)
            << join(said, " ");
    }
}

TEST(Views, anEnvironmentIsTurnedInTheCommand) {
    RenderSettings asked;
    asked.algorithm = render::Algorithm::multi_scattering;
    asked.environment_file = "sky.pfm";
    View view = initial_view(asked);
    view.look.environment_rotation = -30, view.look.environment_strength = 2;
    EXPECT_EQ(join(words_of({"render", "a.nrrd", "--environment", "sky.pfm"}, asked, view), " "),
              "render a.nrrd --environment sky.pfm --environment-rotation -30 --environment-strength 2");
}

TEST(Views, anglesAreThoseOfTheCamera) {
    EXPECT_EQ(direction_of({0, 0}), (Vec3{0, -1, 0}));
    EXPECT_EQ(direction_of({90, 0}), (Vec3{1, 0, 0}));
    EXPECT_EQ(direction_of({45, 90}), (Vec3{0, 0, 1}));
    Angles const back = angles_of(direction_of({-37, 21}) * 5);
    EXPECT_NEAR(back.azimuth, -37, 1e-4);
    EXPECT_NEAR(back.elevation, 21, 1e-4);
    EXPECT_EQ(angles_of({0, 0, -2}).azimuth, 0);
}

TEST(Views, aNewPlaneCutsTheMiddleAndShowsWhatIsBehind) {
    Header header;
    header.dims = {10, 20, 30};
    header.geometry.origin = {0.5, 0.5, 0.5};
    auto const plane = plane_facing(front(), header); // looks along y
    EXPECT_EQ(plane, (std::array<double, 4>{0, 1, 0, 10}));
    EXPECT_EQ(plane_distances({0, 0, -1}, header), (std::array<double, 2>{-30, 0}));
    header.geometry.spacing = header.geometry.origin = {1e-9, 1e-9, 1e-9};
    EXPECT_NEAR(plane_facing(front(), header)[3], 10.5e-9, 1e-14);
}

/// As the window has it to show and to edit, of a picture that is drawn so.
TransferEdit edit_shown(Volume const& volume, RenderSettings const& asked, Look const& look) {
    View view;
    view.width = view.height = 16, view.look = look;
    return editable_transfer(asked, look, render::testing::render_one(volume, settings_of(asked, view)).report);
}

TEST(Views, whatIsToBeEditedHasTheColoursThatAreDrawn) {
    Volume const volume = render::testing::blobs({12, 10, 8}, DataType::uint8);
    RenderSettings const asked;
    Look look = initial_view(asked).look;
    EXPECT_EQ(edit_shown(volume, asked, look).colormap, "tissue");
    for (auto const algorithm : {render::Algorithm::maximum, render::Algorithm::minimum, render::Algorithm::mean}) {
        look.algorithm = algorithm;
        TransferEdit const edit = edit_shown(volume, asked, look);
        EXPECT_EQ(edit.colormap, "grey");
        EXPECT_TRUE(edit.colors.empty());
        // The same to the eye once it is the user's, and no opaque block where there are opacities.
        View before, after;
        before.width = before.height = after.width = after.height = 16;
        before.look = after.look = look, after.look.transfer = edit;
        EXPECT_LT(
            render::testing::greatest_difference(render::testing::render_one(volume, settings_of(asked, before)).image,
                                                 render::testing::render_one(volume, settings_of(asked, after)).image),
            1e-5);
        EXPECT_EQ(edit.knots.front().alpha, 0);
        look.colormap = "viridis";
        EXPECT_EQ(edit_shown(volume, asked, look).colormap, "viridis");
        look.colormap.clear();
    }
    // A preset has a map of its own.
    RenderSettings preset;
    preset.preset = render::DataKind::density;
    TransferEdit const edit = edit_shown(volume, preset, initial_view(preset).look);
    View view;
    view.width = view.height = 16, view.look = initial_view(preset).look;
    auto const report = render::testing::render_one(volume, settings_of(preset, view)).report;
    for (auto const& p : report.transfer.points) EXPECT_NEAR(color_at(edit, p.value).red, p.color.red, 1.5 / 255);
}

TEST(Views, aCameraThatHandsHaveMovedHasFewDigits) {
    Camera camera = front();
    camera.target = {1.0 / 3, 100, 0};
    camera.fov = 29.999999999999996;
    Camera const few = shortened(orbit(camera, {0.1, 0.2}));
    EXPECT_EQ(few.fov, 30);
    EXPECT_LT(distance(few.eye, orbit(camera, {0.1, 0.2}).eye), 3e-7);
    EXPECT_LT(distance(few.up, orbit(camera, {0.1, 0.2}).up), 2e-9);
    for (double const v : {few.eye.x, few.eye.y, few.eye.z, few.up.x, few.up.y, few.up.z, few.target.x})
        EXPECT_LE(to_text(v).size(), 13U) << to_text(v);
    EXPECT_EQ(shortened(few).eye, few.eye);
    EXPECT_EQ(shortened(front()).eye, front().eye);
    // To and fro is where it was, as far as the digits go.
    Camera there = few;
    for (int i = 0; i < 50; ++i) there = shortened(orbit(shortened(orbit(there, {0.01 * i, 0})), {-0.01 * i, 0}));
    EXPECT_EQ(there.target, few.target);
    // Worlds of any size.
    for (double const size : {1e-9, 1e12}) {
        Camera other = front();
        other.eye = Vec3{-1, -2, 3} * (size / 3), other.target = Vec3{1, 2, 7} * size;
        EXPECT_LT(distance(shortened(other).eye, other.eye), 1e-8 * size);
        EXPECT_LT(distance(shortened(other).target, other.target), 1e-8 * size);
    }
}

TEST(Slices, aPointLiesInAVoxelUpToItsEdges) {
    Index3 const dims{4, 1, 10};
    EXPECT_EQ(voxel_at({0, 0, 0}, dims), (Index3{0, 0, 0}));
    EXPECT_EQ(voxel_at({0.249, 0.5, 0.1}, dims), (Index3{0, 0, 1}));
    EXPECT_EQ(voxel_at({0.25, 0.999999, 0.999999}, dims), (Index3{1, 0, 9}));
    EXPECT_EQ(voxel_at({1, 1, 1}, dims), (Index3{3, 0, 9}));
}

TEST(Views, numbersAreSaidWithoutNeedlessDigits) {
    EXPECT_EQ(rounded_within(29.999999999999996, 3e-8), 30);
    EXPECT_EQ(rounded_within(0.1234567, 0), 0.1234567);
    EXPECT_EQ(rounded_within(-1234.5678, 0.2), -1234.6);
    EXPECT_EQ(rounded_within(0, 0), 0);
    RenderSettings const asked;
    View view = initial_view(asked);
    view.camera = front();
    view.camera->fov = 29.999999999999996;
    TransferEdit edit;
    edit.lower = 0.1 + 0.2, edit.upper = 200;
    edit.knots = {{edit.lower, 0}, {90, 0.1 * 3}, {150, 0.9}};
    view.look.transfer = edit;
    EXPECT_EQ(join(words_of({"render", "a.nrrd"}, asked, view), " "),
              "render a.nrrd --colormap viridis --opacity 0.3:0,90:0.3,150:0.9 --domain 0.3:200 --eye 0,-10,0 "
              "--target 0,0,0 --up 0,0,1 --fov 30");
}

TEST(Views, inputsStayBeforeListsOfNumbers) {
    RenderSettings asked;
    asked.algorithm = render::Algorithm::implicit_iso;
    asked.isos = {-3, 4};
    View view = initial_view(asked);
    view.look.surfaces = {{5, {1, 1, 1}, 1}};
    EXPECT_EQ(join(words_of({"render", "7", "--render-algo", "implicit-iso", "--iso", "-3", "4"}, asked, view), " "),
              "render 7 --iso 5 --iso-color 1 1 1 --render-algo implicit-iso");
}

TEST(Views, clipBoxesAreWholeVoxels) {
    Index3 const dims{10, 7, 1};
    EXPECT_EQ(clip_text({{{0, 1}, {0, 1}, {0, 1}}}, dims), "");
    EXPECT_EQ(clip_text({{{0.25, 1}, {0, 0.5}, {0.9, 1}}}, dims), "3:10,0:4,:");
    Shares const back = clip_shares("3:10,0:4,:", dims);
    EXPECT_EQ(clip_text(back, dims), "3:10,0:4,:");
    // Never nothing.
    EXPECT_EQ(clip_text({{{1, 1}, {0, 0}, {0, 1}}}, dims), "9:10,0:1,:");
}

} // namespace
} // namespace vkt::shell::viewer
