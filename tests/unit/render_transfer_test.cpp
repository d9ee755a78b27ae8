// Transfer functions, tables, domains, cameras and pictures.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/products.h"
#include "libvkt/formats/series.h"
#include "libvkt/render/inner/exact.h"
#include "libvkt/render/settings.h"
#include "tests/unit/render_testing.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

using namespace vkt;
using namespace vkt::render;
using namespace vkt::render::testing;

TEST(RenderTransfer, LookupTablesTakeAnyMultipleOfFour) {
    EXPECT_EQ(transfer_from_lut({1, 0, 0, 1}, 0, 10).points.size(), 1U);
    TransferFunction const two = transfer_from_lut({1, 0, 0, 0, 0, 1, 0, 1}, 10, 20);
    EXPECT_EQ(two.points[0].value, 10);
    EXPECT_EQ(two.points[1].value, 20);
    EXPECT_THROW(transfer_from_lut({}, 0, 1), Error);
    EXPECT_THROW(transfer_from_lut({1, 1, 1}, 0, 1), Error);
    EXPECT_THROW(transfer_from_lut({1, 1, 1, 1.5}, 0, 1), Error);
    EXPECT_THROW(transfer_from_lut({1, 1, std::nan(""), 1}, 0, 1), Error);
}

TEST(RenderTransfer, TablesFollowTheKnots) {
    TransferFunction transfer;
    transfer.linear_colors = true;
    transfer.points = {{30, {0, 0, 1}, 0.5}, {10, {1, 0, 0}, 0}, {20, {1, 1, 0}, 0.2}}; // not sorted
    transfer.check_and_sort();
    std::vector<Knot> const knots = knots_of(transfer, {}, {}, 2, 1);
    TransferTable const table(knots, 2001);
    for (double v = 5; v < 35; v += 0.37) {
        auto const stored = static_cast<float>(v);
        Classified const c = classify(table.view(), table_position(table.view(), stored));
        double const a = extinction_of(0.2) / 2, b = extinction_of(0.5) / 2;
        double const expected = v <= 10 ? 0 : v <= 20 ? (v - 10) / 10 * a : v <= 30 ? a + (v - 20) / 10 * (b - a) : b;
        EXPECT_NEAR(c.density[0], expected, 1e-6) << v;
        EXPECT_NEAR(c.density[3], expected * (v <= 20 ? 0 : v <= 30 ? (v - 20) / 10 : 1), 1e-5) << v;
    }
}

TEST(RenderTransfer, BendsAreWhereTheExtinctionBends) {
    // Colours bend more often than opacities: 48 knots between black and white, of which extinction needs none.
    TransferFunction const slope = transfer_from_lut({0, 0, 0, 0.1, 1, 0, 0, 0.1, 1, 1, 0, 0.6, 0, 1, 0, 0.6}, 0, 3);
    std::vector<Knot> const knots = knots_of(slope, {}, {}, 1, 1), bends = bends_of(knots);
    EXPECT_EQ(knots.size(), 145U);
    ASSERT_EQ(bends.size(), 4U);
    for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(bends[i].value, static_cast<double>(i));
    for (Knot const& k : knots)
        EXPECT_NEAR(evaluate(bends.data(), 4, k.value).extinction, k.extinction, 1e-12) << k.value;
    // Both sides of a step stay, and what bends a little everywhere bends.
    std::vector<Knot> const step = bends_of({{0, 1, 0, 0, 0}, {1, 1, 1, 0, 0}, {1, 3, 1, 0, 0}, {2, 3, 0, 0, 0}});
    ASSERT_EQ(step.size(), 4U);
    EXPECT_EQ(step[1].extinction, 1);
    EXPECT_EQ(step[2].extinction, 3);
    std::vector<Knot> parabola;
    for (int i = 0; i <= 100; ++i) parabola.push_back({i * 0.01, i * i * 1e-4, 0, 0, 0});
    EXPECT_EQ(bends_of(parabola).size(), parabola.size());
    EXPECT_EQ(bends_of({{5, 1, 0, 0, 0}}).size(), 1U);
}

TEST(RenderTransfer, ADomainWithoutExtentIsAStep) {
    TransferFunction transfer = transfer_from_lut({1, 1, 1, 0, 1, 1, 1, 0.5}, 7, 7);
    TransferTable const table(knots_of(transfer, {}, {}, 1, 1));
    auto const extinction = [&](float v) { return classify(table.view(), table_position(table.view(), v)).density[0]; };
    EXPECT_EQ(extinction(6.9F), 0);
    EXPECT_NEAR(extinction(7.1F), std::log(2), 1e-6);
}

