/* A session with volkit's names, as its paper shows one: fill a volume with grey and a region of it with white, turn the
   region, smooth the result with a Gaussian, draw it into session.png and write it to session.nrrd.
       cc volkit-session.c $(pkg-config --cflags --libs vkt) -lm
   SPDX-License-Identifier: MIT */
#include <vkt/volkit.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static void must(vktError status) {
    if (status == vktNoError) return;
    fprintf(stderr, "%s\n%s\n", vkt_error(), vkt_error_hint());
    exit(1);
}

int main(void) {
    vktStructuredVolume volume = NULL;
    vktStructuredVolumeCreate(&volume, 64, 64, 64, vktDataFormatUInt8, 1, 1, 1, 0, 1);
    must(vktFillSV(volume, 0.1F));
    must(vktFillRangeSV(volume, 24, 8, 16, 40, 56, 48, 1));

    /* What the turned region leaves is grey: it goes into a volume of its own. */
    vktStructuredVolume turned = NULL;
    vktVec3f_t const axis = {0, 0, 1}, centre = {32, 32, 32};
    vktStructuredVolumeCreate(&turned, 64, 64, 64, vktDataFormatUInt8, 1, 1, 1, 0, 1);
    must(vktFillSV(turned, 0.1F));
    must(vktRotateRangeSV(turned, volume, 24, 8, 16, 40, 56, 48, axis, 0.5F, centre));

    float weights[7 * 7 * 7], sum = 0;
    for (int i = 0; i < 343; ++i) {
        int const x = i % 7 - 3, y = i / 7 % 7 - 3, z = i / 49 - 3;
        sum += weights[i] = expf((float)-(x * x + y * y + z * z) / 2);
    }
    for (int i = 0; i < 343; ++i) weights[i] /= sum;
    must(vktApplyFilterSV(turned, turned, weights, 7, 7, 7, vktAddressModeMirror));

    vktRenderState_t state;
    vktRenderStateDefaultInit(&state);
    state.snapshotTool.enabled = VKT_TRUE;
    state.snapshotTool.fileName = "session.png";
    must(vktRenderSV(turned, state, NULL));

    vktVolumeFile file = NULL;
    vktOutputStream out = NULL;
    vktVolumeFileCreateS(&file, "session.nrrd", vktOpenModeWrite);
    vktOutputStreamCreate(&out, vktVolumeFileGetBase(file));
    must(vktOutputStreamWriteSV(out, turned));

    vktOutputStreamDestroy(out);
    vktVolumeFileDestroy(file);
    vktStructuredVolumeDestroy(turned);
    vktStructuredVolumeDestroy(volume);
    return 0;
}
