/* volkit's names, and what its documentation says of them: volkit TEST. Expected values are written here by hand or by
   loops of their own. SPDX-License-Identifier: MIT */
#include "libvkt/c/volkit.h"

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MUST(condition)                                                                                                \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            fprintf(stderr, "line %d: %s: %s\n", __LINE__, #condition, vkt_error());                                   \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

static vktStructuredVolume made(int x, int y, int z, vktDataFormat format, float low, float high) {
    vktStructuredVolume volume = NULL;
    vktStructuredVolumeCreate(&volume, x, y, z, format, 1, 1, 1, low, high);
    MUST(volume != NULL);
    return volume;
}

static float at(vktStructuredVolume volume, int x, int y, int z) {
    float value = -12345;
    vktStructuredVolumeGetValue(volume, x, y, z, &value);
    return value;
}

/* x + 10 y + 100 z in floats. */
static vktStructuredVolume ramp(int x, int y, int z) {
    vktStructuredVolume volume = made(x, y, z, vktDataFormatFloat32, 0, 1);
    for (int k = 0; k < z; ++k)
        for (int j = 0; j < y; ++j)
            for (int i = 0; i < x; ++i) vktStructuredVolumeSetValue(volume, i, j, k, (float)(i + 10 * j + 100 * k));
    return volume;
}

static void volumes(void) {
    vktStructuredVolume a = made(4, 5, 6, vktDataFormatUInt16, 0, 1), b = NULL;
    vktVec3i_t const dims = vktStructuredVolumeGetDims3iv(a);
    uint16_t stored = 0;
    uint8_t bytes[4] = {0};
    float low = -1, high = -1, value = 0;
    MUST(dims.x == 4 && dims.y == 5 && dims.z == 6); /* volkit's pipe made it 4 5 4 */
    MUST(vktStructuredVolumeGetSizeInBytes(a) == 240);
    vktStructuredVolumeSetValue(a, 3, 4, 5, 1); /* volkit: 0 */
    vktStructuredVolumeGetBytes(a, 3, 4, 5, (uint8_t*)&stored);
    MUST(stored == 65535 && at(a, 3, 4, 5) == 1);
    vktStructuredVolumeSetValue(a, 0, 0, 0, 7); /* beyond the mapping: limited */
    MUST(at(a, 0, 0, 0) == 1);
    stored = 257;
    vktStructuredVolumeSetBytes(a, 1, 0, 0, (uint8_t*)&stored);
    MUST(((uint16_t*)vktStructuredVolumeGetData(a))[1] == 257);
    MUST(fabsf(at(a, 1, 0, 0) - 257 / 65535.0F) < 1e-7F);
    value = 3;
    vktStructuredVolumeGetValue(a, 4, 0, 0, &value); /* outside: untouched */
    MUST(value == 3 && vkt_error_status() == VKT_USAGE);
    vktStructuredVolumeSetValue(a, -1, 0, 0, 1);
    vktStructuredVolumeCreateCopy(&b, a);
    vktStructuredVolumeSetValue(b, 3, 4, 5, 0);
    MUST(at(a, 3, 4, 5) == 1 && at(b, 3, 4, 5) == 0);
    vktStructuredVolumeSetVoxelMapping2f(b, -1, 1);
    vktStructuredVolumeGetVoxelMapping2f(b, &low, &high);
    MUST(low == -1 && high == 1 && at(b, 3, 4, 5) == -1 && at(b, 0, 0, 0) == 1);
    vktStructuredVolumeSetDist3f(b, 1, 2, 0.5F);
    MUST(vktStructuredVolumeGetDist3fv(b).y == 2 && vktStructuredVolumeGetObjectBounds(b).max.z == 3);
    MUST(at(b, 0, 0, 0) == 1);
    vktStructuredVolumeSetDataFormat(b, vktDataFormatInt8);
    MUST(vktStructuredVolumeGetDataFormat(b) == vktDataFormatInt8 && vktStructuredVolumeGetSizeInBytes(b) == 120);
    vktStructuredVolumeSetDims3i(b, 2, 2, 2);
    MUST(vktStructuredVolumeGetSizeInBytes(b) == 8);
    MUST(vktMapVoxel(bytes, 1, vktDataFormatUInt32, 0, 1) == vktNoError && *(uint32_t*)(void*)bytes == 4294967295U);
    MUST(vktUnmapVoxel(&value, bytes, vktDataFormatUInt32, 0, 1) == vktNoError && value == 1);
    MUST(vktMapVoxel(bytes, -2, vktDataFormatInt16, -2, 2) == vktNoError && *(int16_t*)(void*)bytes == -32768);
    vktStructuredVolumeDestroy(a);
    vktStructuredVolumeDestroy(b);
    vktStructuredVolumeDestroy(NULL);
    vktStructuredVolumeCreate(&a, 0, 1, 1, vktDataFormatUInt8, 1, 1, 1, 0, 1);
    MUST(a == NULL && vkt_error_status() == VKT_USAGE);
    vktStructuredVolumeCreate(&a, 1, 1, 1, (vktDataFormat)99, 1, 1, 1, 0, 1);
    MUST(a == NULL && vktFillSV(NULL, 1) == vktInvalidValue && strstr(vkt_error(), "volume") != NULL);
}

static int sum_of(vktStructuredVolume volume, float value) {
    vktVec3i_t const n = vktStructuredVolumeGetDims3iv(volume);
    int count = 0;
    for (int k = 0; k < n.z; ++k)
        for (int j = 0; j < n.y; ++j)
            for (int i = 0; i < n.x; ++i) count += fabsf(at(volume, i, j, k) - value) < 1e-6F;
    return count;
}

static void fills(void) {
    vktStructuredVolume a = made(8, 6, 5, vktDataFormatFloat32, 0, 1);
    MUST(vktFillSV(a, 0.25F) == vktNoError && sum_of(a, 0.25F) == 240);
    MUST(vktFillRangeSV(a, 1, 1, 1, 3, 4, 5, 1) == vktNoError && sum_of(a, 1) == 2 * 3 * 4);
    MUST(at(a, 1, 1, 1) == 1 && at(a, 3, 3, 4) == 0.25F);
    MUST(vktFillRangeSV(a, 6, -3, 4, 99, 1, 99, 2) == vktNoError && sum_of(a, 2) == 2); /* what there is of it */
    MUST(vktFillRangeSV(a, 9, 9, 9, 12, 12, 12, 3) == vktNoError && sum_of(a, 3) == 0);
    MUST(vktFillRangeSV(a, 3, 0, 0, 2, 1, 1, 3) == vktInvalidValue);
    MUST(vktDeleteRangeSV(a, 0, 0, 0, 8, 6, 1) == vktNoError && sum_of(a, 0) == 48);
    MUST(vktFillSV(a, 1) == vktNoError);
    /* From 1.5 to 3.25: half of voxel 1, all of 2, a quarter of 3. */
    MUST(vktFillSubVoxelRangeSV(a, 1.5F, 0, 0, 3.25F, 2, 1, 5) == vktNoError);
    MUST(at(a, 1, 0, 0) == 3 && at(a, 2, 1, 0) == 5 && at(a, 3, 0, 0) == 2 && at(a, 4, 0, 0) == 1 &&
         at(a, 2, 2, 0) == 1);
    MUST(vktDeleteSV(a) == vktNoError && sum_of(a, 0) == 240);
    vktStructuredVolumeDestroy(a);
}

static void copies(void) {
    vktStructuredVolume a = ramp(8, 7, 6), b = made(4, 4, 4, vktDataFormatFloat32, 0, 1);
    vktStructuredVolume c = made(5, 5, 5, vktDataFormatUInt8, 0, 255);
    MUST(vktFillSV(b, -1) == vktNoError);
    MUST(vktCopyRangeSV(b, a, 2, 3, 1, 4, 5, 3, 1, 1, 1) == vktNoError);
    MUST(at(b, 1, 1, 1) == 132 && at(b, 2, 2, 2) == 243 && sum_of(b, -1) == 64 - 8);
    MUST(vktCopyRangeSV(b, a, 0, 0, 0, 8, 7, 6, 3, 3, 3) == vktNoError &&
         at(b, 3, 3, 3) == 0); /* the rest has no room */
    MUST(vktCopyRangeSV(b, a, -2, 0, 0, 1, 1, 1, 0, 0, 0) == vktNoError);
    MUST(at(b, 0, 0, 0) == 0 && at(b, 2, 0, 0) == 0);                                      /* the border goes on */
    MUST(vktCopySV(c, a) == vktNoError && at(c, 4, 4, 1) == 144 && at(c, 4, 4, 4) == 255); /* limited, not wrapped */
    MUST(vktStructuredVolumeGetDataFormat(c) == vktDataFormatUInt8);
    /* Flips, of odd extents, whole, by region, in place. */
    MUST(vktFlipSV(c, a, vktAxisX) == vktNoError && at(c, 0, 0, 0) == 7 && at(c, 4, 1, 1) == 113);
    vktStructuredVolume d = ramp(5, 5, 5);
    MUST(vktFlipSV(d, d, vktAxisZ) == vktNoError && at(d, 1, 2, 0) == 421 && at(d, 1, 2, 2) == 221);
    MUST(vktFlipSV(d, d, vktAxisZ) == vktNoError && vktFlipSV(d, d, vktAxisY) == vktNoError && at(d, 1, 0, 3) == 341);
    MUST(vktFlipSV(d, d, vktAxisY) == vktNoError);
    MUST(vktFlipRangeSV(d, d, 1, 1, 1, 4, 3, 3, 0, 0, 0, vktAxisX) == vktNoError);
    MUST(at(d, 1, 1, 1) == 113 && at(d, 3, 1, 1) == 111 && at(d, 2, 2, 2) == 222 && at(d, 4, 1, 1) == 114);
    MUST(at(d, 1, 3, 1) == 131 && vktFlipSV(d, d, (vktAxis)7) == vktInvalidValue);
    vktStructuredVolumeDestroy(a), vktStructuredVolumeDestroy(b), vktStructuredVolumeDestroy(c);
    vktStructuredVolumeDestroy(d);
}

static void moves(void) {
    vktStructuredVolume a = ramp(8, 8, 4), b = made(8, 8, 4, vktDataFormatFloat32, 0, 1);
    vktVec3f_t const z = {0, 0, 1}, middle = {4, 4, 2}, twice = {2, 2, 1};
    float const pi = 3.14159265F;
    MUST(vktFillSV(b, -5) == vktNoError);
    MUST(vktRotateSV(b, a, z, 0, middle) == vktNoError); /* volkit moves voxels by 0 degrees */
    for (int k = 0; k < 4; ++k)
        for (int j = 0; j < 8; ++j)
            for (int i = 0; i < 8; ++i) MUST(at(b, i, j, k) == at(a, i, j, k));
    MUST(vktRotateSV(b, a, z, pi / 2, middle) == vktNoError); /* x goes to y */
    MUST(at(b, 7, 0, 1) == at(a, 0, 0, 1) && at(b, 7, 7, 3) == at(a, 7, 0, 3) && at(b, 2, 6, 0) == at(a, 6, 5, 0));
    /* By 45 degrees: corners keep what they had, the centre interpolates linearly, which is exact for a ramp. */
    MUST(vktFillSV(b, -5) == vktNoError && vktRotateSV(b, a, z, pi / 4, middle) == vktNoError);
    MUST(at(b, 0, 0, 0) == -5 && at(b, 7, 7, 3) == -5);
    double const c = cos(pi / 4.0), u = 0.5, v = 1.5; /* voxel (4,5): offset from the middle */
    double const x = c * u + c * v + 3.5, y = -c * u + c * v + 3.5;
    MUST(fabs(at(b, 4, 5, 2) - (x + 10 * y + 200)) < 1e-3);
    /* A region: turned within dest, which keeps the rest. */
    MUST(vktFillSV(b, -5) == vktNoError);
    MUST(vktRotateRangeSV(b, a, 2, 2, 0, 6, 6, 2, z, pi / 2, middle) == vktNoError);
    MUST(at(b, 5, 2, 0) == at(a, 2, 2, 0) && at(b, 2, 5, 1) == at(a, 5, 5, 1) && sum_of(b, -5) == 256 - 32);
    vktStructuredVolumeSetDist3f(b, 3, 3, 3);
    MUST(vktFillSV(b, -5) == vktNoError);
    MUST(vktRotateRangeSV(b, a, 2, 2, 0, 6, 6, 2, z, pi / 2, middle) == vktNoError && at(b, 5, 2, 0) == at(a, 2, 2, 0));
    MUST(vktStructuredVolumeGetDist3fv(b).x == 3 && sum_of(b, -5) == 256 - 32);
    vktVec3f_t const none = {0, 0, 0};
    MUST(vktRotateSV(b, a, none, 1, middle) == vktInvalidValue);
    /* Twice as large about the middle: cell-centred, so that voxel i shows i / 2 + 1.75. */
    MUST(vktScaleSV(b, a, twice, middle) == vktNoError && fabsf(at(b, 3, 4, 1) - (3.25F + 37.5F + 100)) < 1e-4F);
    vktStructuredVolume small = made(4, 8, 4, vktDataFormatFloat32, 0, 1);
    MUST(vktRotateSV(small, a, z, pi / 2, middle) == vktNoError && at(small, 3, 1, 2) == at(a, 1, 4, 2));
    /* Resampled: 4 voxels to 8, linearly between centres. */
    vktStructuredVolume line = made(4, 1, 1, vktDataFormatFloat32, 0, 1),
                        fine = made(8, 1, 1, vktDataFormatFloat32, 0, 1);
    for (int i = 0; i < 4; ++i) vktStructuredVolumeSetValue(line, i, 0, 0, 10.0F * (float)i);
    MUST(vktResampleSV(fine, line, vktFilterModeLinear) == vktNoError);
    float const want[8] = {0, 2.5F, 7.5F, 12.5F, 17.5F, 22.5F, 27.5F, 30};
    for (int i = 0; i < 8; ++i) MUST(at(fine, i, 0, 0) == want[i]); /* volkit: 0 0 10 10 20 20 30 30 */
    MUST(vktResampleSV(fine, line, vktFilterModeNearest) == vktNoError && at(fine, 3, 0, 0) == 10);
    MUST(vktResampleCLAHESV(a, a) == vktNoError);
    vktStructuredVolumeDestroy(a), vktStructuredVolumeDestroy(b), vktStructuredVolumeDestroy(small);
    vktStructuredVolumeDestroy(line), vktStructuredVolumeDestroy(fine);
}

static int mirrored(int i, int n) { return i < 0 ? -1 - i : i >= n ? 2 * n - 1 - i : i; }

static void filters(void) {
    vktStructuredVolume a = ramp(5, 4, 4), b = made(5, 4, 4, vktDataFormatFloat32, 0, 1);
    float weights[5 * 3 * 1];
    for (int i = 0; i < 15; ++i) weights[i] = (float)(i * i % 7) - 1.5F;
    MUST(vktApplyFilterSV(b, a, weights, 5, 3, 1, vktAddressModeMirror) == vktNoError);
    for (int k = 0; k < 4; ++k)
        for (int j = 0; j < 4; ++j)
            for (int i = 0; i < 5; ++i) {
                double sum = 0;
                for (int v = 0; v < 3; ++v)
                    for (int u = 0; u < 5; ++u)
                        sum += (double)weights[u + 5 * v] *
                               (double)at(a, mirrored(i + u - 2, 5), mirrored(j + v - 1, 4), k);
                MUST(fabs(at(b, i, j, k) - sum) < 1e-2); /* volkit: 0 at the border */
            }
    MUST(vktFillSV(b, 9) == vktNoError);
    MUST(vktApplyFilterRangeSV(b, a, 1, 1, 1, 3, 3, 3, (float const[]){1}, 1, 1, 1, vktAddressModeBorder) ==
         vktNoError);
    MUST(at(b, 1, 1, 1) == 111 && at(b, 0, 0, 0) == 9 && sum_of(b, 9) == 80 - 8);
    float const side[3] = {1, 0, 0};
    MUST(vktApplyFilterSV(b, a, side, 3, 1, 1, vktAddressModeBorder) == vktNoError && at(b, 0, 2, 2) == 0);
    MUST(at(b, 3, 2, 2) == at(a, 2, 2, 2));
    MUST(vktApplyFilterSV(b, a, side, 3, 1, 1, vktAddressModeWrap) == vktNoError && at(b, 0, 2, 2) == at(a, 4, 2, 2));
    MUST(vktApplyFilterSV(b, a, side, 3, 1, 1, vktAddressModeClamp) == vktNoError && at(b, 0, 2, 2) == at(a, 0, 2, 2));
    MUST(vktApplyFilterSV(b, a, side, 2, 1, 1, vktAddressModeClamp) == vktInvalidValue);
    MUST(vktApplyFilterSV(b, a, NULL, 3, 1, 1, vktAddressModeClamp) == vktInvalidValue);
    /* Sums of everything before, against loops. */
    MUST(vktScanSV(b, a) == vktNoError);
    for (int k = 0; k < 4; ++k)
        for (int j = 0; j < 4; ++j)
            for (int i = 0; i < 5; ++i) {
                double sum = 0;
                for (int w = 0; w <= k; ++w)
                    for (int v = 0; v <= j; ++v)
                        for (int u = 0; u <= i; ++u) sum += u + 10 * v + 100 * w;
                MUST((double)at(b, i, j, k) == sum);
            }
    MUST(vktFillSV(b, -1) == vktNoError && vktScanRangeSV(b, a, 1, 1, 1, 3, 2, 2, 2, 0, 0) == vktNoError);
    MUST(at(b, 2, 0, 0) == 111 && at(b, 3, 0, 0) == 223 && sum_of(b, -1) == 78);
    vktStructuredVolumeDestroy(a), vktStructuredVolumeDestroy(b);
}

static void raise(int32_t x, int32_t y, int32_t z, vktVoxelView_t voxel) {
    float value = 0;
    MUST(vktUnmapVoxel(&value, voxel.bytes, voxel.dataFormat, voxel.mappingLo, voxel.mappingHi) == vktNoError);
    if (x == y && y == z) value += 1000;
    MUST(vktMapVoxel(voxel.bytes, value, voxel.dataFormat, voxel.mappingLo, voxel.mappingHi) == vktNoError);
}
static void swap(int32_t x, int32_t y, int32_t z, vktVoxelView_t one, vktVoxelView_t two) {
    uint8_t bytes[4];
    (void)x, (void)y, (void)z;
    memcpy(bytes, one.bytes, 4), memcpy(one.bytes, two.bytes, 4), memcpy(two.bytes, bytes, 4);
}

static void transforms(void) {
    vktStructuredVolume a = ramp(4, 4, 4), b = made(3, 3, 3, vktDataFormatFloat32, 0, 1);
    MUST(vktTransformSV1(a, raise) == vktNoError && at(a, 2, 2, 2) == 1222 && at(a, 2, 2, 1) == 122);
    MUST(vktTransformRangeSV1(a, 0, 0, 0, 2, 2, 2, raise) == vktNoError && at(a, 1, 1, 1) == 2111 &&
         at(a, 3, 3, 3) == 1333);
    MUST(vktFillSV(b, 7) == vktNoError && vktTransformSV2(a, b, swap) == vktNoError);
    MUST(at(a, 2, 1, 0) == 7 && at(a, 3, 1, 0) == 13 && at(b, 2, 1, 0) == 12);
    MUST(vktTransformRangeSV2(a, b, 3, 0, 0, 4, 4, 4, 0, 0, 0, swap) == vktNoError);
    MUST(at(a, 3, 0, 0) == 2000); /* what volume2 got from voxel 0 0 0 */
    MUST(at(b, 0, 2, 2) == 223 && at(a, 3, 3, 3) == 1333);
    MUST(vktTransformSV1(a, NULL) == vktInvalidValue && vktTransformSV2(a, NULL, swap) == vktInvalidValue);
    vktStructuredVolumeDestroy(a), vktStructuredVolumeDestroy(b);
}

static void arithmetic(void) {
    vktStructuredVolume a = made(3, 2, 1, vktDataFormatUInt8, 0, 1), b = made(3, 2, 1, vktDataFormatUInt8, 0, 1);
    vktStructuredVolume sum = made(3, 2, 1, vktDataFormatUInt8, 0, 1), wide = made(3, 2, 1, vktDataFormatFloat32, 0, 1);
    float const p = 153 / 255.0F, q = 102 / 255.0F; /* 0.6 and 0.4 */
    MUST(vktFillSV(a, 0.6F) == vktNoError && vktFillSV(b, 0.4F) == vktNoError);
    MUST(vktSumSV(sum, a, b) == vktNoError && at(sum, 0, 0, 0) == 1);
    MUST(vktSumSV(sum, a, a) == vktNoError && at(sum, 0, 0, 0) == 1); /* 1.2, limited */
    MUST(vktSumSV(wide, a, a) == vktNoError && fabsf(at(wide, 2, 1, 0) - 2 * p) < 1e-6F);
    MUST(vktDiffSV(sum, b, a) == vktNoError && at(sum, 0, 0, 0) == 0); /* -0.2, limited */
    MUST(vktDiffSV(wide, b, a) == vktNoError && fabsf(at(wide, 0, 0, 0) - (q - p)) < 1e-6F);
    MUST(vktProdSV(wide, a, b) == vktNoError && fabsf(at(wide, 0, 0, 0) - p * q) < 1e-6F);
    MUST(vktQuotSV(wide, a, b) == vktNoError && fabsf(at(wide, 0, 0, 0) - p / q) < 1e-6F);
    MUST(vktAbsDiffSV(wide, b, a) == vktNoError && fabsf(at(wide, 0, 0, 0) - (p - q)) < 1e-6F);
    MUST(vktSafeSumSV(sum, a, a) == vktNoError && at(sum, 1, 1, 0) == 1);
    MUST(vktFillSV(wide, -1) == vktNoError);
    MUST(vktSumRangeSV(wide, a, b, 0, 0, 0, 2, 1, 1, 1, 1, 0) == vktNoError);
    MUST(fabsf(at(wide, 1, 1, 0) - 1) < 1e-6F && fabsf(at(wide, 2, 1, 0) - 1) < 1e-6F && sum_of(wide, -1) == 4);
    MUST(vktSafeQuotRangeSV(wide, a, b, 0, 0, 0, 1, 1, 1, 0, 0, 0) == vktNoError &&
         fabsf(at(wide, 0, 0, 0) - 1.5F) < 1e-6F);
    MUST(vktSumSV(wide, a, NULL) == vktInvalidValue);
    vktStructuredVolumeSetDist3f(b, 2, 1, 1); /* voxels meet by their number */
    vktStructuredVolumeSetDist3f(wide, 1, 1, 5);
    MUST(vktSumSV(wide, a, b) == vktNoError && fabsf(at(wide, 2, 1, 0) - 1) < 1e-6F);
    vktStructuredVolumeDestroy(a), vktStructuredVolumeDestroy(b), vktStructuredVolumeDestroy(sum);
    vktStructuredVolumeDestroy(wide);
}

static void measures(void) {
    vktStructuredVolume a = ramp(6, 5, 4), b = made(10, 1, 1, vktDataFormatUInt8, 0, 255);
    vktAggregates_t all, part;
    MUST(vktComputeAggregatesSV(a, &all) == vktNoError);
    MUST(all.min == 0 && all.max == 345 && all.sum == 120 * 172.5F && all.mean == 172.5F && all.prod == 0);
    MUST(all.argmin.x == 0 && all.argmax.x == 5 && all.argmax.y == 4 && all.argmax.z == 3);
    MUST(vktComputeAggregatesRangeSV(a, &part, 1, 2, 3, 3, 4, 4) == vktNoError); /* 321 322 331 332 */
    MUST(part.mean == 326.5F && part.var == 25.25F && fabsf(part.stddev - sqrtf(25.25F)) < 1e-5F && part.sum == 1306);
    MUST(part.argmin.x == 1 && part.argmin.y == 2 && part.argmin.z == 3 && part.argmax.x == 2 && part.argmax.y == 3);
    MUST(fabs((double)part.prod / (321.0 * 322 * 331 * 332) - 1) < 1e-6);
    MUST(vktComputeAggregatesRangeSV(a, &part, 9, 9, 9, 12, 12, 12) == vktInvalidValue && part.sum == 1306);
    vktHistogram histogram = NULL;
    vktHistogramCreate(&histogram, 5);
    for (int i = 0; i < 10; ++i) vktStructuredVolumeSetValue(b, i, 0, 0, (float)(i < 9 ? 25 * i : 255));
    MUST(vktComputeHistogramSV(b, histogram) == vktNoError && vktHistogramGetNumBins(histogram) == 5);
    size_t const want[5] = {3, 2, 2, 2, 1}; /* the largest value is in the last bin */
    MUST(memcmp(vktHistogramGetBinCounts(histogram), want, sizeof want) == 0);
    MUST(vktComputeHistogramRangeSV(b, histogram, 8, 0, 0, 10, 1, 1) == vktNoError);
    MUST(vktHistogramGetBinCounts(histogram)[3] == 1 && vktHistogramGetBinCounts(histogram)[4] == 1);
    vktHistogramDestroy(histogram);
    vktHistogramCreate(&histogram, 0);
    MUST(histogram == NULL);
    vktStructuredVolumeDestroy(a), vktStructuredVolumeDestroy(b);
}

static void bricks(void) {
    vktStructuredVolume a = ramp(5, 4, 3);
    vktArray3D_vktStructuredVolume array = NULL;
    vktArray3D_vktStructuredVolume_CreateEmpty(&array);
    MUST(vktArray3D_vktStructuredVolume_Empty(array) == VKT_TRUE);
    MUST(vktBrickDecomposeResizeSV(array, a, 2, 2, 2, 1, 0, 0, 1, 0, 0) == vktNoError);
    vktVec3i_t const n = vktArray3D_vktStructuredVolume_Dims(array), last = {2, 1, 1}, first = {0, 0, 0};
    MUST(n.x == 3 && n.y == 2 && n.z == 2 && vktArray3D_vktStructuredVolume_NumElements(array) == 12);
    vktStructuredVolume const corner = *vktArray3D_vktStructuredVolume_Access(array, last);
    vktVec3i_t const dims = vktStructuredVolumeGetDims3iv(corner);
    MUST(dims.x == 3 && dims.y == 2 && dims.z == 1); /* one voxel and a halo on both sides */
    MUST(at(corner, 0, 0, 0) == 223 && at(corner, 1, 1, 0) == 234 && at(corner, 2, 1, 0) == 234);
    MUST(at(*vktArray3D_vktStructuredVolume_Access(array, first), 0, 1, 1) == 110);
    MUST(vktFillSV(a, 3) == vktNoError && vktBrickDecomposeSV(array, a, 2, 2, 2, 1, 0, 0, 1, 0, 0) == vktNoError);
    MUST(sum_of(corner, 3) == 6);
    for (size_t i = 0; i < 12; ++i) vktStructuredVolumeDestroy(vktArray3D_vktStructuredVolume_Data(array)[i]);
    vktArray3D_vktStructuredVolume_Resize(array, n);
    MUST(vktBrickDecomposeSV(array, a, 2, 2, 2, 0, 0, 0, 0, 0, 0) == vktInvalidValue); /* nothing to write to */
    MUST(vktBrickDecomposeResizeSV(array, a, 0, 2, 2, 0, 0, 0, 0, 0, 0) == vktInvalidValue);
    vktArray3D_vktStructuredVolume_Destroy(array);
    vktStructuredVolumeDestroy(a);
}

static void* other_thread(void* policy) {
    *(vktExecutionPolicy_t*)policy = vktGetThreadExecutionPolicy();
    return NULL;
}

static void policies(void) {
    vktExecutionPolicy_t p = vktGetThreadExecutionPolicy(), other;
    vkt_policy in_force;
    pthread_t thread;
    vktStructuredVolume a = made(4, 4, 4, vktDataFormatUInt8, 0, 1);
    MUST(p.device == vktExecutionPolicyDeviceCPU && p.printPerformance == VKT_FALSE);
    p.hostApi = vktExecutionPolicyHostAPISerial;
    p.printPerformance = VKT_TRUE;
    vktSetThreadExecutionPolicy(p);
    MUST(vkt_get_policy(&in_force) == VKT_OK && in_force.threads == 1 && strcmp(in_force.device, "cpu") == 0);
    MUST(vktFillSV(a, 1) == vktNoError);
    MUST(pthread_create(&thread, NULL, other_thread, &other) == 0 && pthread_join(thread, NULL) == 0);
    MUST(other.hostApi == vktExecutionPolicyAPIAuto && other.printPerformance == VKT_FALSE);
    p.printPerformance = VKT_FALSE;
    p.device = vktExecutionPolicyDeviceGPU;
    vktSetThreadExecutionPolicy(p);
    MUST(vktGetThreadExecutionPolicy().device == vktExecutionPolicyDeviceGPU);
    if (getenv("WITHOUT_GPU") != NULL) { /* never silently elsewhere */
        MUST(vktFillSV(a, 0) == vktInvalidValue && strstr(vkt_error(), "GPU") != NULL && at(a, 0, 0, 0) == 1);
    }
    p.device = vktExecutionPolicyDeviceCPU;
    p.hostApi = vktExecutionPolicyAPIAuto;
    vktSetThreadExecutionPolicy(p);
    MUST(vktFillSV(a, 0) == vktNoError && at(a, 0, 0, 0) == 0);
    vktStructuredVolumeDestroy(a);
}

/* Files: volkit files NAME reads it, turns its values around and writes out.nrrd. */
static void files(char const* name) {
    vktVolumeFile in = NULL, out = NULL, none = NULL;
    vktInputStream from = NULL;
    vktOutputStream to = NULL;
    vktVolumeFileCreateS(&in, name, vktOpenModeRead);
    vktVolumeFileHeader_t const header = vktVolumeFileGetHeader(in);
    MUST(header.isStructured && !header.isHierarchical && vktVolumeFileGood(in));
    printf("%d %d %d %d\n", header.dims.x, header.dims.y, header.dims.z, (int)header.dataFormat);
    vktStructuredVolume volume = made(header.dims.x, header.dims.y, header.dims.z, header.dataFormat, 0, 1);
    vktInputStreamCreate(&from, vktVolumeFileGetBase(in));
    MUST(vktInputStreamReadSV(from, volume) == vktNoError);
    vktVolumeFileCreateS(&out, "out.nrrd", vktOpenModeWrite);
    vktOutputStreamCreate(&to, vktVolumeFileGetBase(out));
    MUST(vktFlipSV(volume, volume, vktAxisX) == vktNoError && vktOutputStreamWriteSV(to, volume) == vktNoError);
    vktVolumeFileCreateS(&none, "missing.nrrd", vktOpenModeRead);
    MUST(!vktVolumeFileGood(none) && vktVolumeFileGetHeader(none).dims.x == 0);
    vktInputStreamDestroy(from);
    vktInputStreamCreate(&from, vktVolumeFileGetBase(none));
    MUST(vktInputStreamReadSV(from, volume) == vktReadError && strstr(vkt_error(), "missing.nrrd"));
    vktInputStreamDestroy(from);
    vktOutputStreamDestroy(to);
    vktOutputStreamCreate(&to, vktVolumeFileGetBase(in));
    MUST(vktOutputStreamWriteSV(to, volume) == vktInvalidDataSource);
    MUST(strstr(vkt_error(), "was opened for reading"));
    vktOutputStreamDestroy(to);
    vktVolumeFileDestroy(in), vktVolumeFileDestroy(out), vktVolumeFileDestroy(none);
    vktRawFile raw = NULL, written = NULL;
    vktRawFileCreateS(&raw, name, "r");
    MUST(vktRawFileGood(raw) && vktRawFileGetDims3iv(raw).z == header.dims.z);
    MUST(vktRawFileGetDataFormat(raw) == header.dataFormat);
    vktRawFileCreateS(&written, "again.nrrd", "w");
    vktOutputStreamCreate(&to, vktRawFileGetBase(written));
    MUST(!vktRawFileGood(written) && vktOutputStreamWriteSV(to, volume) == vktNoError);
    vktOutputStreamDestroy(to);
    vktOutputStreamCreate(&to, vktRawFileGetBase(raw));
    MUST(vktOutputStreamWriteSV(to, volume) == vktInvalidDataSource);
    vktOutputStreamDestroy(to);
    vktRawFileDestroy(raw), vktRawFileDestroy(written);
    vktVolumeFileHeader_t nothing = header;
    vktVolumeFileHeaderDefaultInit(&nothing);
    MUST(!nothing.isStructured && nothing.dims.x == 0);
    vktStructuredVolumeDestroy(volume);
}

static void pictures(void) {
    vktStructuredVolume a = made(12, 10, 8, vktDataFormatUInt8, 0, 1);
    vktLookupTable table = NULL;
    vktRenderState_t state, then;
    float rgba[8] = {1, 0, 0, 0, 1, 0, 0, 1};
    MUST(vktFillRangeSV(a, 3, 3, 2, 9, 7, 6, 1) == vktNoError);
    vktLookupTableCreate(&table, 2, 1, 1, vktColorFormatRGBA32F);
    MUST(table != NULL && vktLookupTableGetSizeInBytes(table) == sizeof rgba);
    int32_t x = 0, y = 0, z = 0;
    vktLookupTableSetDims3i(table, 3, 2, 1);
    vktLookupTableGetDims3i(table, &x, &y, &z);
    vktLookupTableSetColorFormat(table, vktColorFormatRGB8);
    MUST(x == 3 && y == 2 && z == 1 && vktLookupTableGetSizeInBytes(table) == 18);
    vktLookupTableSetColorFormat(table, vktColorFormatRGBA32F);
    vktLookupTableSetDims3iv(table, (vktVec3i_t){2, 1, 1});
    vktLookupTableSetData(table, (uint8_t*)rgba);
    vktRenderStateDefaultInit(&state);
    MUST(vktRenderSV(a, state, NULL) == vktInvalidValue && strstr(vkt_error_hint(), "snapshotTool") != NULL);
    state.snapshotTool.enabled = VKT_TRUE;
    state.snapshotTool.fileName = "red.png";
    state.viewportWidth = 40, state.viewportHeight = 30;
    state.rgbaLookupTable = vktLookupTableGetResourceHandle(table);
    MUST(vktRenderSV(a, state, &then) == vktNoError && then.viewportWidth == 40);
    state.renderAlgo = vktRenderAlgoImplicitIso;
    state.snapshotTool.fileName = "iso.png";
    MUST(vktRenderSV(a, state, NULL) == vktNoError);
    state.renderAlgo = vktRenderAlgoMultiScattering;
    state.snapshotTool.fileName = "no/such/folder/scattered.png";
    MUST(vktRenderSV(a, state, NULL) == vktWriteError);
    vktLookupTableDestroy(table);
    MUST(vktRenderSV(a, state, NULL) == vktInvalidValue); /* no such table any more */
    state.rgbaLookupTable = (vktResourceHandle)-1;
    state.sRGB = VKT_FALSE;
    MUST(vktRenderSV(a, state, NULL) == vktInvalidValue);
    vktStructuredVolumeDestroy(a);
}

/* A file of uint8 of 24 x 20 x 16 voxels, read piece by piece. */
static void regions(char const* name) {
    size_t const slice = 24 * 20, all = slice * 16;
    uint8_t* bytes = NULL;
    vktRawFile file = NULL;
    vktInputStream from = NULL;
    vktStructuredVolume three = made(24, 20, 3, vktDataFormatUInt8, 0, 1);
    vktStructuredVolume other = made(24, 20, 3, vktDataFormatUInt16, 0, 1);
    vktBox3f_t const bounds = vktStructuredVolumeGetWorldBounds(three);
    MUST(bounds.min.x == 0 && bounds.max.x == 24 && bounds.max.z == 3);
    vktAllocate((void**)&bytes, all);
    vktRawFileCreateS(&file, name, "r");
    MUST(bytes != NULL && vktRawFileRead(file, (char*)bytes, 1000) == 1000);
    MUST(vktVolumeFileRead(file, (char*)bytes + 1000, 2 * all) == all - 1000 && vktRawFileRead(file, NULL, 1) == 0);
    uint8_t* copy = NULL;
    vktAllocate((void**)&copy, all);
    vktMemcpy(copy, bytes, all, vktCopyKindHostToHost);
    MUST(memcmp(copy, bytes, all) == 0);
    vktFree(copy), vktFree(NULL);
    vktInputStreamCreate(&from, vktRawFileGetBase(file));
    /* Slices 5 to 7, then the next three. */
    MUST(vktInputStreamSeek(from, 5 * slice) == vktNoError);
    for (int first = 5; first < 9; first += 3) {
        MUST(vktInputStreamReadSV(from, three) == vktNoError);
        MUST(memcmp(vktStructuredVolumeGetData(three), bytes + (size_t)first * slice, 3 * slice) == 0);
    }
    /* The first 24 bytes as a region of 4 x 3 x 2 voxels; the others stay. */
    MUST(vktFillSV(three, 1) == vktNoError && vktInputStreamSeek(from, 0) == vktNoError);
    MUST(vktInputStreamReadRangeSV(from, three, 2, 3, 1, 6, 6, 3) == vktNoError);
    for (int z = 0; z < 3; ++z)
        for (int y = 0; y < 20; ++y)
            for (int x = 0; x < 24; ++x) {
                int const inside = x >= 2 && x < 6 && y >= 3 && y < 6 && z >= 1;
                uint8_t const want = inside ? bytes[x - 2 + 4 * (y - 3 + 3 * (z - 1))] : 255;
                MUST(vktStructuredVolumeGetData(three)[x + 24 * (y + 20 * z)] == want);
            }
    MUST(vktInputStreamReadSV(from, other) == vktInvalidValue && strstr(vkt_error(), "uint8") != NULL);
    MUST(vktInputStreamReadRangeSV(from, three, 20, 0, 0, 25, 1, 1) == vktInvalidValue);
    MUST(vktInputStreamSeek(from, all + 1) == vktInvalidValue && vktInputStreamSeek(from, all - 5) == vktNoError);
    MUST(vktInputStreamReadRangeSV(from, three, 0, 0, 0, 6, 1, 1) == vktReadError);
    MUST(vktInputStreamReadRangeSV(from, three, 0, 0, 0, 5, 1, 1) == vktNoError);
    MUST(memcmp(vktStructuredVolumeGetData(three), bytes + all - 5, 5) == 0);
    vktLookupTableMigrate(NULL);
    vktInputStreamDestroy(from), vktRawFileDestroy(file), vktFree(bytes);
    vktStructuredVolumeDestroy(three), vktStructuredVolumeDestroy(other);
}

static void trees(void) {
    /* A coarse brick of 2 x 2 x 2 cells, each 2 wide, and a fine one beside it, whose cells come first in memory. */
    vktBrick_t const bricks[2] = {{{-2, 0, 0}, {2, 2, 2}, 64, 1}, {{2, 0, 0}, {4, 4, 4}, 0, 0}};
    vktBrick_t both[2];
    vktHierarchicalVolume tree = NULL;
    memcpy(both, bricks, sizeof both);
    vktHierarchicalVolumeCreate(&tree, both, 2, vktDataFormatUInt8, 0, 1);
    MUST(tree != NULL && vktHierarchicalVolumeGetNumBricks(tree) == 2);
    MUST(memcmp(vktHierarchicalVolumeGetBricks(tree), bricks, sizeof bricks) == 0);
    vktVec3i_t const dims = vktHierarchicalVolumeGetDims3iv(tree);
    MUST(dims.x == 8 && dims.y == 4 && dims.z == 4);
    MUST(vktHierarchicalVolumeGetDataFormat(tree) == vktDataFormatUInt8);
    MUST(vktHierarchicalVolumeGetMaxBytesPerVoxel() == 4);
    uint8_t* data = vktHierarchicalVolumeGetData(tree);
    for (int i = 0; i < 72; ++i) MUST(data[i] == 0);
    MUST(vktFillHV(tree, 0.2F) == vktNoError);
    /* From the middle of the coarse brick to the middle of the fine one, two cells high. */
    MUST(vktFillRangeHV(tree, 0, 0, 0, 4, 2, 100, 1) == vktNoError);
    data = vktHierarchicalVolumeGetData(tree);
    for (int z = 0; z < 4; ++z)
        for (int y = 0; y < 4; ++y)
            for (int x = 0; x < 4; ++x) MUST(data[x + 4 * (y + 4 * z)] == (x < 2 && y < 2 ? 255 : 51));
    for (int i = 0; i < 8; ++i) MUST(data[64 + i] == (i % 2 == 1 && i / 2 % 2 == 0 ? 255 : 51));
    data[64] = 7;
    MUST(vktHierarchicalVolumeGetData(tree)[64] == 7);
    vktHierarchicalVolume copy = NULL, of_none = tree;
    vktHierarchicalVolumeCreateCopy(&copy, tree);
    MUST(copy != NULL && vktHierarchicalVolumeGetNumBricks(copy) == 2 && vktHierarchicalVolumeGetDims3iv(copy).x == 8);
    MUST(memcmp(vktHierarchicalVolumeGetData(copy), vktHierarchicalVolumeGetData(tree), 72) == 0);
    vktHierarchicalVolumeGetData(copy)[64] = 9; /* each has cells of its own */
    MUST(vktHierarchicalVolumeGetData(tree)[64] == 7 && vktHierarchicalVolumeGetData(copy)[64] == 9);
    vktHierarchicalVolumeDestroy(copy);
    vktHierarchicalVolumeCreateCopy(&of_none, NULL);
    MUST(of_none == NULL);
    vktHierarchicalVolumeSetVoxelMapping2f(tree, -1, 1);
    MUST(vktHierarchicalVolumeGetVoxelMapping2fv(tree).x == -1 && vktHierarchicalVolumeGetData(tree)[64] == 7);
    MUST(vktFillRangeHV(tree, 2, 0, 0, 3, 1, 1, -1) == vktNoError && vktHierarchicalVolumeGetData(tree)[0] == 0);
    MUST(vktFillRangeHV(tree, 3, 0, 0, 2, 1, 1, 0) == vktInvalidValue);
    vktHierarchicalVolumeDestroy(tree);
    both[0].offsetInBytes = 65; /* a gap */
    vktHierarchicalVolumeCreate(&tree, both, 2, vktDataFormatUInt8, 0, 1);
    MUST(tree == NULL && strstr(vkt_error(), "begin at byte 65") != NULL);
    MUST(vktFillHV(NULL, 0) == vktInvalidValue);
    vktHierarchicalVolumeDestroy(NULL);
}

int main(int argc, char** argv) {
    struct {
        char const* name;
        void (*test)(void);
    } const tests[] = {{"volumes", volumes},       {"fills", fills},       {"copies", copies},
                       {"moves", moves},           {"filters", filters},   {"transforms", transforms},
                       {"arithmetic", arithmetic}, {"measures", measures}, {"bricks", bricks},
                       {"policies", policies},     {"pictures", pictures}, {"trees", trees}};
    if (argc == 3 && strcmp(argv[1], "files") == 0) return files(argv[2]), 0;
    if (argc == 3 && strcmp(argv[1], "regions") == 0) return regions(argv[2]), 0;
    for (size_t i = 0; argc == 2 && i < sizeof tests / sizeof *tests; ++i)
        if (strcmp(argv[1], tests[i].name) == 0) return tests[i].test(), 0;
    return 2;
}