// Whatever its float, the value of a constant volume is at the step, and what is a little less is not.
TEST(RenderTransfer, ConstantVolumesAreDrawn) {
    for (double const value : {1.0, 7.0, 5.0, 100.0, 0.3, -2.7, 0.0, 1e20, -1e-20, 16777215.0}) {
        Volume const volume = constant_volume({4, 4, 4}, static_cast<float>(value), {1, 1, 1});
        RenderSettings s = orthographic("x", 5, 5);
        s.opacity = "0,0.2";
        EXPECT_NEAR(render_one(volume, s).center()[3], std::exp(-4 * extinction_of(0.2)), 1e-4) << value;
        s.opacity = "auto";
        EXPECT_LT(render_one(volume, s).center()[3], 1e-2) << value;
        TransferTable const table(knots_of(transfer_from_lut({1, 1, 1, 0, 1, 1, 1, 0.5}, value, value), {}, {}, 1, 1));
        auto const below = static_cast<float>(value - (value != 0 ? 1e-2 * std::abs(value) : 1e-3));
        EXPECT_EQ(classify(table.view(), table_position(table.view(), below)).density[0], 0) << value;
    }
}

TEST(RenderTransfer, OpacitiesOverTheDomainInterpolateExtinctionAsTablesDo) {
    Volume const volume = constant_volume({1, 4, 4}, 0.5F, {1, 1, 1});
    RenderSettings s = orthographic("x", 5, 5);
    s.domain = "0:1";
    s.opacity = "0,0.9";
    EXPECT_NEAR(render_one(volume, s).center()[3], std::exp(-0.5 * extinction_of(0.9)), 1e-5);
    s.opacity = "0:0.2,0.25:0.3,0.9:1";
    double const share = (0.5 - 0.25) / 0.65, extinction = (1 - share) * extinction_of(0.3) + share * extinction_of(1);
    EXPECT_NEAR(render_one(volume, s).center()[3], std::exp(-extinction), 1e-5);
}

TEST(RenderTransfer, GreatestExtinctionBoundsEveryValueBetween) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> share(0, 1);
    std::vector<double> lut;
    for (int i = 0; i < 4 * 37; ++i) lut.push_back(i % 4 == 3 && i % 3 == 0 ? 0 : share(random));
    TransferTable const table(knots_of(transfer_from_lut(lut, -3, 5), {}, {}, 1, 1));
    for (int i = 0; i < 3000; ++i) {
        double const a = -4 + 10 * share(random), b = a + share(random) * share(random) * 3;
        float const bound = table.greatest_extinction(static_cast<float>(a), static_cast<float>(b));
        float greatest = 0;
        for (int k = 0; k <= 100; ++k) {
            auto const v = static_cast<float>(a + (b - a) * k / 100);
            greatest = std::max(greatest, classify(table.view(), table_position(table.view(), v)).density[0]);
        }
        ASSERT_LE(greatest, bound * (1 + 0x1p-18F));
    }
}

TEST(RenderTransfer, JsonKeepsEverything) {
    TransferFunction transfer = transfer_from_lut({1, 0, 0.25, 0, 0, 1, 0, 1}, 10, 20);
    transfer.unit = 2.5;
    transfer.linear_colors = true;
    TransferFunction const again = transfer_from_json(transfer_to_json(transfer));
    EXPECT_EQ(again.points, transfer.points);
    EXPECT_EQ(again.unit, 2.5);
    EXPECT_TRUE(again.linear_colors);
    EXPECT_EQ(transfer_from_json(R"({"domain":[10,20],"points":[[0.5,1,1,1,1]]})").points[0].value, 15);
    for (char const* bad :
         {"", "[]", "{}", R"({"points":[[1,2]]})", R"({"points":[[0,0,0,0,2]]})", R"({"points":[],"unit":1})",
          R"({"points":[[0,0,0,0,"a"]]})", R"({"points":[[0,0,0,0,1]],"unit":-1})"})
        EXPECT_THROW(transfer_from_json(bad), Error) << bad;
}

