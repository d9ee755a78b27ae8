// vkt make: see libvkt/operations/voxels/make.h and libvkt/operations/trees/make_amr.cpp.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command make_command() {
    Command c;
    c.texts = {"Make a test volume.",
               "The same bytes on every machine, whatever the threads and slabs. Values given are stored values.",
               {{"Noise", "vkt make noise --dims 64 48 32 --dtype uint8 --seed 7 | vkt stats"},
                {"A soft ball", "vkt make sphere --dims 64 64 64 --edge coverage | vkt stats"}}};
    c.verbs = methods_of("make");
    return c;
}

} // namespace vkt::shell
