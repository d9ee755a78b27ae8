// The smallest model of a volume that still makes the picture, or the result, that it is wanted for.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/volume.h"

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

namespace vkt::shell {

struct SlimRequest {
    std::string pipeline; ///< operations of one volume, perhaps up to a picture
    double within = 0;    ///< largest difference: display levels of all pictures, physical values of a volume
    Execution execution;
    std::function<void(std::string const&)> detail; ///< told of each candidate; may be empty
};

/// What a smaller type takes from one end of the values.
struct CutEnd {
    double value = 0; ///< physical: what lies further out is told as this
    double share = 0; ///< of the voxels that lie further out
};

struct SlimModel {
    Volume volume;
    std::string made;                        ///< by these stages, as for a shell; empty: nothing smaller holds
    std::size_t bytes = 0, bytes_before = 0; ///< voxels, and what bricks are told by
    std::optional<CutEnd> below, above;      ///< what the model does not hold of the volume's values
    double max_error = 0, rms_error = 0;     ///< measured, with the pipeline as it was given
    double flip = 0;                         ///< of the picture that differs most
    double seconds = 0, seconds_before = 0;  ///< of all pictures, or of the pipeline; medians
    std::int64_t pictures = 0;               ///< that were compared; 0: volumes were
    int tried = 0;
};

/// Tries models of the volume, the one of fewest bytes first: cut to what the picture shows or the operations read,
/// in a smaller type, over the range of values that matters (either end is cut off as far as that changes nothing, or
/// little of what is allowed), at a lower resolution (of operations: where their result
/// has the same voxels then); what is best of these also as a hierarchical volume. Each
/// goes through the pipeline as it was given, and the first whose result differs by at most `within` anywhere is taken;
/// of pictures a smaller one is drawn first, and a model that fails there by far is not drawn in full. Bricks are not
/// told before they are made: tolerances of a hierarchical volume are halved from coarse to fine until one holds.
/// Throws Error{usage} for pipelines that `vkt chart` refuses, and Error{resources} for volumes that take more than a
/// sixth of the memory.
SlimModel slim(Volume const& volume, SlimRequest const& request);

/// What a volume takes in memory and in files.
std::size_t model_bytes(Volume const& volume);

} // namespace vkt::shell
