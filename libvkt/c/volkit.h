/** \file
   The names of volkit's C API over vkt.h, so that programs written for it compile and run.
   SPDX-License-Identifier: MIT

   One header stands for all of <vkt/...>. What the names mean is what volkit's documentation says, done right: samples
   are cell-centred, nothing wraps, filters mind their borders, turns interpolate. Values are physical: the range of an
   integer type stands for mappingLo to mappingHi. Regions are half-open, [first, last). A destination keeps its type,
   mapping, distances and the voxels that a call does not write; it may be a source as well. Source voxels outside of a
   volume are those of its border; what would be written outside is left out. Where a call fails, vkt_error() and
   vkt_error_hint() of vkt.h tell why, and all is as it was. A function without a status leaves a null pointer, or what
   was there.

   These are volkit's names since its volumes have data formats. Left out are those that nothing here stands behind:
   CUDA contexts and streams (vktCudaContext…), registered resources and handles of volumes (vktRegisterManagedResource,
   vktGetManagedResource, vktManagedBuffer…), Virvo's files (vktVirvoFile…: they are read as any other), files of FILE
   pointers (vktRawFileCreateFD), and what volkit declares and does not have (vktCopySubVoxelRangeSV,
   vktTransformSubVoxelRangeSV1 and 2). Older programs count bytes per voxel where formats are said now: they do not
   compile, since 1 byte would be taken for vktDataFormatInt8. */
#ifndef LIBVKT_C_VOLKIT_H
#define LIBVKT_C_VOLKIT_H

#include "vkt.h"

#include <stddef.h>
#include <stdint.h>
#include <string.h>

/** What programs link to. */
#define VKTAPI VKT_API

