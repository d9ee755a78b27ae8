// Arithmetic of two volumes, or of a volume and a number.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/engine/tunable.h"
#include "libvkt/operations/common/level_region.h"
#include "libvkt/operations/common/number.h"
#include "libvkt/operations/common/remarks.h"

#include <array>

namespace vkt {

struct ArithmeticTask;

enum class ArithmeticOp : std::uint8_t {
    add,
    sub,
    mul,
    div,
    min,
    max,
    absdiff,
    pow,
    gt,
    ge,
    lt,
    le,
    eq,
    ne,
    and_,
    or_,
    not_,
    abs,
    neg,
    sqrt,
    exp,
    log,
    clamp,
    where,
};
template <> struct EnumNames<ArithmeticOp> {
    static std::vector<std::pair<ArithmeticOp, char const*>> all() {
        using enum ArithmeticOp;
        return {{add, "add"},         {sub, "sub"},   {mul, "mul"},  {div, "div"}, {min, "min"},     {max, "max"},
                {absdiff, "absdiff"}, {pow, "pow"},   {gt, "gt"},    {ge, "ge"},   {lt, "lt"},       {le, "le"},
                {eq, "eq"},           {ne, "ne"},     {and_, "and"}, {or_, "or"},  {not_, "not"},    {abs, "abs"},
                {neg, "neg"},         {sqrt, "sqrt"}, {exp, "exp"},  {log, "log"}, {clamp, "clamp"}, {where, "where"}};
    }
};
/// Volumes and numbers that an operation takes.
int operand_count(ArithmeticOp op);
/// Yields fractions.
inline bool is_function(ArithmeticOp op) {
    return op == ArithmeticOp::pow || op == ArithmeticOp::sqrt || op == ArithmeticOp::exp || op == ArithmeticOp::log;
}
/// Yields 0 or 1.
inline bool is_predicate(ArithmeticOp op) { return op >= ArithmeticOp::gt && op <= ArithmeticOp::not_; }

/// Voxel by voxel; dims and geometry must agree. Results are of physical values, in double precision step by step,
/// where there are value maps; two volumes with equal ones keep the map, and are combined in stored values where that
/// comes to the same. Without maps results are those of real arithmetic, rounded once half to even, and saturate,
/// whatever the types; a number is the float64 nearest to it, or the whole number of up to 64 bits (between integers up
/// to 2^99) that it is. x / 0 in integers is the type's largest or smallest value by the sign of x, 0 / 0 is 0; floats
/// follow IEEE 754. min and max hand NaN on. Comparisons and logic give uint8 0 and 1; comparisons with NaN are false
/// but for ne, and NaN counts as true. pow, sqrt, exp and log give float32 or, of 32-bit and wider types, float64,
/// within two units in the last place of float64 before that is stored. where takes the second operand where the first
/// is not 0, the third elsewhere. With a region the result has the type and the value map of the first volume, whose
/// values all other voxels keep, as in transform; of comparisons and logic these are 0, as in threshold, and where
/// gives the third operand there.
class Arithmetic : public Operation, public Tunable {
public:
    ArithmeticOp op = ArithmeticOp::add;
    std::string a, b, c; ///< paths or numbers
    std::optional<DataType> dtype;
    Roi roi; ///< all other voxels keep the first volume's values; see above

    std::string_view name() const override { return "arith"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::pointwise; }
    int inputs() const override { return static_cast<int>(input_names().size()); }
    /// Paths of the operands that are volumes, in order; "-" is standard input.
    std::vector<std::string> input_names() const override;
    void parameters(Parameters& p) override;
    std::vector<Knob> knobs() const override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    void enter_level(Index3 cell_width, Index3 first) override { inside_.enter_level(cell_width, first); }
    bool uses_position() const override { return !roi.empty(); }
    bool runs_on_gpu() const override { return true; }
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    std::vector<std::int64_t*> counters() override { return counts_.counters(); }
    std::vector<Remark> remarks() const override;

private:
    enum class Algorithm : std::uint8_t { in_float, in_double, in_integers };
    struct Operand;
    bool keeps_first() const { return !roi.empty() && !is_predicate(op) && op != ArithmeticOp::where; }
    /// As many as the operation takes; the first is standard input where one is missing.
    std::vector<std::string> operands() const;
    /// In which values, and as what, results are computed.
    struct Choice {
        DataType type = DataType::uint8; ///< of the result,
        ValueMap values;                 ///< and its value map
        Algorithm algorithm = Algorithm::in_double;
        std::vector<std::optional<Number>> numbers; ///< of each operand, none for a volume
        std::array<ValueMap, 3> maps{};             ///< from stored operands to what is computed with
        ValueMap map_out;                           ///< … and back
        /// Of where: the mask is made 0 and 1 first, of what it means, since all else is computed in integers.
        std::optional<ValueMap> mask;
        bool integers = false;
        bool settles = false; ///< results are computed once more, exactly, where that may round twice
    };
    Choice choice(std::span<Header const> inputs) const;
    void choose_type(std::vector<Header const*> const& headers, Choice& choice) const;
    void choose_values(std::vector<Header const*> const& headers, Choice& choice) const;
    bool is_exact_choice(std::vector<Header const*> const& headers, Choice const& choice) const;
    bool rounds_twice(Choice const& choice, Operand const& u, Operand const& v) const;
    /// Voxels outside of the region.
    void keep(std::span<ConstView const> inputs, AnyView out, Execution const& execution);
    ArithmeticTask task() const;
    void compute(std::span<ConstView const> inputs, AnyView out, Execution const& execution);
    /// What becomes of the values and errors of the inputs goes into the plan.
    void pass(std::span<Header const> inputs, Choice const& choice, Plan& plan) const;

    Choice choice_;
    LevelRegion inside_;
    std::int64_t voxels_ = 0;
    Losses counts_;
};

/// Type of the result of two volumes: the type itself if both agree; the smallest integer type that holds both (int64
/// if there is none); with a float the wider float, at least float32 for 16-bit integers and float64 for 32-bit ones.
DataType promoted(DataType a, DataType b);

} // namespace vkt
