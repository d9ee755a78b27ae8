// Operations on hierarchical volumes: one level equals the structured result, levels see each other, refusals.
// SPDX-License-Identifier: MIT
#include "amr_helper.h"

#include "libvkt/amr/edit.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/registry.h"
#include "libvkt/engine/tree_run.h"
#include "libvkt/operations/statistics/statistics.h"

using namespace amr_test;

namespace {

/// Mean over a box of radius 2 that is not cubic; enough of an operation to show what a brick sees.
class BoxMean : public Operation {
public:
    explicit BoxMean(Boundary boundary) : boundary_(boundary) {}
    std::string_view name() const override { return "box-mean"; }
    Shape shape() const override { return Shape::neighbourhood; }
    Plan plan(std::span<Header const> inputs) const override {
        Plan plan;
        plan.output = inputs[0];
        plan.boundary = boundary_;
        plan.border_value = 3;
        return plan;
    }
    void begin(std::span<Header const> inputs, Plan const&) override {
        spacings.push_back(inputs[0].geometry.spacing.x);
    }
    Box footprint(Box const& output, int) const override { return grow(output, {2, 1, 2}); }
    void run(std::span<ConstView const> inputs, AnyView out, Execution const&) override {
        View<float const> const in = inputs[0].as<float>();
        View<float> const to = out.as<float>();
        for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; ++z)
            for (std::int64_t y = out.box.lower.y; y < out.box.upper.y; ++y)
                for (std::int64_t x = out.box.lower.x; x < out.box.upper.x; ++x) {
                    float sum = 0;
                    for (std::int64_t k = -2; k <= 2; ++k)
                        for (std::int64_t j = -1; j <= 1; ++j)
                            for (std::int64_t i = -2; i <= 2; ++i) sum += in(x + i, y + j, z + k);
                    to(x, y, z) = sum / 75;
                }
    }
    std::vector<double> spacings;

private:
    Boundary boundary_;
};

/// Adds all inputs; knows positions or not.
class Sum : public Operation {
public:
    Sum(int inputs, bool positions) : inputs_(inputs), positions_(positions) {}
    std::string_view name() const override { return "sum"; }
    Shape shape() const override { return Shape::pointwise; }
    int inputs() const override { return inputs_; }
    bool uses_position() const override { return positions_; }
    Plan plan(std::span<Header const> inputs) const override {
        Plan plan;
        plan.output = inputs[0];
        return plan;
    }
    void enter_level(Index3 width, Index3) override { width_ = width; }
    void run(std::span<ConstView const> inputs, AnyView out, Execution const&) override {
        ++calls;
        for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; ++z)
            for (std::int64_t y = out.box.lower.y; y < out.box.upper.y; ++y)
                for (std::int64_t x = out.box.lower.x; x < out.box.upper.x; ++x) {
                    // With positions: the x of the cell's centre in finest cells.
                    float sum = positions_ ? (static_cast<float>(x) + 0.5f) * static_cast<float>(width_.x) : 0.0f;
                    for (ConstView const& in : inputs) sum += in.as<float>()(x, y, z);
                    out.as<float>()(x, y, z) = sum;
                }
    }
    int calls = 0;

private:
    int inputs_;
    bool positions_;
    Index3 width_;
};

/// Weighted and plain mean.
class Mean : public Operation {
public:
    std::string_view name() const override { return "mean"; }
    Shape shape() const override { return Shape::reduction; }
    bool uses_position() const override { return false; }
    Plan plan(std::span<Header const>) const override { return {}; }
    void enter_level(Index3 width, Index3) override { weight_ = static_cast<double>(width.x * width.y * width.z); }
    void scan(ConstView slab, Execution const&) override {
        View<float const> const in = slab.as<float>();
        for (std::int64_t z = slab.box.lower.z; z < slab.box.upper.z; ++z)
            for (std::int64_t y = slab.box.lower.y; y < slab.box.upper.y; ++y)
                for (std::int64_t x = slab.box.lower.x; x < slab.box.upper.x; ++x) {
                    sum += weight_ * static_cast<double>(in(x, y, z));
                    weight += weight_;
                    cells += 1;
                }
    }
    void run(std::span<ConstView const>, AnyView, Execution const&) override {}
    double sum = 0, weight = 0, cells = 0;

private:
    double weight_ = 1;
};

AmrRecipe uniform_recipe() {
    AmrRecipe recipe = small_recipe();
    recipe.coarsest = recipe.finest;
    recipe.blocks = 0;
    return recipe;
}