#ifdef __cplusplus
extern "C" {
#endif

/** VKT_TRUE or VKT_FALSE. */
typedef uint8_t vktBool_t;
#define VKT_FALSE 0 /**< no */
#define VKT_TRUE 1  /**< yes */

/** How a call ended. */
typedef enum {
    vktInvalidValue = -1,     /**< the request makes no sense, or cannot be met: see vkt_error() */
    vktNoError = 0,           /**< as it should */
    vktInvalidDataSource = 1, /**< no file, or one that is open for something else */
    vktReadError = 2,         /**< a file cannot be read, or is damaged */
    vktWriteError = 3         /**< a file cannot be written */
} vktError;

/** Types of voxels. */
typedef enum {
    vktDataFormatUnspecified, /**< none of these */
    vktDataFormatInt8,        /**< 8 bits, signed */
    vktDataFormatInt16,       /**< 16 bits, signed */
    vktDataFormatInt32,       /**< 32 bits, signed */
    vktDataFormatUInt8,       /**< 8 bits */
    vktDataFormatUInt16,      /**< 16 bits */
    vktDataFormatUInt32,      /**< 32 bits */
    vktDataFormatFloat32,     /**< single precision */
    vktVoxelFormatCount       /**< how many there are */
} vktDataFormat;

/** Types of the entries of lookup tables. */
typedef enum {
    vktColorFormatUnspecified, /**< none of these */
    vktColorFormatR8,          /**< one byte */
    vktColorFormatRG8,         /**< two bytes */
    vktColorFormatRGB8,        /**< three bytes */
    vktColorFormatRGBA8,       /**< four bytes */
    vktColorFormatR16UI,       /**< one integer of 16 bits */
    vktColorFormatRG16UI,      /**< two of 16 bits */
    vktColorFormatRGB16UI,     /**< three of 16 bits */
    vktColorFormatRGBA16UI,    /**< four of 16 bits */
    vktColorFormatR32UI,       /**< one integer of 32 bits */
    vktColorFormatRG32UI,      /**< two of 32 bits */
    vktColorFormatRGB32UI,     /**< three of 32 bits */
    vktColorFormatRGBA32UI,    /**< four of 32 bits */
    vktColorFormatR32F,        /**< one float */
    vktColorFormatRG32F,       /**< two floats */
    vktColorFormatRGB32F,      /**< three floats */
    vktColorFormatRGBA32F,     /**< four floats: what vktRenderSV() takes */
    vktColorFormatCount        /**< how many there are */
} vktColorFormat;

/** What a file is opened for. */
typedef enum {
    vktOpenModeRead,     /**< vktInputStreamReadSV() */
    vktOpenModeWrite,    /**< vktOutputStreamWriteSV() */
    vktOpenModeReadWrite /**< either */
} vktOpenMode;

/** An axis of the volume. */
typedef enum {
    vktAxisX, /**< along rows */
    vktAxisY, /**< across rows */
    vktAxisZ  /**< across slices */
} vktAxis;

/** How a volume continues outside. */
typedef enum {
    vktAddressModeWrap,   /**< again from the other side */
    vktAddressModeMirror, /**< mirrored, the border voxel twice */
    vktAddressModeClamp,  /**< with its border voxel */
    vktAddressModeBorder  /**< with 0 */
} vktAddressMode;

/** How values between voxels are found. */
typedef enum {
    vktFilterModeNearest, /**< that of the nearest */
    vktFilterModeLinear   /**< linearly between neighbours, or averaged where many become one */
} vktFilterMode;

/** Two floats. */
typedef struct {
    float x; /**< first */
    float y; /**< second */
} vktVec2f_t;
/** Three floats. */
typedef struct {
    float x; /**< first */
    float y; /**< second */
    float z; /**< third */
} vktVec3f_t;
/** Three integers. */
typedef struct {
    int x; /**< first */
    int y; /**< second */
    int z; /**< third */
} vktVec3i_t;
/** A box in space. */
typedef struct {
    vktVec3f_t min; /**< lower corner */
    vktVec3f_t max; /**< upper corner */
} vktBox3f_t;

/** From where to where memory is copied. */
typedef enum {
    vktCopyKindHostToHost,    /**< on the host */
    vktCopyKindHostToDevice,  /**< the same: memory of vktAllocate() is the host's */
    vktCopyKindDeviceToHost,  /**< the same */
    vktCopyKindDeviceToDevice /**< the same */
} vktCopyKind;
/** Memory of the host, whatever the execution policy: calls move what a GPU works on. Null if there is none. */
VKTAPI void vktAllocate(void** ptr, size_t size);
/** Of vktAllocate(). Takes null, too. */
VKTAPI void vktFree(void* ptr);
/** Copies between regions that do not overlap. */
VKTAPI void vktMemcpy(void* dst, void const* src, size_t size, vktCopyKind ck);

/** A grid of voxels that changes in place. */
typedef struct vktStructuredVolume_impl* vktStructuredVolume;
/** Bricks of cells of several widths that change in place. */
typedef struct vktHierarchicalVolume_impl* vktHierarchicalVolume;
/** Counts of values. */
typedef struct vktHistogram_impl* vktHistogram;
/** Colours. */
typedef struct vktLookupTable_impl* vktLookupTable;
/** A file of any format that vkt knows. */
typedef struct vktVolumeFile_impl* vktVolumeFile;
/** A file of bare voxels, whose name tells what they are, as in volume_4x4x4_uint8.raw, or of any other format. */
typedef struct vktVolumeFile_impl* vktRawFile;
/** What streams read and write: vktVolumeFileGetBase(). */
typedef struct vktVolumeFile_impl* vktDataSource;
/** Reads volumes from a file. */
typedef struct vktInputStream_impl* vktInputStream;
/** Writes volumes to a file. */
typedef struct vktOutputStream_impl* vktOutputStream;
/** Many volumes in three dimensions. */
typedef struct vktArray3D_vktStructuredVolume_impl* vktArray3D_vktStructuredVolume;
/** The number of a lookup table, for vktRenderState_t. */
typedef uint32_t vktResourceHandle;

/** 4. */
VKTAPI uint8_t vktStructuredVolumeGetMaxBytesPerVoxel(void);
/** A volume of stored zeros. The mapping says which values the smallest and the largest integer stand for; floats are
   what they are. */
VKTAPI void vktStructuredVolumeCreate(vktStructuredVolume* volume, int32_t dimX, int32_t dimY, int32_t dimZ,
                                      vktDataFormat dataFormat, float distX, float distY, float distZ, float mappingLo,
                                      float mappingHi);
/** Another volume with the same voxels. */
VKTAPI void vktStructuredVolumeCreateCopy(vktStructuredVolume* volume, vktStructuredVolume rhs);
/** Takes null, too. */
VKTAPI void vktStructuredVolumeDestroy(vktStructuredVolume volume);
/** Makes all voxels stored zeros of other extents. */
VKTAPI void vktStructuredVolumeSetDims3i(vktStructuredVolume volume, int32_t dimX, int32_t dimY, int32_t dimZ);
/** Voxels along each axis. */
VKTAPI void vktStructuredVolumeGetDims3i(vktStructuredVolume volume, int32_t* dimX, int32_t* dimY, int32_t* dimZ);
/** vktStructuredVolumeSetDims3i(). */
VKTAPI void vktStructuredVolumeSetDims3iv(vktStructuredVolume volume, vktVec3i_t dims);
/** Voxels along each axis. */
VKTAPI vktVec3i_t vktStructuredVolumeGetDims3iv(vktStructuredVolume volume);
/** Makes all voxels stored zeros of another type. */
VKTAPI void vktStructuredVolumeSetDataFormat(vktStructuredVolume volume, vktDataFormat dataFormat);
/** The type of the voxels. */
VKTAPI vktDataFormat vktStructuredVolumeGetDataFormat(vktStructuredVolume volume);
/** Changes distances of voxels, and nothing else. */
VKTAPI void vktStructuredVolumeSetDist3f(vktStructuredVolume volume, float distX, float distY, float distZ);
/** Distances of voxels. */
VKTAPI void vktStructuredVolumeGetDist3f(vktStructuredVolume volume, float* distX, float* distY, float* distZ);
/** vktStructuredVolumeSetDist3f(). */
VKTAPI void vktStructuredVolumeSetDist3fv(vktStructuredVolume volume, vktVec3f_t dist);
/** Distances of voxels. */
VKTAPI vktVec3f_t vktStructuredVolumeGetDist3fv(vktStructuredVolume volume);
/** Changes what stored integers stand for, and not the integers. */
VKTAPI void vktStructuredVolumeSetVoxelMapping2f(vktStructuredVolume volume, float lo, float hi);
/** What the smallest and the largest integer stand for. */
VKTAPI void vktStructuredVolumeGetVoxelMapping2f(vktStructuredVolume volume, float* lo, float* hi);
/** vktStructuredVolumeSetVoxelMapping2f(). */
VKTAPI void vktStructuredVolumeSetVoxelMapping2fv(vktStructuredVolume volume, vktVec2f_t mapping);
/** What the smallest and the largest integer stand for. */
VKTAPI vktVec2f_t vktStructuredVolumeGetVoxelMapping2fv(vktStructuredVolume volume);
/** vktStructuredVolumeGetObjectBounds(): volumes have no halo. */
VKTAPI vktBox3f_t vktStructuredVolumeGetDomainBounds(vktStructuredVolume volume);
/** From 0 to dims * dist. */
VKTAPI vktBox3f_t vktStructuredVolumeGetObjectBounds(vktStructuredVolume volume);
/** vktStructuredVolumeGetObjectBounds() by the name that it had before. */
VKTAPI vktBox3f_t vktStructuredVolumeGetWorldBounds(vktStructuredVolume volume);
/** The stored voxels, x fastest, to read and write until the next call that changes the volume. */
VKTAPI uint8_t* vktStructuredVolumeGetData(vktStructuredVolume volume);
/** Sets a voxel, rounded to the nearest value that the type has. Nothing outside of the volume. */
VKTAPI void vktStructuredVolumeSetValue(vktStructuredVolume volume, int32_t x, int32_t y, int32_t z, float value);
/** The value of a voxel. */
VKTAPI void vktStructuredVolumeGetValue(vktStructuredVolume volume, int32_t x, int32_t y, int32_t z, float* value);
/** Sets the bytes of a voxel. */
VKTAPI void vktStructuredVolumeSetBytes(vktStructuredVolume volume, int32_t x, int32_t y, int32_t z,
                                        uint8_t const* data);
/** The bytes of a voxel. */
VKTAPI void vktStructuredVolumeGetBytes(vktStructuredVolume volume, int32_t x, int32_t y, int32_t z, uint8_t* data);
/** Bytes of all voxels. */
VKTAPI size_t vktStructuredVolumeGetSizeInBytes(vktStructuredVolume volume);
/** Does nothing: voxels are on the host between calls, and calls move what a GPU works on. */
VKTAPI void vktStructuredVolumeMigrate(vktStructuredVolume volume);

/** A brick of cells. */
typedef struct {
    vktVec3i_t lower;     /**< where it begins, counted in finest cells */
    vktVec3i_t dims;      /**< cells along each axis */
    size_t offsetInBytes; /**< of its first cell: the bytes of all bricks before it, without gaps */
    unsigned level;       /**< its cells are 1 << level finest cells wide */
} vktBrick_t;
/** 4. */
VKTAPI uint8_t vktHierarchicalVolumeGetMaxBytesPerVoxel(void);
/** A volume of stored zeros in copies of these bricks. */
VKTAPI void vktHierarchicalVolumeCreate(vktHierarchicalVolume* volume, vktBrick_t* bricks, size_t numBricks,
                                        vktDataFormat dataFormat, float mappingLo, float mappingHi);
/** Another volume with the same bricks and cells. */
VKTAPI void vktHierarchicalVolumeCreateCopy(vktHierarchicalVolume* volume, vktHierarchicalVolume rhs);
/** Takes null, too. */
VKTAPI void vktHierarchicalVolumeDestroy(vktHierarchicalVolume volume);
/** Finest cells along each axis, from the lowest brick to the end of the highest. */
VKTAPI vktVec3i_t vktHierarchicalVolumeGetDims3iv(vktHierarchicalVolume volume);
/** vktHierarchicalVolumeGetDims3iv(). */
VKTAPI void vktHierarchicalVolumeGetDims3i(vktHierarchicalVolume volume, int32_t* dimX, int32_t* dimY, int32_t* dimZ);
/** How many bricks there are. */
VKTAPI size_t vktHierarchicalVolumeGetNumBricks(vktHierarchicalVolume volume);
/** The bricks in the order of the program, to read, as long as the volume. */
VKTAPI vktBrick_t* vktHierarchicalVolumeGetBricks(vktHierarchicalVolume volume);
/** The type of the cells. */
VKTAPI vktDataFormat vktHierarchicalVolumeGetDataFormat(vktHierarchicalVolume volume);
/** Changes what stored integers stand for, and not the integers. */
VKTAPI void vktHierarchicalVolumeSetVoxelMapping2f(vktHierarchicalVolume volume, float lo, float hi);
/** What the smallest and the largest integer stand for. */
VKTAPI void vktHierarchicalVolumeGetVoxelMapping2f(vktHierarchicalVolume volume, float* lo, float* hi);
/** vktHierarchicalVolumeSetVoxelMapping2f(). */
VKTAPI void vktHierarchicalVolumeSetVoxelMapping2fv(vktHierarchicalVolume volume, vktVec2f_t mapping);
/** What the smallest and the largest integer stand for. */
VKTAPI vktVec2f_t vktHierarchicalVolumeGetVoxelMapping2fv(vktHierarchicalVolume volume);
/** The stored cells, brick after brick, x fastest, to read and write until the next call that changes the volume. */
VKTAPI uint8_t* vktHierarchicalVolumeGetData(vktHierarchicalVolume volume);

/** A voxel that a function looks at and changes. */
typedef struct {
    uint8_t* bytes;           /**< as stored */
    vktDataFormat dataFormat; /**< type of the voxel */
    float mappingLo;          /**< what the smallest integer stands for */
    float mappingHi;          /**< what the largest integer stands for */
} vktVoxelView_t;
/** The bytes of a value. */
VKTAPI vktError vktMapVoxel(uint8_t* dst, float value, vktDataFormat dataFormat, float mappingLo, float mappingHi);
/** The value of the bytes. */
VKTAPI vktError vktUnmapVoxel(float* value, uint8_t const* src, vktDataFormat dataFormat, float mappingLo,
                              float mappingHi);

/** Sets all voxels. */
VKTAPI vktError vktFillSV(vktStructuredVolume volume, float value);
/** Sets those of a region. */
VKTAPI vktError vktFillRangeSV(vktStructuredVolume volume, int32_t firstX, int32_t firstY, int32_t firstZ,
                               int32_t lastX, int32_t lastY, int32_t lastZ, float value);
/** Sets a region whose ends may lie within voxels; those change by the share of them that is covered. Voxel i reaches
   from i to i + 1. */
VKTAPI vktError vktFillSubVoxelRangeSV(vktStructuredVolume volume, float firstX, float firstY, float firstZ,
                                       float lastX, float lastY, float lastZ, float value);
/** Sets all cells. */
VKTAPI vktError vktFillHV(vktHierarchicalVolume volume, float value);
/** Sets the cells whose centres lie in a region, which counts finest cells as the bricks do. */
VKTAPI vktError vktFillRangeHV(vktHierarchicalVolume volume, int32_t firstX, int32_t firstY, int32_t firstZ,
                               int32_t lastX, int32_t lastY, int32_t lastZ, float value);
/** Makes all voxels background: 0. */
VKTAPI vktError vktDeleteSV(vktStructuredVolume volume);
/** Makes a region background: 0. */
VKTAPI vktError vktDeleteRangeSV(vktStructuredVolume volume, int32_t firstX, int32_t firstY, int32_t firstZ,
                                 int32_t lastX, int32_t lastY, int32_t lastZ);
/** Copies as many voxels as there are in both; values are kept where types differ. */
VKTAPI vktError vktCopySV(vktStructuredVolume dst, vktStructuredVolume src);
/** Copies a region, whose first voxel goes to dstOffset. */
VKTAPI vktError vktCopyRangeSV(vktStructuredVolume dst, vktStructuredVolume src, int32_t firstX, int32_t firstY,
                               int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ, int32_t dstOffsetX,
                               int32_t dstOffsetY, int32_t dstOffsetZ);
/** Mirrors. */
VKTAPI vktError vktFlipSV(vktStructuredVolume dest, vktStructuredVolume source, vktAxis axis);
/** Mirrors a region within itself; its voxel p is then voxel p + dstOffset of dest. */
VKTAPI vktError vktFlipRangeSV(vktStructuredVolume dest, vktStructuredVolume source, int32_t firstX, int32_t firstY,
                               int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ, int32_t dstOffsetX,
                               int32_t dstOffsetY, int32_t dstOffsetZ, vktAxis axis);
/** Turns about an axis, counter-clockwise seen from its tip. The centre is counted in voxels, voxel i reaching from i
   to i + 1. What nothing is turned to keeps its values. */
VKTAPI vktError vktRotateSV(vktStructuredVolume dest, vktStructuredVolume source, vktVec3f_t axis, float angleInRadians,
                            vktVec3f_t centerOfRotation);
/** Turns a region; dest keeps what it has elsewhere. */
VKTAPI vktError vktRotateRangeSV(vktStructuredVolume dest, vktStructuredVolume source, int32_t firstX, int32_t firstY,
                                 int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ, vktVec3f_t axis,
                                 float angleInRadians, vktVec3f_t centerOfRotation);
/** Makes the content larger or smaller about a centre, as vktRotateSV() turns it. */
VKTAPI vktError vktScaleSV(vktStructuredVolume dest, vktStructuredVolume source, vktVec3f_t scalingFactor,
                           vktVec3f_t centerOfScaling);
/** That of a region. */
VKTAPI vktError vktScaleRangeSV(vktStructuredVolume dest, vktStructuredVolume source, int32_t firstX, int32_t firstY,
                                int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ, vktVec3f_t scalingFactor,
                                vktVec3f_t centerOfScaling);
/** Fills dst, whatever its extents and its type, with the content of src. */
VKTAPI vktError vktResampleSV(vktStructuredVolume dst, vktStructuredVolume src, vktFilterMode fm);
/** Contrast-limited adaptive histogram equalisation; otherwise as vktResampleSV(). */
VKTAPI vktError vktResampleCLAHESV(vktStructuredVolume dst, vktStructuredVolume src);
/** Weighted sums of neighbours. The weights, x fastest, of odd extents, belong to the neighbours on the same side of
   the middle. */
VKTAPI vktError vktApplyFilterSV(vktStructuredVolume dest, vktStructuredVolume source, float const* weights,
                                 int32_t dimX, int32_t dimY, int32_t dimZ, vktAddressMode am);
/** Those of a region, whose neighbours may lie outside of it. */
VKTAPI vktError vktApplyFilterRangeSV(vktStructuredVolume dest, vktStructuredVolume source, int32_t firstX,
                                      int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ,
                                      float const* weights, int32_t dimX, int32_t dimY, int32_t dimZ,
                                      vktAddressMode am);
/** Sums of everything before each voxel, and of itself: a summed-volume table. */
VKTAPI vktError vktScanSV(vktStructuredVolume dst, vktStructuredVolume src);
/** Of a region, from its first voxel on, which goes to dstOffset. */
VKTAPI vktError vktScanRangeSV(vktStructuredVolume dst, vktStructuredVolume src, int32_t firstX, int32_t firstY,
                               int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ, int32_t dstOffsetX,
                               int32_t dstOffsetY, int32_t dstOffsetZ);

/** Is called for a voxel, which it may change. */
typedef void (*vktTransformUnaryOp)(int32_t x, int32_t y, int32_t z, vktVoxelView_t voxel);
/** Is called for a voxel and its like in another volume, both of which it may change. */
typedef void (*vktTransformBinaryOp)(int32_t x, int32_t y, int32_t z, vktVoxelView_t voxel1, vktVoxelView_t voxel2);
/** For all voxels, in the order of memory. */
VKTAPI vktError vktTransformSV1(vktStructuredVolume volume, vktTransformUnaryOp unaryOp);
/** For all voxels that both volumes have. */
VKTAPI vktError vktTransformSV2(vktStructuredVolume volume1, vktStructuredVolume volume2,
                                vktTransformBinaryOp binaryOp);
/** For a region. */
VKTAPI vktError vktTransformRangeSV1(vktStructuredVolume volume, int32_t firstX, int32_t firstY, int32_t firstZ,
                                     int32_t lastX, int32_t lastY, int32_t lastZ, vktTransformUnaryOp unaryOp);
/** For a region; to voxel p belongs voxel p - first + volume2Offset of the other volume. */
VKTAPI vktError vktTransformRangeSV2(vktStructuredVolume volume1, vktStructuredVolume volume2, int32_t firstX,
                                     int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ,
                                     int32_t volume2OffsetX, int32_t volume2OffsetY, int32_t volume2OffsetZ,
                                     vktTransformBinaryOp binaryOp);

/** dest = source1 + source2. */
VKTAPI vktError vktSumSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2);
/** The same of a region, whose voxel p goes to voxel p + dstOffset of dest. */
VKTAPI vktError vktSumRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                              int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY,
                              int32_t lastZ, int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ);
