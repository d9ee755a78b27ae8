// vkt arith: arithmetic of two volumes, or of a volume and a number.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command arith_command() {
    return operation_command(
        "arith",
        {"Add, subtract, multiply, divide two volumes, or a volume and a number.",
         "Results saturate and are rounded half to even. Two volumes of one type give that type; else the smallest "
         "type that holds both. What is clipped or "
         "divided by zero is counted and reported.",
         {{"A volume and a number", "vkt make ramp --dims 16 16 16 | vkt arith mul - 2.5 | vkt stats"},
          {"Two volumes", "vkt make noise --dims 16 16 16 -o a.vkt && vkt make ramp --dims 16 16 16 | vkt arith sub - "
                          "a.vkt | vkt stats"}}});
}

} // namespace vkt::shell