// One level in bricks gives, bit for bit, what the whole grid gives, under every boundary rule.
TEST(AmrApply, OneLevelEqualsTheStructuredVolume) {
    Volume const tree = make_amr(uniform_recipe(), execution());
    ASSERT_GT(tree.bricks().size(), 50u);
    Volume const grid =
        reconstruct(tree, whole_grid(tree, tree.header().dims), Reconstruction::nearest, 0, execution());
    for (Boundary const boundary : {Boundary::mirror, Boundary::clamp, Boundary::wrap, Boundary::border}) {
        BoxMean a(boundary), b(boundary);
        Volume const by_brick = apply_hierarchical(a, {tree}, execution());
        Volume const whole = apply(b, {grid}, execution());
        Volume const back =
            reconstruct(by_brick, whole_grid(tree, tree.header().dims), Reconstruction::nearest, 0, execution());
        EXPECT_EQ(values_of<float>(back), values_of<float>(whole)) << static_cast<int>(boundary);
    }
}

// Where volume and result have no room a window of bricks does, whether they can be read again or come once only.
TEST(AmrApply, WindowsOfBricksGiveTheSameBits) {
    AmrRecipe recipe = small_recipe();
    recipe.block = {16, 16, 16};
    recipe.blocks = 150;
    Volume const tree = make_amr(recipe, execution());
    Execution scarce = execution();
    scarce.memory = std::size_t{4} << 20;
    ASSERT_GT(2 * tree.header().bytes(), scarce.memory);
    BoxMean expected(Boundary::mirror);
    std::vector<float> const values = values_of<float>(apply_hierarchical(expected, {tree}, execution()));
    for (BrickOrder const order : {BrickOrder::any, BrickOrder::ascending}) {
        auto const source = std::make_shared<BrickSequence>(tree);
        std::size_t next = 0;
        BrickSequence bricks(
            tree.header(), tree.bricks(),
            [&](std::size_t first, std::size_t count, std::byte* to) {
                EXPECT_TRUE(order == BrickOrder::any || first >= next);
                next = first + count;
                source->read(first, count, to);
            },
            order);
        BoxMean mean(Boundary::mirror);
        std::vector<BrickSequence> inputs;
        inputs.push_back(std::move(bricks));
        TreeRun run(mean, std::move(inputs), scarce);
        BrickSequence result = run.bricks(run.plan().output);
        EXPECT_FALSE(result.in_memory());
        EXPECT_EQ(values_of<float>(std::move(result).whole()), values);
    }
}

// Constants stay constant across levels, linear fields stay linear away from level boundaries.
TEST(AmrApply, NeighbourhoodsSeeAcrossLevels) {
    Volume const constant = make_amr(small_recipe(AmrField::constant), execution());
    BoxMean mean(Boundary::mirror);
    for (float const v : values_of<float>(apply_hierarchical(mean, {constant}, execution()))) ASSERT_NEAR(v, 1, 1e-6);
    // Begun once a level, with the level's own spacing.
    ASSERT_EQ(static_cast<int>(mean.spacings.size()),
              static_cast<int>(summarise(constant.header().dims, constant.bricks()).levels.size()));
    for (std::size_t i = 1; i < mean.spacings.size(); ++i) EXPECT_EQ(mean.spacings[i], 2 * mean.spacings[i - 1]);

    Volume const linear = make_amr(small_recipe(AmrField::linear), execution());
    Volume const smooth = apply_hierarchical(mean, {linear}, execution());
    EXPECT_EQ(smooth.bricks(), linear.bricks());
    // Without ghost cells the error at brick faces would be a cell's step, 6 / 24 and more on coarse levels.
    double worst = 0;
    std::int64_t inner = 0;
    for (std::size_t b = 0; b < linear.bricks().size(); ++b) {
        Box const box = bounds_of(linear.bricks()[b], linear.header().dims);
        std::int64_t const margin = 2 * linear.bricks()[b].cell_width();
        if (!box_of(linear.header().dims).contains(grow(box, {margin, margin, margin}))) continue;
        ++inner;
        ConstView const before = linear.brick_view(b), after = smooth.brick_view(b);
        for (std::int64_t i = 0; i < linear.bricks()[b].cells(); ++i)
            worst = std::max(worst, std::abs(static_cast<double>(before.as<float>().data[i]) -
                                             static_cast<double>(after.as<float>().data[i])));
    }
    EXPECT_GT(inner, 10);
    EXPECT_LT(worst, 0.06);
}

