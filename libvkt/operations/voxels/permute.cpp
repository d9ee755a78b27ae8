// Permute: the axes of a volume in another order, or turned towards those of the body.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/permute.h"
#include "libvkt/amr/reconstruct.h"
#include "libvkt/core/frame.h"
#include "libvkt/engine/operation.h"
#include "libvkt/kernel/border.h"
#include "libvkt/operations/voxels/flip.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace vkt {

namespace {

/// Pairs of directions along the axes of left-posterior-superior: where the coordinate grows, and where it falls.
constexpr std::string_view directions[3] = {"lr", "pa", "si"};

bool is_permutation(std::string_view order) {
    std::string sorted(order);
    std::sort(sorted.begin(), sorted.end());
    return sorted == "xyz";
}

/// The axis of the world that a letter is about, -1 if it is none.
int world_axis(char letter) {
    for (int world = 0; world < 3; ++world)
        if (directions[world].find(letter) != std::string_view::npos) return world;
    return -1;
}

bool is_orientation(std::string_view order) {
    bool seen[3] = {};
    for (char const letter : order)
        if (int const world = world_axis(letter); world >= 0) seen[world] = true;
    return order.size() == 3 && seen[0] && seen[1] && seen[2];
}

/// "zyx": the axes of the result, x first, by their names in the input. "ras": where the axes of the result point, as
/// index grows: right or left, anterior or posterior, superior or inferior, each of which an axis is chosen for and
/// reversed if need be, so that the sum of their cosines is largest. Bytes are moved, and voxels keep their world
/// positions: spacings and directions move with their axes. Axes that change places with z read slices in another
/// order.
class Permute : public Operation {
public:
    Permute() = default;
    explicit Permute(std::string order) : order_(std::move(order)) {}

    std::string_view name() const override { return "permute"; }
    Texts texts() const override {
        return {
            "Put the axes into another order, or turn them towards those of the body.",
            "zyx makes the input's z the first axis. ras reorders and reverses axes until they point right, anterior "
            "and superior as nearly as they can. Spacings and directions move along: voxels keep their world positions."
            "\n\n"
            "Accuracy: Exact: bytes are moved, world positions survive.",
            {{"Slices through what were columns", "vkt permute zyx volume.nrrd -o sagittal.nrrd"},
             {"First axis right, second anterior, third superior",
              "vkt set volume.nrrd --attribute space=LPS | vkt permute --to ras | vkt info"}}};
    }

    Shape shape() const override { return Shape::geometric; }
    void parameters(Parameters& parameters) override {
        parameters
            .positional("order", order_, "order of the axes, such as zyx, or where they are to point, such as ras")
            .alias("to");
    }

    void check() const override {
        std::string const order = lower_case(order_);
        if (!is_permutation(order) && !is_orientation(order))
            throw Error(ErrorKind::usage, text("'", order_, "' is neither an order of x, y and z nor an orientation"),
                        "say for example zyx; or ras, where letters are r or l, a or p, s or i");
    }

    /// Throws Error{usage} if the volume must be turned and does not say what its world's axes mean.
    Plan plan(std::span<Header const> inputs) const override {
        Header const& in = inputs[0];
        Turn const turn = turn_of(in);
        auto const& [axes, reversed, dims] = turn;
        Plan plan;
        plan.output = in;
        plan.output.dims = turn.permuted(in.dims);
        Geometry geometry = in.geometry;
        std::optional<Part> part = in.part;
        for (int axis = 0; axis < 3; ++axis) {
            if (!reversed[static_cast<std::size_t>(axis)]) continue;
            geometry = flipped(geometry, static_cast<Axis>(axis), in.dims[axis]);
            if (part) part->offset[axis] = part->global_dims[axis] - part->offset[axis] - in.dims[axis];
        }
        plan.output.geometry.origin = geometry.origin;
        for (std::size_t k = 0; k < 3; ++k) {
            plan.output.geometry.spacing[static_cast<int>(k)] = geometry.spacing[axes[k]];
            plan.output.geometry.direction[k] = geometry.direction[static_cast<std::size_t>(axes[k])];
        }
        if (part)
            plan.output.part = {turn.permuted(part->global_dims), turn.permuted(part->offset),
                                turn.permuted(part->halo)};
        if (in.kind == Kind::hierarchical && in.attributes.contains("roi"))
            plan.output.attributes["roi"] = to_text(turn.target(region_of(in)));
        bool const reverses = reversed[0] || reversed[1] || reversed[2];
        if (axes == std::array{0, 1, 2} && !reverses) plan.shift = Index3{};
        bool const in_order = axes[2] == 2 && !reversed[2];
        if (!in_order) plan.access = Access::random;
        // Slices of the result that are made of columns take whole cache lines of the input.
        if (axes[2] == 0) plan.slab_hint = static_cast<std::int64_t>(128 / size_of(in.dtype));
        plan.method = "permuting copy";
        plan.passing = ErrorPassing::moved(values_of(in));
        plan.cost = 0;
        return plan;
    }

