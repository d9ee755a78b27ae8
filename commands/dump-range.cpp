// vkt dump-range: volkit's name for dump with a range.
// SPDX-License-Identifier: MIT
#include "shell/dump.h"

namespace vkt::shell {

Command dump_range_command() {
    Command c;
    c.texts = {"Print the values of a part of a volume as text.",
               "volkit's name for vkt dump with a range, which must be given.",
               {{"A corner of a volume", "vkt make ramp --dims 8 8 8 | vkt dump-range --first 0 0 0 --last 4 2 2"}}};
    c.consumer = [] { return std::make_unique<Dump>(true); };
    return c;
}

} // namespace vkt::shell