// Fine cells beside a hole see the background in it, also where it is within reach of a coarse cell.
TEST(AmrApply, NeighbourhoodsSeeTheBackgroundInHoles) {
    Index3 const dims{32, 32, 32};
    Volume tree = make_tree(dims, {{{8, 8, 8}, {8, 8, 8}, 0}, {{16, 8, 8}, {1, 1, 1}, 3}}, [](Vec3) { return 1; });
    tree.header().attributes["background"] = "-2";
    Volume const grid = reconstruct(tree, whole_grid(tree, dims), Reconstruction::nearest, -2, execution());
    BoxMean a(Boundary::clamp), b(Boundary::clamp);
    Volume const by_brick = apply_hierarchical(a, {tree}, execution()), whole = apply(b, {grid}, execution());
    View<float const> const got = by_brick.brick_view(0).as<float>(), want = whole.view().as<float>();
    for (std::int64_t z = 0; z < 8; ++z)
        for (std::int64_t y = 0; y < 8; ++y)
            for (std::int64_t x = 0; x < 8; ++x)
                ASSERT_NEAR(got.data[(z * 8 + y) * 8 + x], want(x + 8, y + 8, z + 8), 1e-6) << x << y << z;
}

TEST(AmrApply, PointwiseRunsOnEqualTreesWithOrWithoutPositions) {
    Volume const tree = make_amr(small_recipe(AmrField::linear), execution());
    Sum plain(2, false);
    Volume const twice = apply_hierarchical(plain, {tree, tree}, execution());
    EXPECT_EQ(twice.header().kind, Kind::hierarchical);
    EXPECT_EQ(twice.bricks(), tree.bricks());
    for (std::int64_t i = 0; i < tree.header().cell_count; ++i)
        ASSERT_EQ(cells_of<float>(twice)[i], 2 * cells_of<float>(tree)[i]);
    EXPECT_LE(plain.calls, 3); // long rows, not bricks

    Sum positioned(1, true);
    Volume const zero = make_tree(tree.header().dims, tree.bricks().list(), [](Vec3) { return 0; });
    Volume const positions = apply_hierarchical(positioned, {zero}, execution());
    Volume const expected = make_tree(tree.header().dims, tree.bricks().list(), [](Vec3 p) { return p.x; });
    EXPECT_EQ(values_of<float>(positions), values_of<float>(expected));

    Volume const other = make_amr(uniform_recipe(), execution());
    EXPECT_THROW(apply_hierarchical(plain, {tree, other}, execution()), Error);
}

TEST(AmrApply, ReductionsWeightByCellVolume) {
    Volume const tree = make_amr(small_recipe(AmrField::linear), execution());
    Mean mean;
    reduce_hierarchical(mean, tree, execution());
    EXPECT_EQ(mean.weight, 96.0 * 32 * 24);
    EXPECT_EQ(mean.cells, static_cast<double>(tree.header().cell_count));
    EXPECT_NEAR(mean.sum / mean.weight, 3, 1e-5); // the mean of x + 2 y + 3 z over the domain
}

// Whatever an operation makes of nothing, or of one cell, it is a volume or a refusal.
TEST(AmrApply, TreesWithoutBricksAndOfOneCell) {
    std::vector<std::vector<std::string>> const commands{{"filter", "gaussian", "--sigma", "1"},
                                                         {"filter", "gaussian", "--sigma", "1", "--boundary", "wrap"},
                                                         {"filter", "gaussian", "--sigma", "0"},
                                                         {"flip", "x"},
                                                         {"arith", "add", "-", "1"},
                                                         {"arith", "add", "-", "-"},
                                                         {"convert", "--dtype", "uint8"},
                                                         {"fill", "--value", "3"},
                                                         {"fill", "--value", "3", "--roi", "0:1,:,:"},
                                                         {"set", "--units", "K"},
                                                         {"resample", "--dims", "3", "3", "3"},
                                                         {"resample", "--dims", "3", "3", "3", "--method", "nearest"},
                                                         {"resample", "--dims", "3", "3", "3", "--method", "average"},
                                                         {"resample", "--dims", "3", "3", "3", "--method", "auto"},
                                                         {"resample", "--dims", "3", "3", "3", "--mask"}};
    Volume const empty = make_tree({16, 16, 16}, {}, [](Vec3) { return 0; });
    Volume const cell = make_tree({1, 1, 1}, {{{0, 0, 0}, {1, 1, 1}, 0}}, [](Vec3) { return 5; });
    for (auto const& words : commands) {
        bool const two = words.size() == 4 && words[3] == "-";
        std::string const said = text(words[0], " ", words[1]);
        Volume const nothing = vkt::apply(words, two ? std::vector<Volume>{empty, empty} : std::vector<Volume>{empty});
        EXPECT_EQ(nothing.header().voxels(), words[0] == "resample" ? 27 : 0) << said;
        Volume const one = vkt::apply(words, two ? std::vector<Volume>{cell, cell} : std::vector<Volume>{cell});
        EXPECT_EQ(one.header().voxels(), words[0] == "resample" ? 27 : 1) << said;
        double const want = words[0] == "fill"         ? 3
                            : words[0] == "arith"      ? (two ? 10 : 6)
                            : words.back() == "--mask" ? 1
                                                       : 5;
        if (one.header().dtype == DataType::float32) {
            EXPECT_EQ(cells_of<float>(one)[0], static_cast<float>(want)) << said;
        }
    }
    EXPECT_THROW(vkt::apply({"convert", "--range", "minmax", "--dtype", "uint8"}, {empty}), Error);
    EXPECT_THROW(vkt::apply({"crop", "--roi", "0:1,:,:"}, {empty}), Error);
    Statistics statistics;
    reduce_hierarchical(statistics, empty, execution());
    EXPECT_EQ(statistics.result().count, 0);
    EXPECT_FALSE(statistics.result().valid);
}