TEST(RenderTransfer, Domains) {
    Histogram h;
    h.least = 0, h.greatest = 100;
    h.bins.assign(100, 10);
    h.total = 1000;
    EXPECT_EQ(resolve_domain("minmax", h).upper, 100);
    EXPECT_NEAR(resolve_domain("p1:p99", h).lower, 1, 1e-9);
    EXPECT_NEAR(resolve_domain("p1:p99", h).upper, 99, 1e-9);
    EXPECT_EQ(resolve_domain("-5:7.5", h).lower, -5);
    for (char const* bad : {"5", "7:5", "5:5", "5:5.0", "a:b", "p200:p3", ":", "1:2:3"})
        EXPECT_THROW(resolve_domain(bad, h), Error) << bad;
}

// Of large volumes some rows are counted, in all slices: here a ramp along x in the even ones and zeros in the others.
TEST(RenderTransfer, PercentilesOfLargeVolumes) {
    Header header;
    header.dims = {4096, 4096, 4};
    header.dtype = DataType::uint8;
    Volume volume(header);
    auto const v = volume.mutable_view().as<std::uint8_t>();
    for (std::int64_t z = 0; z < 4; ++z)
        for (std::int64_t y = 0; y < 4096; ++y)
            for (std::int64_t x = 0; x < 4096; ++x) v(x, y, z) = static_cast<std::uint8_t>(z % 2 == 0 ? x / 16 : 0);
    Histogram const h = make_lattice(volume.view(), {}, default_execution()).histogram;
    EXPECT_NEAR(h.percentile(0.4), 0, 0.1);
    EXPECT_NEAR(h.percentile(0.75), 127, 1);
    EXPECT_NEAR(h.percentile(0.95), 229, 1);
}

// A ramp whose extent, or the inverse of it, double has no room for.
TEST(RenderTransfer, HistogramsOfTheLargestAndSmallestDoubles) {
    for (double const end : {1.5e308, 1e-305}) {
        Header header;
        header.dims = {1001, 4, 4};
        header.dtype = DataType::float64;
        Volume volume(header);
        auto const v = volume.mutable_view().as<double>();
        for (std::int64_t i = 0; i < 16 * 1001; ++i)
            v(i % 1001, i / 1001 % 4, i / 4004) = (static_cast<double>(i % 1001) / 500 - 1) * end;
        Histogram const h = make_lattice(volume.view(), {}, default_execution()).histogram;
        EXPECT_EQ(h.total, 16 * 1001);
        EXPECT_EQ(h.least, -end);
        EXPECT_EQ(h.greatest, end);
        for (double const p : {0.1, 0.5, 0.9}) EXPECT_NEAR(h.percentile(p) / end, 2 * p - 1, 2e-3) << end << " " << p;
        Domain const domain = resolve_domain("p10:p90", h);
        EXPECT_NEAR(domain.lower / end, -0.8, 2e-3);
        for (ControlPoint const& point : choose_transfer(h, {"auto", h.least, h.greatest}, "", 1, 1).transfer.points)
            EXPECT_TRUE(std::isfinite(point.value));
    }
}

// Metal in tissue: few values that reach far do not hide what most of the object is.
TEST(RenderTransfer, FewFarValuesHideNoOthers) {
    Header header;
    header.dims = {64, 64, 64};
    header.dtype = DataType::int16;
    Volume volume(header);
    auto const v = volume.mutable_view().as<std::int16_t>();
    for (std::int64_t i = 0; i < 64 * 64 * 64; ++i) {
        std::int64_t const x = i % 64 - 32, y = i / 64 % 64 - 32, z = i / 4096, squared = x * x + y * y;
        std::int64_t const value = squared < 4 ? 400 + 16 * z : squared < 64 ? 240 : squared < 120 ? 120 : z % 2 * 40;
        v(i % 64, i / 64 % 64, z) = static_cast<std::int16_t>(value);
    }
    Histogram const h = make_lattice(volume.view(), {}, default_execution()).histogram;
    auto const transfer = choose_transfer(h, {"auto", h.least, h.greatest}, "", 64, 1).transfer;
    double depth = 0; // of the 8 voxels of a wall of tissue
    for (std::size_t i = 0; i + 1 < transfer.points.size(); ++i)
        if (transfer.points[i].value <= 240 && transfer.points[i + 1].value > 240)
            depth = -8 * std::log1p(-transfer.points[i].alpha);
    EXPECT_GT(depth, 0.5) << transfer.points.front().value << " to " << transfer.points.back().value;
    EXPECT_GT(transfer.points.front().value, 40);
}

