// Operations that do not look at their input but at what another operation makes of it, which is computed once.
// SPDX-License-Identifier: MIT
#pragma once

namespace vkt {

class Operation;

/// Beside Operation, for those whose regions overlap in an input that is costly to prepare: coefficients of splines.
class Prepared {
public:
    virtual ~Prepared() = default;

    /// After begin(): an operation on input 0, whose result the engine keeps, in memory or in a file; footprint() and
    /// run() are about that instead of the input. Null where the input is taken as it is. It must live until the next
    /// begin(), and needs no scan.
    virtual Operation* preparation() = 0;
};

} // namespace vkt
