// Arithmetic of two volumes, or of a volume and a number.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"

#include "libvkt/operations/number.h"
#include "libvkt/operations/remarks.h"

#include <array>

namespace vkt {

enum class ArithmeticOp : std::uint8_t { add, sub, mul, div, min, max };
template <> struct EnumNames<ArithmeticOp> {
    static std::vector<std::pair<ArithmeticOp, char const*>> all() {
        return {{ArithmeticOp::add, "add"}, {ArithmeticOp::sub, "sub"}, {ArithmeticOp::mul, "mul"},
                {ArithmeticOp::div, "div"}, {ArithmeticOp::min, "min"}, {ArithmeticOp::max, "max"}};
    }
};

/// Voxel by voxel; dims and geometry must agree. Two volumes with equal value maps are combined in stored values,
/// keeping the map; with different maps, or with a number and a map, in physical values, in double precision step by
/// step. Without maps results are those of real arithmetic, rounded once half to even, and saturate, whatever the
/// types; a number is the float64 nearest to it, or the whole number of up to 64 bits (between integers up to 2^99)
/// that it is. x / 0 in integers is the type's largest or smallest value by the sign of x, 0 / 0 is 0; floats follow
/// IEEE. min and max hand NaN on.
class Arithmetic : public Operation {
public:
    ArithmeticOp op = ArithmeticOp::add;
    std::string a, b; ///< paths or numbers
    std::optional<DataType> dtype;

    std::string_view name() const override { return "arith"; }
    Shape shape() const override { return Shape::pointwise; }
    int inputs() const override { return static_cast<int>(operands().size()); }
    std::vector<std::string> input_names() const override { return operands(); }
    /// Paths of the operands that are volumes, in order; "-" if nothing is said yet.
    std::vector<std::string> operands() const;
    std::array<std::string, 2> both() const;
    void parameters(Parameters& p) override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) override;
    bool uses_position() const override { return false; }
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    std::vector<Remark> remarks() const override;

private:
    enum class Algorithm : std::uint8_t { in_float, in_double, in_integers };
    struct Operand;
    void choose_values(Header const& first, Header const* second, Header& output);
    bool rounds_twice(Operand const& u, Operand const& v) const;

    Algorithm algorithm_ = Algorithm::in_double;
    std::optional<Number> number_a_, number_b_;
    ValueMap map_a_, map_b_, map_out_; ///< from stored operands to what is computed with, and back
    bool integers_ = false, settles_ = false;
    std::int64_t voxels_ = 0;
    DataType type_ = DataType::uint8;
    Losses counts_;
};

/// Type of the result of two volumes: the type itself if both agree; the smallest integer type that holds both (int64
/// if there is none); with a float the wider float, at least float32 for 16-bit integers and float64 for 32-bit ones.
DataType promoted(DataType a, DataType b);

} // namespace vkt
