// Bands of rows that several GPUs draw: every row of a part is one GPU's, and no other row anybody's.
// SPDX-License-Identifier: MIT
#include "libvkt/render/device.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <vector>

using namespace vkt::render;

TEST(RenderBands, EveryRowIsDrawnOnce) {
    for (int const first : {0, 5, 16})
        for (int const rows : {0, 1, 15, 16, 17, 100, 177, 1024})
            for (int const gpus : {1, 2, 3, 8}) {
                std::vector<int> drawn(static_cast<std::size_t>(first + rows + 64));
                for (int gpu = 0; gpu < gpus; ++gpu) {
                    Bands const bands{{0, first, 10, first + rows}, gpu, gpus};
                    for (int band = 0; band < bands.count(); ++band)
                        for (int y = bands.row(band);
                             y < std::min(bands.row(band) + Bands::rows_of_band, bands.part.y1); ++y)
                            ++drawn[static_cast<std::size_t>(y)];
                }
                for (int y = 0; y < static_cast<int>(drawn.size()); ++y)
                    EXPECT_EQ(drawn[static_cast<std::size_t>(y)], y >= first && y < first + rows ? 1 : 0)
                        << y << " of " << rows << " from " << first << ", " << gpus << " GPUs";
            }
}