TEST(RenderTransfer, ColourMaps) {
    for (std::string const& name : colormap_names())
        for (double x = 0; x <= 1; x += 0.01) {
            Color const c = colormap(name, x), d = colormap(name + ":reverse", 1 - x);
            EXPECT_TRUE(c.red >= 0 && c.red <= 1 && c.green >= 0 && c.green <= 1 && c.blue >= 0 && c.blue <= 1);
            EXPECT_NEAR(c.red, d.red, 1e-12);
        }
    EXPECT_THROW(colormap("virids", 0), Error);
}

// The default camera shows every corner, for odd shapes, all views, directions and both projections.
TEST(RenderCamera, ShowsTheWholeVolume) {
    Geometry g;
    g.origin = {100, -50, 7};
    g.spacing = {0.5, 2, 3};
    g.direction = {{{0.6, 0.8, 0}, {-0.8, 0.6, 0}, {0, 0, -1}}};
    Index3 const dims{40, 11, 27};
    for (Projection const projection : {Projection::perspective, Projection::orthographic})
        for (char const* view : {"oblique", "x", "-x", "y", "-y", "z", "-z"}) {
            CameraRequest request;
            request.view = view;
            request.projection = projection;
            Camera const camera = make_camera(request, corners_of(g, box_of(dims)), 1.5);
            RayFrame const frame = frame_of(camera, g, lattice_padding, 150, 100);
            double const low = lattice_padding - 0.5;
            ShownPart const shown{{low, low, low}, {low + 40, low + 11, low + 27}, {}, 0};
            Ray ray;
            EXPECT_TRUE(make_ray(frame, 75, 50, shown, ray)) << view;
            bool touched = false;
            for (double t = 0; t <= 1; t += 0.01)
                for (double const edge : {0.0, 1.0})
                    touched = touched || make_ray(frame, 150 * t, 100 * edge, shown, ray) ||
                              make_ray(frame, 150 * edge, 100 * t, shown, ray);
            EXPECT_FALSE(touched) << view << " leaves the picture";
        }
}

// What is left free at the edges stays free, and the rest is used, for turned volumes, zooms and both projections.
TEST(RenderCamera, LeavesRoomAtTheEdges) {
    Geometry g;
    g.direction = {{{0.6, 0.8, 0}, {-0.8, 0.6, 0}, {0, 0, -1}}};
    auto const corners = corners_of(g, box_of({40, 11, 27}));
    for (Projection const projection : {Projection::perspective, Projection::orthographic})
        for (bool const steady : {false, true})
            for (double const zoom : {1.0, 0.5})
                for (double const aspect : {0.4, 1.0, 2.5}) {
                    CameraRequest request;
                    request.projection = projection;
                    request.steady = steady;
                    request.zoom = zoom;
                    request.insets = {0.25, 0.15};
                    Camera const c = make_camera(request, corners, aspect);
                    Vec3 const ahead = unit(c.target - c.eye), right = unit(cross(ahead, c.up)),
                               up = cross(right, ahead);
                    double const half =
                        projection == Projection::perspective ? std::tan(c.fov * std::numbers::pi / 360) : c.height / 2;
                    double x[2] = {9, -9}, y[2] = {9, -9};
                    for (Vec3 const& corner : corners) {
                        Vec3 const way = corner - c.eye;
                        double const depth = projection == Projection::perspective ? dot(way, ahead) : 1;
                        double const u = dot(way, right) / (depth * half * aspect), v = dot(way, up) / (depth * half);
                        x[0] = std::min(x[0], u), x[1] = std::max(x[1], u);
                        y[0] = std::min(y[0], v), y[1] = std::max(y[1], v);
                    }
                    // The frame from -1 to 1 is left of 0.5 and above -0.7, its middle at -0.25 and 0.15.
                    double const across = std::max(0.5 - 0.75 - x[0], x[1] - (0.5 - 0.75)) / 0.75,
                                 along = std::max(0.15 - y[0], y[1] - 0.15) / 0.85, fills = std::max(across, along);
                    EXPECT_LT(fills, zoom * 1.03) << aspect;
                    EXPECT_GT(fills, zoom * (steady ? 0.5 : 0.94)) << aspect;
                    EXPECT_NEAR(x[0] + x[1], -0.5, steady ? 0.2 : 0.1) << aspect;
                }
}