    void begin(std::span<Header const> inputs, Plan const&) override { turn_ = turn_of(inputs[0]); }

    Box footprint(Box const& output, int) const override { return turn_.source(output); }

    std::optional<BrickSequence> move_bricks(BrickSequence input, Execution const& execution) override {
        Header header = plan({&input.header(), 1}).output;
        for (int axis = 0; axis < 3; ++axis)
            if (turn_.reversed[static_cast<std::size_t>(axis)])
                input = flip_tree(std::move(input), static_cast<Axis>(axis), mirrored_cells(static_cast<Axis>(axis)),
                                  execution);
        std::vector<Brick> bricks = input.bricks().list();
        for (Brick& brick : bricks) brick = {turn_.permuted(brick.lower), turn_.permuted(brick.dims), brick.level};
        return moved_tree(
            std::move(input), std::move(header), std::move(bricks),
            [this](ConstView from, std::byte* to, Execution const& on) {
                Box const box = box_of(turn_.permuted(from.box.dims()));
                permute_box(from, dense_view(to, from.type, box, on.space()), turn_.axes, {}, on);
            },
            execution);
    }

    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override {
        permute_box(inputs[0].part(turn_.source(out.box)), out, turn_.axes,
                    {turn_.reversed[0], turn_.reversed[1], turn_.reversed[2]}, execution);
    }

    bool runs_on_gpu() const override { return true; }

private:
    /// What becomes of the axes.
    struct Turn {
        std::array<int, 3> axes{0, 1, 2}; ///< axis k of the result is axis axes[k] of the input
        std::array<bool, 3> reversed{};   ///< by axes of the input
        Index3 dims;                      ///< of the input

        Index3 permuted(Index3 v) const { return {v[axes[0]], v[axes[1]], v[axes[2]]}; }
        /// The box of the input that an output box is made of, or of a tree's input, what becomes of it.
        Box source(Box const& output) const {
            Box box;
            for (std::size_t k = 0; k < 3; ++k) {
                int const axis = axes[k], own = static_cast<int>(k);
                bool const back = reversed[static_cast<std::size_t>(axis)];
                box.lower[axis] = back ? dims[axis] - output.upper[own] : output.lower[own];
                box.upper[axis] = back ? dims[axis] - output.lower[own] : output.upper[own];
            }
            return box;
        }
        Box target(Box const& input) const {
            Box box = input;
            for (int axis = 0; axis < 3; ++axis) {
                if (!reversed[static_cast<std::size_t>(axis)]) continue;
                box.lower[axis] = dims[axis] - input.upper[axis];
                box.upper[axis] = dims[axis] - input.lower[axis];
            }
            return {permuted(box.lower), permuted(box.upper)};
        }
    };
    Turn turn_of(Header const& in) const {
        std::string const order = lower_case(order_);
        if (!is_permutation(order)) return turn_towards_body(in);
        Turn turn;
        turn.dims = in.dims;
        for (std::size_t k = 0; k < 3; ++k) turn.axes[k] = order[k] - 'x';
        return turn;
    }

    Turn turn_towards_body(Header const& in) const {
        if (!is_anatomical(frame_of(in)))
            throw Error(ErrorKind::usage, "the volume does not say what the axes of its world mean",
                        "if they are those of DICOM, say so: vkt set --attribute space=LPS");
        std::array<Vec3, 3> const direction = geometry_in(lps_frame, in).direction;
        std::string const letters = lower_case(order_);
        auto const cosine = [&](std::array<int, 3> const& axes, std::size_t k) {
            return direction[static_cast<std::size_t>(axes[k])][world_axis(letters[k])];
        };
        Turn turn;
        turn.dims = in.dims;
        std::array<int, 3> axes{0, 1, 2};
        double best = -1;
        do {
            double sum = 0;
            for (std::size_t k = 0; k < 3; ++k) sum += std::abs(cosine(axes, k));
            if (sum > best + 1e-9) {
                best = sum;
                turn.axes = axes;
            }
        } while (std::next_permutation(axes.begin(), axes.end()));
        for (std::size_t k = 0; k < 3; ++k) {
            char const letter = letters[k];
            bool const falls = letter == 'r' || letter == 'a' || letter == 'i';
            turn.reversed[static_cast<std::size_t>(turn.axes[k])] = (cosine(turn.axes, k) < 0) != falls;
        }
        return turn;
    }

    std::string order_;
    Turn turn_;
};

} // namespace

VKT_OPERATION(Permute, "permute")

} // namespace vkt
