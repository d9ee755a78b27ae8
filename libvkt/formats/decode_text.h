// Decimal text to samples.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/decode.h"

namespace vkt {

/// See decode(). Words are as strtod reads them, plus nan and inf in any case. 64-bit integers keep all their digits;
/// fractions given for an integer type are refused.
std::unique_ptr<ByteStream> decode_text(ByteSource& bytes, DataType type);

} // namespace vkt