/** dest = source1 - source2. */
VKTAPI vktError vktDiffSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2);
/** The same of a region, whose voxel p goes to voxel p + dstOffset of dest. */
VKTAPI vktError vktDiffRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                               int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY,
                               int32_t lastZ, int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ);
/** dest = source1 * source2. */
VKTAPI vktError vktProdSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2);
/** The same of a region, whose voxel p goes to voxel p + dstOffset of dest. */
VKTAPI vktError vktProdRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                               int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY,
                               int32_t lastZ, int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ);
/** dest = source1 / source2. */
VKTAPI vktError vktQuotSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2);
/** The same of a region, whose voxel p goes to voxel p + dstOffset of dest. */
VKTAPI vktError vktQuotRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                               int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY,
                               int32_t lastZ, int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ);
/** dest = the magnitude of source1 - source2. */
VKTAPI vktError vktAbsDiffSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2);
/** The same of a region, whose voxel p goes to voxel p + dstOffset of dest. */
VKTAPI vktError vktAbsDiffRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                                  int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY,
                                  int32_t lastZ, int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ);
/** vktSumSV(): nothing wraps there either. */
VKTAPI vktError vktSafeSumSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2);
/** vktSumRangeSV(). */
VKTAPI vktError vktSafeSumRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                                  int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY,
                                  int32_t lastZ, int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ);