// The direction of a view must not be lost to the size of the world's units.
TEST(RenderCamera, ViewsDoNotDependOnWorldUnits) {
    for (char const* view : {"oblique", "x", "-y", "z"})
        for (double const spacing : {1e-20, 1e14, 1e15, 1e20}) {
            Geometry g;
            CameraRequest request;
            request.view = view;
            Index3 const dims{24, 20, 28};
            Camera const one = make_camera(request, corners_of(g, box_of(dims)), 1.5);
            g.spacing = {spacing, spacing, spacing};
            Camera const scaled = make_camera(request, corners_of(g, box_of(dims)), 1.5);
            for (auto const part : {&Vec3::x, &Vec3::y, &Vec3::z})
                EXPECT_NEAR(scaled.eye.*part / spacing, one.eye.*part, 1e-9) << view << " at spacing " << spacing;
        }
}

TEST(RenderCamera, StandsOnTheSideOfTheViewWhereverTheTargetIs) {
    for (Projection const projection : {Projection::perspective, Projection::orthographic}) {
        CameraRequest request;
        request.view = "-y";
        request.projection = projection;
        request.target = Vec3{32, -1000, 32};
        Camera const camera = make_camera(request, corners_of({}, box_of({64, 64, 64})), 1);
        EXPECT_LT(camera.eye.y, -1000);
    }
}

// At 90 degrees the azimuth turns the picture as it does just before.
TEST(RenderCamera, AzimuthTurnsViewsFromAboveAndBelow) {
    Geometry const g;
    Index3 const dims{8, 8, 8};
    auto const up = [&](double azimuth, double elevation) {
        CameraRequest request;
        request.azimuth = azimuth, request.elevation = elevation;
        return frame_of(make_camera(request, corners_of(g, box_of(dims)), 1), g, lattice_padding, 9, 9).up;
    };
    for (double const elevation : {90.0, -90.0})
        for (double const azimuth : {0.0, 40.0, 90.0, 215.0}) {
            Double3 const difference = up(azimuth, elevation) - up(azimuth, elevation * 0.9999);
            EXPECT_LT(dot(difference, difference), 1e-6) << azimuth << ", " << elevation;
        }
}

TEST(RenderCamera, TakesFinitePositionsOnly) {
    auto const corners = corners_of({}, box_of({8, 8, 8}));
    double const infinity = std::numeric_limits<double>::infinity();
    for (auto const member : {&CameraRequest::eye, &CameraRequest::target, &CameraRequest::up})
        for (Vec3 const bad : {Vec3{infinity, 0, 0}, Vec3{0, 0, -infinity}, Vec3{0, std::nan(""), 1}}) {
            CameraRequest request;
            request.*member = bad;
            EXPECT_THROW(make_camera(request, corners, 1), Error);
        }
}

TEST(RenderImage, LightIsEncodedAsSrgb) {
    Image image{3, 1, {0, 0, 0, 1, 0.2158605F, 0.2158605F, 0.2158605F, 0, 0.5F, 0, 0, 0.5F}};
    auto const opaque = to_bytes(image, {{0, 0, 1}, 1});
    EXPECT_EQ(opaque, (std::vector<unsigned char>{0, 0, 255, 128, 128, 128, 188, 0, 188}));
    auto const transparent = to_bytes(image, {{0, 0, 0}, 0});
    EXPECT_EQ(transparent, (std::vector<unsigned char>{0, 0, 0, 0, 128, 128, 128, 255, 255, 0, 0, 128}));
    auto const png = to_png(image, {}, {{"Software", "test"}});
    EXPECT_EQ(png, to_png(image, {}, {{"Software", "test"}}));
}

TEST(RenderSettings, NumbersInNames) {
    EXPECT_EQ(numbered_path("a.png", 0), "a.png");
    EXPECT_EQ(numbered_path("a-%04d.png", 12), "a-0012.png");
    EXPECT_EQ(numbered_path("a%d.png", 3), "a3.png");
    EXPECT_EQ(numbered_path("a%%_%02d.png", 3), "a%_03.png");
    EXPECT_THROW(numbered_path("50%.png", 0), Error);
    EXPECT_FALSE(is_numbered("a.png"));
    EXPECT_FALSE(is_numbered("a%%d.png"));
}
