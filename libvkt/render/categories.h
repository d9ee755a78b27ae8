// Volumes of labels as categories: whether they are drawn so, which labels are there, and how each is shown.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/lattice.h"
#include "libvkt/render/render.h"

#include <memory>
#include <string>
#include <vector>

namespace vkt::render {

/// Whether these settings draw a volume with this header as labels: marched or by surfaces, without a transfer function
/// or iso-values of the user's own, and asked for or said by the header.
bool draws_labels(RenderSettings const& settings, Header const& header);

/// The labels of a volume but 0, in ascending order: for people, and for rays by sampled value.
struct Categories {
    std::shared_ptr<std::vector<ShownLabel> const> shown;
    std::vector<IsoView> views;
    float nothing = 0;   ///< the sampled value of 0
    std::string why_not; ///< what is there instead of labels; empty: labels are
};

/// Looks at every voxel once. Labels are whole numbers, at most 2^20 different ones, and within 2^24 of 0.
Categories categories_of(Lattice const& lattice, Header const& header, int threads);

} // namespace vkt::render