/** vktDiffSV(): nothing wraps there either. */
VKTAPI vktError vktSafeDiffSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2);
/** vktDiffRangeSV(). */
VKTAPI vktError vktSafeDiffRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                                   int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY,
                                   int32_t lastZ, int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ);
/** vktProdSV(): nothing wraps there either. */
VKTAPI vktError vktSafeProdSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2);
/** vktProdRangeSV(). */
VKTAPI vktError vktSafeProdRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                                   int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY,
                                   int32_t lastZ, int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ);
/** vktQuotSV(): nothing wraps there either. */
VKTAPI vktError vktSafeQuotSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2);
/** vktQuotRangeSV(). */
VKTAPI vktError vktSafeQuotRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                                   int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY,
                                   int32_t lastZ, int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ);

/** What is true of many voxels. */
typedef struct {
    float min;         /**< the smallest value */
    float max;         /**< the largest value */
    float mean;        /**< of the values */
    float stddev;      /**< square root of the variance */
    float var;         /**< about the mean, divided by the number of voxels */
    float sum;         /**< of all values; infinite beyond the type */
    float prod;        /**< of all values; infinite beyond the type */
    vktVec3i_t argmin; /**< where the first smallest is */
    vktVec3i_t argmax; /**< where the first largest is */
} vktAggregates_t;
/** Of all voxels. */
VKTAPI vktError vktComputeAggregatesSV(vktStructuredVolume volume, vktAggregates_t* aggregates);
/** Of a region; places are those in the volume. */
VKTAPI vktError vktComputeAggregatesRangeSV(vktStructuredVolume volume, vktAggregates_t* aggregates, int32_t firstX,
                                            int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY,
                                            int32_t lastZ);

