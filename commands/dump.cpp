// vkt dump: the values of a volume as text.
// SPDX-License-Identifier: MIT
#include "shell/dump.h"

namespace vkt::shell {

Command dump_command() {
    Command c;
    c.texts = {"Print the values of a volume as text.",
               "Physical values with one decimal, slice by slice, in volkit's layout. For numbers to compute with, "
               "write a format "
               "such as NRRD instead; for a summary use vkt stats.",
               {{"A corner of a volume", "vkt make ramp --dims 8 8 8 | vkt dump --roi 0:4,0:2,0:2"},
                {"The same in volkit's spelling", "vkt make ramp --dims 8 8 8 | vkt dump --first 0 0 0 --last 4 2 2"}}};
    c.consumer = [] { return std::make_unique<Dump>(false); };
    return c;
}

} // namespace vkt::shell
