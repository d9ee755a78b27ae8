// Numbers that options give as voxel values: whole ones exactly, also where double has no room for them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/parameters.h"
#include "libvkt/core/wide.h"

#include <array>
#include <cstddef>
#include <optional>

namespace vkt {

/// A number, and the same as an integer if it is one below 2^100.
struct Number {
    double value = 0;
    std::optional<Int128> whole = 0;

    Number() = default;
    Number(double number);
    /// Throws Error{usage} if the word is not a number.
    static Number parse(std::string_view word);
    friend bool operator==(Number const&, Number const&) = default;
};

std::string to_text(Number const& number);

template <> struct ValueText<Number> : OneWord {
    static Number read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(Number const& v) { return {to_text(v)}; }
};

/// The voxel that stores a number: halves to even, saturated, NaN to 0 in integers.
std::array<std::byte, 8> voxel_bytes(DataType type, Number const& number);
/// How far that voxel is at most from the number, in steps of the type; what is saturated is as it should be.
double storing_loss(DataType type, Number const& number);
/// True if that voxel neither saturates nor becomes infinite; NaN fits everywhere.
bool fits(DataType type, Number const& number);

} // namespace vkt