/** Counts of zero. */
VKTAPI void vktHistogramCreate(vktHistogram* histogram, size_t numBins);
/** Takes null, too. */
VKTAPI void vktHistogramDestroy(vktHistogram histogram);
/** How many counts there are. */
VKTAPI size_t vktHistogramGetNumBins(vktHistogram histogram);
/** The counts, as long as the histogram. */
VKTAPI size_t* vktHistogramGetBinCounts(vktHistogram histogram);
/** Counts values in bins of equal width from mappingLo to mappingHi; those outside are not counted. */
VKTAPI vktError vktComputeHistogramSV(vktStructuredVolume volume, vktHistogram histogram);
/** Of a region. */
VKTAPI vktError vktComputeHistogramRangeSV(vktStructuredVolume volume, vktHistogram histogram, int32_t firstX,
                                           int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ);

/** An array of null pointers. */
VKTAPI void vktArray3D_vktStructuredVolume_Create(vktArray3D_vktStructuredVolume* arr, vktVec3i_t dims);
/** An array of nothing. */
VKTAPI void vktArray3D_vktStructuredVolume_CreateEmpty(vktArray3D_vktStructuredVolume* arr);
/** Leaves the volumes to who made them. Takes null, too. */
VKTAPI void vktArray3D_vktStructuredVolume_Destroy(vktArray3D_vktStructuredVolume arr);
/** Makes it an array of null pointers. */
VKTAPI void vktArray3D_vktStructuredVolume_Resize(vktArray3D_vktStructuredVolume arr, vktVec3i_t dims);
/** One element, to read and to set; null outside. */
VKTAPI vktStructuredVolume* vktArray3D_vktStructuredVolume_Access(vktArray3D_vktStructuredVolume arr, vktVec3i_t index);
/** The elements, x fastest. */
VKTAPI vktStructuredVolume* vktArray3D_vktStructuredVolume_Data(vktArray3D_vktStructuredVolume arr);
/** Extents. */
VKTAPI vktVec3i_t vktArray3D_vktStructuredVolume_Dims(vktArray3D_vktStructuredVolume arr);
/** Their product. */
VKTAPI size_t vktArray3D_vktStructuredVolume_NumElements(vktArray3D_vktStructuredVolume arr);
/** VKT_TRUE if there is no element. */
VKTAPI vktBool_t vktArray3D_vktStructuredVolume_Empty(vktArray3D_vktStructuredVolume arr);
/** Copies bricks, with so many voxels of their neighbours, into the volumes of the array. */
VKTAPI vktError vktBrickDecomposeSV(vktArray3D_vktStructuredVolume decomp, vktStructuredVolume source,
                                    int32_t brickSizeX, int32_t brickSizeY, int32_t brickSizeZ, int32_t haloSizeNegX,
                                    int32_t haloSizeNegY, int32_t haloSizeNegZ, int32_t haloSizePosX,
                                    int32_t haloSizePosY, int32_t haloSizePosZ);
