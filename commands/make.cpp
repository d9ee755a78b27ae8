// vkt make: test fields.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/make.h"
#include "shell/command.h"

namespace vkt::shell {

Command make_command() {
    Command c;
    c.texts = {"Make a test volume.",
               "The same bytes on every machine, whatever the threads and slabs. Values given are stored values.",
               {{"Noise", "vkt make noise --dims 64 48 32 --dtype uint8 --seed 7 | vkt stats"},
                {"A soft ball", "vkt make sphere --dims 64 64 64 --edge coverage | vkt stats"}}};
    c.verbs = {
        {"checkerboard", operation_command<MakeCheckerboard>(
                             {"Make cubes of two alternating values.", "",
                              {{"Cubes of four voxels", "vkt make checkerboard --dims 32 32 32 --period 4 --dtype uint8 | vkt stats"}}})},
        {"constant", operation_command<MakeConstant>(
                         {"Make a volume of one value.", "", {{"All sevens", "vkt make constant --dims 16 16 8 --dtype uint8 --value 7 | vkt stats"}}})},
        {"marschner-lobb",
         operation_command<MakeMarschnerLobb>(
             {"Make the test signal of Marschner and Lobb.",
              "On [-1, 1] in each axis, sampled at voxel centres; with 40 voxels an axis close to the limit that the samples can hold.",
              {{"As in the paper", "vkt make marschner-lobb --dims 40 40 40 | vkt stats"}}})},
        {"noise", operation_command<MakeNoise>(
                      {"Make uniform white noise.", "Philox4x32-10, counted by voxel: any part of a volume has the same noise as the whole.",
                       {{"Bytes", "vkt make noise --dims 64 48 32 --dtype uint8 --seed 7 | vkt stats"}}})},
        {"ramp", operation_command<MakeRamp>(
                     {"Make values that rise along an axis.", "By default a voxel's value is its index.",
                      {{"From 0 to 1 along z", "vkt make ramp --dims 16 16 33 --axis z --last 1 | vkt stats"}}})},
        {"sphere", operation_command<MakeSphere>(
                       {"Make a ball.",
                        "With a hard edge, with each voxel's exact share inside, or as signed distance to the surface. Radius and centre count voxels.",
                        {{"A ball with soft edges", "vkt make sphere --dims 64 64 64 --radius 20 --edge coverage | vkt stats"},
                         {"Distance field", "vkt make sphere --dims 64 64 64 --edge distance | vkt stats"}}})},
    };
    return c;
}

} // namespace vkt::shell
