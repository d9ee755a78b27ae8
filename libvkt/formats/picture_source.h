// Pictures as volumes of one slice: PGM and PPM, PFM, OpenEXR. (PNG is beside its writer.)
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/format.h"

namespace vkt {

bool is_pgm(std::span<std::byte const> head);
/// Grey or in colours, binary or text, 8 or 16 bits; colours are a volume each. Throws Error{data}.
std::unique_ptr<Source> open_pgm(std::unique_ptr<ByteSource> bytes, ReadOptions const& options);
/// One plane, or red, green and blue as a volume each. Throws Error{data}.
std::unique_ptr<Source> open_pfm(std::unique_ptr<ByteSource> bytes, ReadOptions const& options);
/// Every channel is a volume, which the attribute "channel" names; --variable takes one. Throws Error{data}, and
/// Error{failure} without OpenEXR.
std::unique_ptr<Source> open_exr(std::unique_ptr<ByteSource> bytes, ReadOptions const& options);

} // namespace vkt