/** Makes array and volumes as large as they must be, first; the volumes are the program's to destroy. */
VKTAPI vktError vktBrickDecomposeResizeSV(vktArray3D_vktStructuredVolume decomp, vktStructuredVolume source,
                                          int32_t brickSizeX, int32_t brickSizeY, int32_t brickSizeZ,
                                          int32_t haloSizeNegX, int32_t haloSizeNegY, int32_t haloSizeNegZ,
                                          int32_t haloSizePosX, int32_t haloSizePosY, int32_t haloSizePosZ);

/** Where the calls of a thread run. */
typedef enum {
    vktExecutionPolicyDeviceCPU, /**< on the host */
    vktExecutionPolicyDeviceGPU  /**< on a GPU; what has no such version is refused */
} vktExecutionPolicyDevice;
/** How many threads of the host they take. */
typedef enum {
    vktExecutionPolicyHostAPISerial, /**< one */
    vktExecutionPolicyAPIOpenMP,     /**< as many as vkt takes */
    vktExecutionPolicyAPIAuto        /**< as many as vkt takes */
} vktExecutionPolicyHostAPI;
/** What drives the GPU. */
typedef enum {
    vktExecutionPolicyDeviceAPICUDA, /**< CUDA */
    vktExecutionPolicyDeviceAPIAuto  /**< CUDA */
} vktExecutionPolicyDeviceAPI;
/** How the calls of a thread run. */
typedef struct {
    vktExecutionPolicyDevice device;       /**< where */
    vktExecutionPolicyHostAPI hostApi;     /**< threads */
    vktExecutionPolicyDeviceAPI deviceApi; /**< of the GPU */
    vktBool_t printPerformance;            /**< a line with the time of every algorithm, to standard error */
} vktExecutionPolicy_t;
/** Over vkt_set_policy(): the calls of this thread, and of no other, run so from now on. Without a GPU to use, those
   that ask for one fail. */
