// The engine: chains of operations give the same voxels for every slab height, source and budget, whatever they ask
// for.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/engine/cut.h"
#include "libvkt/engine/decorator.h"
#include "libvkt/engine/line_passes.h"
#include "libvkt/engine/pipeline.h"

#include <chrono>
#include <cstring>
#include <gtest/gtest.h>
#include <random>
#include <thread>

namespace {

using namespace vkt;

/// Sum over a box of the given radius; reads beyond the volume through the boundary rule.
class BoxSum : public Operation {
public:
    BoxSum(Index3 radius, Boundary boundary) : radius_(radius), boundary_(boundary) {}
    std::string_view name() const override { return "box sum"; }
    Shape shape() const override { return Shape::neighbourhood; }
    Plan plan(std::span<Header const> inputs) const override {
        Plan plan;
        plan.output = inputs[0];
        plan.boundary = boundary_;
        plan.border_value = 3;
        return plan;
    }
    Box footprint(Box const& output, int) const override { return grow(output, radius_); }
    void run(std::span<ConstView const> in, AnyView out, Execution const&) override {
        auto const a = in[0].as<std::int32_t>();
        auto const b = out.as<std::int32_t>();
        EXPECT_EQ(in[0].box, grow(out.box, radius_));
        for (auto z = out.box.lower.z; z < out.box.upper.z; ++z)
            for (auto y = out.box.lower.y; y < out.box.upper.y; ++y)
                for (auto x = out.box.lower.x; x < out.box.upper.x; ++x) {
                    std::uint32_t sum = 0;
                    for (auto k = -radius_.z; k <= radius_.z; ++k)
                        for (auto j = -radius_.y; j <= radius_.y; ++j)
                            for (auto i = -radius_.x; i <= radius_.x; ++i)
                                sum += static_cast<std::uint32_t>(a(x + i, y + j, z + k)) *
                                       static_cast<std::uint32_t>(1 + i * i + 3 * j + 5 * k);
                    b(x, y, z) = static_cast<std::int32_t>(sum);
                }
    }

private:
    Index3 radius_;
    Boundary boundary_;
};

class FlipZ : public Operation {
public:
    std::string_view name() const override { return "flip z"; }
    Shape shape() const override { return Shape::geometric; }
    Plan plan(std::span<Header const> inputs) const override {
        Plan plan;
        plan.output = inputs[0];
        plan.access = Access::random;
        return plan;
    }
    void begin(std::span<Header const> inputs, Plan const&) override { n_ = inputs[0].dims.z; }
    Box footprint(Box const& o, int) const override {
        return {{o.lower.x, o.lower.y, n_ - o.upper.z}, {o.upper.x, o.upper.y, n_ - o.lower.z}};
    }
    void run(std::span<ConstView const> in, AnyView out, Execution const&) override {
        auto const a = in[0].as<std::int32_t>();
        auto const b = out.as<std::int32_t>();
        for (auto z = out.box.lower.z; z < out.box.upper.z; ++z)
            for (auto y = out.box.lower.y; y < out.box.upper.y; ++y)
                for (auto x = out.box.lower.x; x < out.box.upper.x; ++x) b(x, y, z) = a(x, y, n_ - 1 - z);
    }

private:
    std::int64_t n_ = 0;
};

/// Subtracts the volume's minimum, which a first pass finds.
class SubtractMinimum : public Operation {
public:
    std::string_view name() const override { return "subtract minimum"; }
    Shape shape() const override { return Shape::pointwise; }
    Plan plan(std::span<Header const> inputs) const override {
        Plan plan;
        plan.output = inputs[0];
        plan.scans = true;
        return plan;
    }
    void begin(std::span<Header const> inputs, Plan const&) override {
        least_ = std::numeric_limits<std::int32_t>::max();
        seen_ = PieceOrder(inputs[0].dims);
    }
    void scan(ConstView slab, Execution const&) override {
        EXPECT_TRUE(seen_.takes(slab.box)) << "slabs must come in order";
        seen_.advance(slab.box);
        auto const a = slab.as<std::int32_t>();
        for (auto z = slab.box.lower.z; z < slab.box.upper.z; ++z)
            for (auto y = slab.box.lower.y; y < slab.box.upper.y; ++y)
                for (auto x = slab.box.lower.x; x < slab.box.upper.x; ++x) least_ = std::min(least_, a(x, y, z));
    }
    void run(std::span<ConstView const> in, AnyView out, Execution const&) override {
        auto const a = in[0].as<std::int32_t>();
        auto const b = out.as<std::int32_t>();
        for (auto z = out.box.lower.z; z < out.box.upper.z; ++z)
            for (auto y = out.box.lower.y; y < out.box.upper.y; ++y)
                for (auto x = out.box.lower.x; x < out.box.upper.x; ++x)
                    b(x, y, z) = static_cast<std::int32_t>(static_cast<std::uint32_t>(a(x, y, z)) -
                                                           static_cast<std::uint32_t>(least_));
    }

private:
    std::int32_t least_ = 0;
    PieceOrder seen_;
};

/// Sums along x, y and z, less a voxel's place among the five that come together; -1 outside of a region.
class LineSums : public Operation, public LinePasses {
public:
    explicit LineSums(Box region) : region_(region) {}
    std::string_view name() const override { return "line sums"; }
    Shape shape() const override { return Shape::geometric; }
    Plan plan(std::span<Header const> inputs) const override {
        Plan plan;
        plan.output = inputs[0];
        plan.whole = true;
        return plan;
    }
    void begin(std::span<Header const>, Plan const&) override {
        passes_ = 0;
        largest_ = 0;
    }
    Box footprint(Box const&, int) const override { return region_; }
    void run(std::span<ConstView const> in, AnyView out, Execution const& execution) override {
        pass_x(in[0], out, execution);
        pass(Axis::y, out.part(region_), execution);
        pass(Axis::z, out.part(region_), execution);
    }
    Box lines() const override { return region_; }
    std::int64_t lines_together() const override { return 5; }
    void pass_x(ConstView in, AnyView out, Execution const&) override {
        tell(out);
        EXPECT_EQ(out.box.lower.x, 0);
        auto const a = in.as<std::int32_t>();
        auto const b = out.as<std::int32_t>();
        for (auto z = out.box.lower.z; z < out.box.upper.z; ++z)
            for (auto y = out.box.lower.y; y < out.box.upper.y; ++y) {
                std::uint32_t sum = 0;
                for (auto x = out.box.lower.x; x < out.box.upper.x; ++x) {
                    bool const inside = region_.contains({{x, y, z}, {x + 1, y + 1, z + 1}});
                    if (inside) sum += static_cast<std::uint32_t>(a(x, y, z));
                    b(x, y, z) = inside ? static_cast<std::int32_t>(sum) : -1;
                }
            }
    }
    void pass(Axis axis, AnyView lines, Execution const&) override {
        tell(lines);
        int const a = static_cast<int>(axis);
        Box const box = lines.box;
        EXPECT_EQ(box.lower[a], region_.lower[a]);
        EXPECT_EQ(box.upper[a], region_.upper[a]);
        auto const v = lines.as<std::int32_t>();
        for (auto z = box.lower.z; z < box.upper.z; ++z)
            for (auto y = box.lower.y; y < box.upper.y; ++y)
                for (auto x = box.lower.x; x < box.upper.x; ++x) {
                    Index3 before{x, y, z};
                    --before[a];
                    auto sum =
                        static_cast<std::uint32_t>(v(x, y, z)) - static_cast<std::uint32_t>((x - box.lower.x) % 5);
                    if (before[a] >= box.lower[a]) sum += static_cast<std::uint32_t>(v(before.x, before.y, before.z));
                    v(x, y, z) = static_cast<std::int32_t>(sum);
                }
    }
    int passes() const { return passes_; }
    std::size_t largest() const { return largest_; }

private:
    void tell(AnyView view) {
        ++passes_;
        largest_ = std::max(largest_, view.bytes());
    }