// The region of a cropped tree is the volume: its border is where the boundary rule begins, as on a grid, and nothing
// grows dark because bricks beyond it are gone.
TEST(AmrApply, NeighbourhoodsEndAtTheRegion) {
    Volume const tree = make_amr(uniform_recipe(), execution());
    Box const region{{21, 5, 3}, {62, 22, 21}};
    Volume const part = crop_tree(tree, region).whole();
    ASSERT_LT(part.bricks().size(), tree.bricks().size());
    for (Boundary const boundary : {Boundary::mirror, Boundary::clamp, Boundary::wrap, Boundary::border}) {
        BoxMean a(boundary), b(boundary);
        auto const grid = [&](Volume const& volume) {
            return reconstruct(volume, whole_grid(volume, region.dims()), Reconstruction::nearest, 0, execution());
        };
        Volume const smooth = apply_hierarchical(a, {part}, execution());
        EXPECT_EQ(values_of<float>(grid(smooth)), values_of<float>(apply(b, {grid(part)}, execution())));
    }
}

// What holds the background and what is left out are the same thing, also after arithmetic.
TEST(AmrApply, HolesFollowPointwiseOperations) {
    Volume tree = make_tree({16, 8, 8}, {{{0, 0, 0}, {8, 8, 8}, 0}}, [](Vec3 p) { return p.x < 4 ? 2 : -1; });
    tree.header().attributes["background"] = "-1";
    for (std::vector<std::string> const& words :
         {std::vector<std::string>{"arith", "mul", "-", "3"},
          {"arith", "add", "-", "-"},
          {"fill", "--value", "7"},
          {"convert", "--dtype", "int16", "--range", "-1:2", "--to", "10:40"}}) {
        bool const two = words.back() == "-";
        std::vector<Volume> const trees(two ? 2 : 1, tree);
        std::vector<Volume> grids;
        for (Volume const& each : trees)
            grids.push_back(reconstruct(each, whole_grid(each, {16, 8, 8}), Reconstruction::nearest, -1, execution()));
        Volume const gridded = vkt::apply({"resample", "--method", "nearest"}, {vkt::apply(words, trees)});
        Volume const expected = vkt::apply(words, grids);
        ASSERT_EQ(gridded.header().bytes(), expected.header().bytes());
        EXPECT_EQ(std::memcmp(gridded.buffer().read(Space::host), expected.buffer().read(Space::host),
                              expected.header().bytes()),
                  0)
            << words[1];
    }
}

TEST(AmrApply, RefusalsNameTheWayOut) {
    class Moving : public Sum {
    public:
        Moving() : Sum(1, true) {}
        Shape shape() const override { return Shape::geometric; }
    } moving;
    Volume const tree = make_amr(small_recipe(), execution());
    try {
        apply_hierarchical(moving, {tree}, execution());
        FAIL() << "a geometric operation without a form for trees ran";
    } catch (Error const& error) {
        EXPECT_EQ(error.kind(), ErrorKind::usage);
        EXPECT_NE(error.hint().find("vkt resample"), std::string::npos);
    }
}

} // namespace