VKTAPI void vktSetThreadExecutionPolicy(vktExecutionPolicy_t policy);
/** What this thread has set; at first, the CPU with all threads. */
VKTAPI vktExecutionPolicy_t vktGetThreadExecutionPolicy(void);

/** A table of zeros. */
VKTAPI void vktLookupTableCreate(vktLookupTable* lut, int32_t dimX, int32_t dimY, int32_t dimZ, vktColorFormat format);
/** Takes null, too. */
VKTAPI void vktLookupTableDestroy(vktLookupTable lut);
/** Makes it a table of zeros of other extents. */
VKTAPI void vktLookupTableSetDims3i(vktLookupTable lut, int32_t dimX, int32_t dimY, int32_t dimZ);
/** Entries along each axis. */
VKTAPI void vktLookupTableGetDims3i(vktLookupTable lut, int32_t* dimX, int32_t* dimY, int32_t* dimZ);
/** vktLookupTableSetDims3i(). */
VKTAPI void vktLookupTableSetDims3iv(vktLookupTable lut, vktVec3i_t dims);
/** Entries along each axis. */
VKTAPI vktVec3i_t vktLookupTableGetDims3iv(vktLookupTable lut);
/** Makes it a table of zeros of another type. */
VKTAPI void vktLookupTableSetColorFormat(vktLookupTable lut, vktColorFormat format);
/** Type of the entries. */
VKTAPI vktColorFormat vktLookupTableGetColorFormat(vktLookupTable lut);
/** Copies the entries, x fastest. */
VKTAPI void vktLookupTableSetData(vktLookupTable lut, uint8_t* data);
/** The entries, as long as the table. */
VKTAPI uint8_t* vktLookupTableGetData(vktLookupTable lut);
/** Bytes of all entries. */
VKTAPI size_t vktLookupTableGetSizeInBytes(vktLookupTable lut);
/** Does nothing: tables are on the host between calls. */
VKTAPI void vktLookupTableMigrate(vktLookupTable lut);
/** Names the table in vktRenderState_t. */
VKTAPI vktResourceHandle vktLookupTableGetResourceHandle(vktLookupTable lut);

/** How light travels. */
typedef enum {
    vktRenderAlgoRayMarching,    /**< absorption and emission along rays */
    vktRenderAlgoImplicitIso,    /**< iso-surfaces */
    vktRenderAlgoMultiScattering /**< scattered as in a cloud */
} vktRenderAlgo;
/** Limits. */
enum { vktMaxIsoSurfaces = 10 /**< how many iso-surfaces there may be */ };
/** Where the camera is, if the program says. */
typedef struct {
    vktBool_t isSet;     /**< if not, it is where all of the volume can be seen */
    vktVec3f_t eye;      /**< where it is, in world units */
    vktVec3f_t center;   /**< where it looks */
    vktVec3f_t up;       /**< what points upwards in the picture */
    float fovy;          /**< vertical field of view, in degrees */
    float lensRadius;    /**< without effect: everything is sharp */
    float focalDistance; /**< without effect: everything is sharp */
} vktInitialCamera_t;
/** The file that the picture goes to. */
typedef struct {
    vktBool_t enabled;     /**< must be set: there is no window */
    char const* fileName;  /**< a PNG file; one that is there is replaced */
    vktBool_t takeOnClose; /**< without effect: the picture is always taken */
    char key;              /**< without effect */
    char const* message;   /**< is printed to standard error when the file is written, unless null or "" */
} vktSnapshotTool_t;
/** What is drawn, and how. */
typedef struct {
    vktRenderAlgo renderAlgo;             /**< how light travels */
    float dtRayMarching;                  /**< length of a step, in voxels */
    uint16_t numIsoSurfaces;              /**< how many of the next are used */
    float isoSurfaces[vktMaxIsoSurfaces]; /**< values of the surfaces */
    float dtImplicitIso;                  /**< without effect: surfaces are found between samples */
    float majorant;                       /**< without effect: bounds are computed from the volume */
    unsigned animationFrame;              /**< without effect */
    vktResourceHandle rgbaLookupTable;    /**< colours and opacities over the mapping; -1: chosen from the data */
    vktResourceHandle histogram;          /**< without effect: there is no window */
    int viewportWidth;                    /**< pixels across */
    int viewportHeight;                   /**< pixels down */
    vktBool_t sRGB;                       /**< must be set: PNG files are */
    vktInitialCamera_t initialCamera;     /**< where the camera is */
    vktSnapshotTool_t snapshotTool;       /**< where the picture goes */
} vktRenderState_t;
/** Something to begin with. */
VKTAPI void vktRenderStateDefaultInit(vktRenderState_t* renderState);
/** Draws a volume into the file of the snapshot tool; then copies the state to newRenderState, if that is not null. */
VKTAPI vktError vktRenderSV(vktStructuredVolume volume, vktRenderState_t renderState, vktRenderState_t* newRenderState);