    Box region_;
    int passes_ = 0;
    std::size_t largest_ = 0; ///< bytes of a pass
};

class CutOut : public Operation {
public:
    explicit CutOut(Box box) : box_(box) {}
    std::string_view name() const override { return "cut"; }
    Shape shape() const override { return Shape::geometric; }
    Plan plan(std::span<Header const> inputs) const override {
        Plan plan;
        plan.output = inputs[0];
        plan.output.dims = box_.dims();
        plan.shift = box_.lower;
        return plan;
    }
    Box footprint(Box const& o, int) const override { return {o.lower + box_.lower, o.upper + box_.lower}; }
    void run(std::span<ConstView const>, AnyView, Execution const&) override {
        FAIL() << "the engine hands cuts through";
    }

private:
    Box box_;
};

/// Every second voxel.
class Halve : public Operation {
public:
    std::string_view name() const override { return "halve"; }
    Shape shape() const override { return Shape::geometric; }
    Plan plan(std::span<Header const> inputs) const override {
        Plan plan;
        plan.output = inputs[0];
        for (int i = 0; i < 3; ++i) plan.output.dims[i] = (inputs[0].dims[i] + 1) / 2;
        return plan;
    }
    Box footprint(Box const& o, int) const override {
        return {{2 * o.lower.x, 2 * o.lower.y, 2 * o.lower.z},
                {2 * o.upper.x - 1, 2 * o.upper.y - 1, 2 * o.upper.z - 1}};
    }
    void run(std::span<ConstView const> in, AnyView out, Execution const&) override {
        auto const a = in[0].as<std::int32_t>();
        auto const b = out.as<std::int32_t>();
        for (auto z = out.box.lower.z; z < out.box.upper.z; ++z)
            for (auto y = out.box.lower.y; y < out.box.upper.y; ++y)
                for (auto x = out.box.lower.x; x < out.box.upper.x; ++x) b(x, y, z) = a(2 * x, 2 * y, 2 * z);
    }
};

/// Lets a volume pass forward only, as a pipe does; going back is an error.
class ForwardOnly : public SourceDecorator {
public:
    using SourceDecorator::SourceDecorator;
    bool next_volume() override {
        z_ = y_ = 0;
        return inner().next_volume();
    }
    Access access() const override { return Access::forward; }
    void read(AnyView out) override {
        advance(out.box);
        inner().read(out);
    }
    std::optional<ConstView> borrow(Box const&) override { return std::nullopt; } // asking is allowed

private:
    void advance(Box const& region) {
        bool const rows = region.lower.y > 0 && region.dims().z == 1;
        if (region.lower.z < z_ || (rows && region.lower.z == z_ && region.lower.y < y_))
            throw Error(ErrorKind::failure, "a forward source was asked to go back");
        z_ = region.lower.z;
        y_ = rows ? region.upper.y : 0;
    }
    std::int64_t z_ = 0, y_ = 0;
};

Volume random_volume(Index3 dims, unsigned seed) {
    Header header;
    header.dims = dims;
    header.dtype = DataType::int32;
    Volume volume(header);
    std::mt19937 random(seed);
    auto* voxels = reinterpret_cast<std::uint32_t*>(volume.mutable_view().data);
    for (std::int64_t i = 0; i < header.voxels(); ++i) voxels[i] = static_cast<std::uint32_t>(random());
    return volume;
}

std::vector<std::unique_ptr<Operation>> random_chain(std::mt19937& random) {
    std::vector<std::unique_ptr<Operation>> chain;
    auto const pick = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
    int const length = 1 + pick(4);
    for (int i = 0; i < length; ++i) {
        switch (pick(5)) {
        case 0:
            chain.push_back(
                std::make_unique<BoxSum>(Index3{pick(3), pick(3), pick(9)}, static_cast<Boundary>(pick(4))));
            break;
        case 1:
            chain.push_back(std::make_unique<FlipZ>());
            break;
        case 2:
            chain.push_back(std::make_unique<SubtractMinimum>());
            break;
        case 3:
            chain.push_back(std::make_unique<Halve>());
            break;
        default:
            chain.push_back(nullptr); // a cut: needs the dims that arrive there
        }
    }
    return chain;
}

Volume run_chain(Volume const& input, std::vector<std::unique_ptr<Operation>>& chain, Execution const& execution,
                 bool forward) {
    std::unique_ptr<Source> source = volume_source({input});
    if (forward) source = std::make_unique<ForwardOnly>(std::move(source));
    for (auto& operation : chain) {
        std::vector<std::unique_ptr<Source>> inputs;
        inputs.push_back(std::move(source));
        source = attach(std::move(inputs), *operation, execution, {});
    }
    EXPECT_TRUE(source->next_volume());
    Header const header = source->header();
    Volume volume(header);
    for_each_piece(box_of(header.dims), cut_of(header, 0, execution),
                   [&](Box const& piece) { source->read(volume.mutable_view().part(piece)); });
    source->finish();
    EXPECT_FALSE(source->next_volume());
    return volume;
}

std::string names_of(std::vector<std::unique_ptr<Operation>> const& chain) {
    std::string names;
    for (auto const& operation : chain) names += std::string(operation->name()) + ", ";
    return names;
}

TEST(Engine, ChainsDoNotDependOnSlabsSourcesOrBudgets) {
    std::mt19937 random(7);
    for (int trial = 0; trial < 120; ++trial) {
        Index3 const dims{1 + static_cast<int>(random() % 6), 1 + static_cast<int>(random() % 5),
                          1 + static_cast<int>(random() % 17)};
        Volume const input = random_volume(dims, static_cast<unsigned>(random()));
        auto chain = random_chain(random);
        Index3 n = dims;
        for (auto& operation : chain) {
            if (!operation) {
                Box const box{{n.x / 3, n.y / 3, n.z / 3}, {n.x, n.y, std::max(n.z / 3 + 1, n.z - 1)}};
                operation = std::make_unique<CutOut>(box);
                n = box.dims();
            } else if (operation->name() == "halve") {
                n = {(n.x + 1) / 2, (n.y + 1) / 2, (n.z + 1) / 2};
            }
        }
        Execution whole;
        whole.slab = 1000;
        Volume const expected = run_chain(input, chain, whole, false);
        for (std::int64_t slab : {1, 2, 3, 7, 100}) {
            for (bool forward : {false, true}) {
                for (std::size_t memory : {std::size_t{1} << 30, std::size_t{64}}) { // the latter spools to a file
                    Execution execution;
                    execution.slab = slab;
                    execution.memory = memory;
                    Volume const got = run_chain(input, chain, execution, forward);
                    ASSERT_EQ(got.header().dims, expected.header().dims);
                    ASSERT_EQ(std::memcmp(got.view().data, expected.view().data, expected.header().bytes()), 0)
                        << "trial " << trial << " of " << names_of(chain) << " slab " << slab << " forward " << forward
                        << " memory " << memory;
                }
            }
        }
    }
}

/// Hands on, and counts the slices that are asked for at once at most.
class Watched : public SourceDecorator {
public:
    Watched(std::unique_ptr<Source> source, std::size_t& most) : SourceDecorator(std::move(source)), most_(most) {}
    void read(AnyView out) override {
        most_ = std::max(most_, out.bytes());
        inner().read(out);
    }
    std::optional<ConstView> borrow(Box const&) override { return std::nullopt; }

private:
    std::size_t& most_;
};

TEST(Engine, RowsOfLargeSlicesGiveTheSameAndAskForLittle) {
    Volume const input = random_volume({64, 1100, 7}, 5); // slices of 275 KiB, of which the least budget allows 256
    auto const chains = [](int i) {
        std::vector<std::unique_ptr<Operation>> chain;
        if (i == 0 || i == 3) chain.push_back(std::make_unique<BoxSum>(Index3{1, 1, 6}, Boundary::mirror));
        if (i == 1 || i == 4) chain.push_back(std::make_unique<SubtractMinimum>());
        if (i == 2 || i == 3) chain.push_back(std::make_unique<FlipZ>());
        if (i == 4) chain.push_back(std::make_unique<BoxSum>(Index3{0, 2, 1}, Boundary::wrap));
        if (i == 5) chain.push_back(std::make_unique<CutOut>(Box{{3, 7, 1}, {60, 1093, 6}}));
        if (i == 6) chain.push_back(std::make_unique<Halve>());
        return chain;
    };
    for (int i = 0; i < 7; ++i) {
        auto chain = chains(i);
        Volume const expected = run_chain(input, chain, {}, false);
        Execution small;
        small.memory = 1;
        for (bool forward : {false, true}) {
            Volume const got = run_chain(input, chain, small, forward);
            ASSERT_EQ(std::memcmp(got.view().data, expected.view().data, expected.header().bytes()), 0)
                << i << " forward " << forward;
        }
        std::size_t most = 0;
        std::vector<std::unique_ptr<Source>> inputs;
        inputs.push_back(std::make_unique<Watched>(volume_source({input}), most));
        auto const source = attach(std::move(inputs), *chain.front(), small, {});
        ASSERT_TRUE(source->next_volume());
        Volume result(source->header());
        source->read(result.mutable_view());
        EXPECT_LE(most, std::size_t{2} << 20) << i;
    }
}

TEST(Engine, LinesOfASpoolGiveTheSameAndAskForLittle) {
    // Slabs; slices, and lines along z of a row, beyond the least budget.
    for (Index3 const dims : {Index3{90, 110, 140}, Index3{700, 1100, 3}, Index3{1000, 3, 1200}}) {
        Volume const input = random_volume(dims, 7);
        for (Box const& region : {box_of(dims), Box{{7, 1, 1}, {dims.x - 9, dims.y - 1, dims.z - 1}}}) {
            LineSums sums(region);
            Execution plenty;
            plenty.memory = std::size_t{1} << 30;
            Volume const expected = apply(sums, {input}, plenty);
            EXPECT_EQ(sums.passes(), 3);
            Execution small;
            small.memory = 1;
            std::size_t most = 0;
            std::vector<std::unique_ptr<Source>> inputs;
            inputs.push_back(std::make_unique<Watched>(volume_source({input}), most));
            auto const source = attach(std::move(inputs), sums, small, {});
            ASSERT_TRUE(source->next_volume());
            Volume result(source->header());
            source->read(result.mutable_view());
            EXPECT_GT(sums.passes(), 3);
            EXPECT_LE(most, std::size_t{2} << 20);
            EXPECT_LE(sums.largest(), std::size_t{2} << 20);
            EXPECT_EQ(std::memcmp(result.view().data, expected.view().data, expected.header().bytes()), 0) << dims.x;
        }
    }
}

TEST(Engine, WhatNoCutCanKeepIsRefusedBeforeItBegins) {
    Volume const input = random_volume({1 << 20, 2, 2}, 5); // rows of 4 MiB
    Execution least;
    least.memory = 1;
    EXPECT_THROW(cut_of(input.header(), 0, least), Error);
    // One row of the result needs most of the rows of all slices.
    BoxSum wide({0, 200, 20}, Boundary::mirror);
    std::size_t most = 0;
    std::vector<std::unique_ptr<Source>> inputs;
    inputs.push_back(std::make_unique<Watched>(volume_source({random_volume({64, 400, 40}, 6)}), most));
    auto const source = attach(std::move(inputs), wide, least, {});
    try {
        source->next_volume();
        FAIL();
    } catch (Error const& e) {
        EXPECT_EQ(e.kind(), ErrorKind::resources);
    }
    EXPECT_EQ(most, 0u);
}

TEST(Engine, BordersAreThoseOfTheRule) {
    Volume const input = random_volume({5, 4, 3}, 1);
    auto const a = input.view().as<std::int32_t>();
    for (auto boundary : {Boundary::mirror, Boundary::clamp, Boundary::wrap, Boundary::border}) {
        for (std::int64_t radius : {1, 4, 13}) { // also far beyond the volume
            BoxSum sum({radius, radius, radius}, boundary);
            Execution execution;
            execution.slab = 2;
            Volume const got = apply(sum, {input}, execution);
            auto const b = got.view().as<std::int32_t>();
            std::uint32_t expected = 0;
            Index3 const p{4, 0, 2};
            for (auto k = -radius; k <= radius; ++k)
                for (auto j = -radius; j <= radius; ++j)
                    for (auto i = -radius; i <= radius; ++i) {
                        auto const x = fold(p.x + i, 5, boundary);
                        auto const y = fold(p.y + j, 4, boundary);
                        auto const z = fold(p.z + k, 3, boundary);
                        std::int32_t const v = x < 0 || y < 0 || z < 0 ? 3 : a(x, y, z);
                        expected +=
                            static_cast<std::uint32_t>(v) * static_cast<std::uint32_t>(1 + i * i + 3 * j + 5 * k);
                    }
            EXPECT_EQ(static_cast<std::uint32_t>(b(p.x, p.y, p.z)), expected)
                << static_cast<int>(boundary) << " " << radius;
        }
    }
}

TEST(Engine, FoldRepeatsAsOftenAsNeeded) {
    // Step by step from inside.
    for (std::int64_t n = 1; n <= 5; ++n) {
        for (bool const up : {true, false}) {
            std::int64_t mirrored = up ? n - 1 : 0, way = up ? 1 : -1;
            for (std::int64_t k = 1; k <= 40; ++k) {
                if (std::int64_t const next = mirrored + way; next < 0 || next >= n)
                    way = -way; // the voxel at the end counts twice
                else
                    mirrored = next;
                std::int64_t const at = up ? n - 1 + k : -k;
                EXPECT_EQ(fold(at, n, Boundary::mirror), mirrored) << at << " of " << n;
                EXPECT_EQ(fold(at, n, Boundary::wrap), up ? (k - 1) % n : n - 1 - (k - 1) % n) << at << " of " << n;
                EXPECT_EQ(fold(at, n, Boundary::clamp), up ? n - 1 : 0);
                EXPECT_EQ(fold(at, n, Boundary::border), -1);
            }
        }
    }
    EXPECT_EQ(fold(-1, 4, Boundary::mirror), 0);
    EXPECT_EQ(fold(4, 4, Boundary::mirror), 3);
    EXPECT_EQ(fold(-9, 4, Boundary::mirror), 0);
    EXPECT_EQ(fold(100, 1, Boundary::mirror), 0);
    EXPECT_EQ(fold(-5, 4, Boundary::wrap), 3);
    EXPECT_EQ(fold(9, 4, Boundary::clamp), 3);
    EXPECT_EQ(fold(-1, 4, Boundary::border), -1);
}

/// Slices that nobody asks for are passed over; what was read ahead beyond them is asked for next.
TEST(Prefetch, ForwardSourcesMayBeAskedWithGaps) {
    Volume const input = random_volume({16, 8, 90}, 4);
    for (std::int64_t const slab : {1, 2, 3, 4}) {
        for (std::int64_t const step : {1, 5, 7, 11, 30}) {
            Execution execution;
            execution.slab = slab;
            auto const source = prefetch(std::make_unique<ForwardOnly>(volume_source({input})), execution);
            ASSERT_TRUE(source->next_volume());
            source->expect(box_of(input.header().dims));
            for (std::int64_t z = 3; z < 90; z += step) {
                Box slice = box_of(input.header().dims);
                slice.lower.z = z, slice.upper.z = z + 1;
                Volume result(input.header());
                source->read(result.mutable_view().part(slice));
                EXPECT_EQ(std::memcmp(result.view().part(slice).data, input.view().part(slice).data, 16 * 8 * 4), 0)
                    << z;
                if (z == 3) std::this_thread::sleep_for(std::chrono::milliseconds(5)); // time enough to read ahead
            }
        }
    }
}

/// What a consumer expects it may say more than once before it asks. What was read ahead meanwhile would be gone.
TEST(Prefetch, ForwardSourcesMayBeExpectedTwice) {
    Volume const input = random_volume({16, 8, 64}, 3);
    Execution execution;
    execution.slab = 2;
    auto const source = prefetch(std::make_unique<ForwardOnly>(volume_source({input})), execution);
    ASSERT_TRUE(source->next_volume());
    Box const whole = box_of(input.header().dims);
    for (int i = 0; i < 3; ++i) {
        source->expect(whole);
        std::this_thread::sleep_for(std::chrono::milliseconds(20)); // time enough to read ahead
    }
    Volume result(input.header());
    for (std::int64_t z = 0; z < whole.upper.z; z += 2) {
        Box slab = whole;
        slab.lower.z = z, slab.upper.z = z + 2;
        source->read(result.mutable_view().part(slab));
    }
    source->finish();
    EXPECT_EQ(std::memcmp(result.view().data, input.view().data, input.header().bytes()), 0);
}

TEST(Engine, LoadRefusesWhatExceedsTheBudget) {
    auto const source = volume_source({random_volume({8, 8, 8}, 2)});
    source->next_volume();
    Execution execution;
    execution.memory = 100;
    try {
        load(*source, execution);
        FAIL();
    } catch (Error const& e) {
        EXPECT_EQ(e.kind(), ErrorKind::resources);
    }
}

} // namespace