/** What a file holds. */
typedef struct {
    vktBool_t isStructured;   /**< voxels */
    vktVec3i_t dims;          /**< of voxels */
    vktDataFormat dataFormat; /**< of voxels */
    vktBool_t isHierarchical; /**< bricks, which these functions do not read */
} vktVolumeFileHeader_t;
/** Makes it all zeros. */
static inline void vktVolumeFileHeaderDefaultInit(vktVolumeFileHeader_t* header) {
    vktVolumeFileHeader_t const nothing = {0, {0, 0, 0}, vktDataFormatUnspecified, 0};
    *header = nothing;
}
/** A file of a format that its content or its name tells. */
VKTAPI void vktVolumeFileCreateS(vktVolumeFile* file, char const* fileName, vktOpenMode om);
/** For streams. */
VKTAPI vktDataSource vktVolumeFileGetBase(vktVolumeFile file);
/** Takes null, too. */
VKTAPI void vktVolumeFileDestroy(vktVolumeFile file);
/** All zeros if there is nothing to read. */
VKTAPI vktVolumeFileHeader_t vktVolumeFileGetHeader(vktVolumeFile file);
/** The next bytes of the voxels, as vktRawFileRead(). */
VKTAPI size_t vktVolumeFileRead(vktVolumeFile file, char* buf, size_t len);
/** VKT_TRUE if there is something to read. */
VKTAPI vktBool_t vktVolumeFileGood(vktVolumeFile file);
/** vktVolumeFileCreateS() with a mode of fopen(): "r", or one that writes. */
VKTAPI void vktRawFileCreateS(vktRawFile* file, char const* fileName, char const* mode);
/** For streams. */
VKTAPI vktDataSource vktRawFileGetBase(vktRawFile file);
/** Takes null, too. */
VKTAPI void vktRawFileDestroy(vktRawFile file);
/** The next bytes of the voxels as they are stored, x fastest, in the order of the machine; returns how many there
 * were.
 */
VKTAPI size_t vktRawFileRead(vktRawFile file, char* buf, size_t len);
/** VKT_TRUE if there is something to read. */
VKTAPI vktBool_t vktRawFileGood(vktRawFile file);
/** Of the voxels; zeros if there is nothing to read. */
VKTAPI vktVec3i_t vktRawFileGetDims3iv(vktRawFile file);
/** Of the voxels. */
VKTAPI vktDataFormat vktRawFileGetDataFormat(vktRawFile file);
/** Begins to read. */
VKTAPI void vktInputStreamCreate(vktInputStream* stream, vktDataSource source);
/** Takes null, too. */
VKTAPI void vktInputStreamDestroy(vktInputStream stream);
/** Reads the voxels, as many as there are in both. Those of the same type are taken as they are stored, under the
   mapping of the volume; others keep their values. Where bytes of the file were read or passed over before, those that
   come next become the volume, which is to have the type of the file. */
VKTAPI vktError vktInputStreamReadSV(vktInputStream stream, vktStructuredVolume volume);
/** The next bytes of the file become a region of the volume, row after row; vktReadError if there are fewer. The volume
   is to have the type of the file, and the region is to lie in it. */
VKTAPI vktError vktInputStreamReadRangeSV(vktInputStream stream, vktStructuredVolume volume, int32_t firstX,
                                          int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ);
/** What is read next begins at this byte of the voxels, of which the first is byte 0: headers do not count. */
VKTAPI vktError vktInputStreamSeek(vktInputStream stream, size_t pos);
/** Begins to write. */
VKTAPI void vktOutputStreamCreate(vktOutputStream* stream, vktDataSource source);
/** Takes null, too. */
VKTAPI void vktOutputStreamDestroy(vktOutputStream stream);
/** Writes a volume in place of what the file was. */
VKTAPI vktError vktOutputStreamWriteSV(vktOutputStream stream, vktStructuredVolume volume);

#ifdef __cplusplus
}
#endif

#endif
