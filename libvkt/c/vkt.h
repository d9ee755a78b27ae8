/* The C API of vkt: volumes in memory, read, written, measured and worked on with the words of the command line.
   SPDX-License-Identifier: MIT

   Volumes are opaque. Functions that can fail return a status, which is the exit code that the command would have; what
   went wrong is said by vkt_error() and vkt_error_hint(). Nothing is thrown across this border. Options are words as on
   the command line, {"--dims", "40,30,10"}, and are those of the command that does the same. The number of threads and
   the memory that a volume may take follow VKT_THREADS and VKT_MEMORY. Memory of volumes that were freed is kept for
   the results that come next, see vkt_trim(). A pointer that must not be null, but is, makes a call fail with
   VKT_USAGE. What a call that fails would have set (*volume, *result, *json) stays untouched. Several threads may use
   different volumes, and read from the same one. */
#ifndef LIBVKT_C_VKT_H
#define LIBVKT_C_VKT_H

#include <stddef.h>
#include <stdint.h>

#define VKT_API __attribute__((visibility("default")))

#ifdef __cplusplus
extern "C" {
#endif

typedef enum vkt_status {
    VKT_OK = 0,
    VKT_FAILURE = 1,  /* the operation itself failed */
    VKT_USAGE = 2,    /* the request makes no sense: option, argument, region */
    VKT_DATA = 3,     /* the input is malformed or truncated */
    VKT_IO = 4,       /* a file cannot be read or written */
    VKT_RESOURCES = 5 /* memory, device or limit exhausted */
} vkt_status;

typedef struct vkt_volume vkt_volume;

/* What a volume is. Position of the centre of voxel i = origin + sum over the axes a of
   direction[3a .. 3a+2] * spacing[a] * i[a]; physical value = slope * stored value + intercept. */
typedef struct vkt_description {
    int64_t dims[3];   /* voxels along x, y, z; of a hierarchical volume, finest cells */
    char const* dtype; /* uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64 */
    double origin[3];
    double spacing[3];
    double direction[9]; /* one unit vector per axis of the volume */
    double slope, intercept;
    char const* units; /* of the physical values; "" if unknown */
    int hierarchical;  /* bricks of several resolutions: `apply` "resample" makes a grid of it */
    char const* space; /* what the world's axes mean, for example "left-posterior-superior"; "" if unknown */
} vkt_description;

VKT_API char const* vkt_version(void);

/* About the last call of this thread that failed; valid until it makes another call. One line of UTF-8 that a terminal
   shows and does not act on, whatever files and arguments say. */
VKT_API char const* vkt_error(void);
VKT_API char const* vkt_error_hint(void); /* what to do instead; may be "" */
VKT_API vkt_status vkt_error_status(void);

/* Names of the operations that vkt_apply() and vkt_measure() know, ended by a null pointer. */
VKT_API char const* const* vkt_operations(void);
/* 1 if the operation of this name makes no volume but reports, which is for vkt_measure(); 0 if it makes one, which is
   for vkt_apply(), or if there is none. */
VKT_API int vkt_measures(char const* name);
/* What the library knows of an operation, as a JSON object: its texts, what it makes, its parameters with their help,
   kinds, choices and defaults (libvkt/engine/operation_help.h says which keys). For vkt_free_text(). */
VKT_API vkt_status vkt_operation_help(char const* name, char** json);

/* Reads the volume of a file, or maps that of a segment of shared memory ("shm:NAME"). Options are those of `vkt read`,
   also "--trust-paths", and "--index N" for a file of several volumes. */
VKT_API vkt_status vkt_read(char const* path, char const* const* words, size_t count, vkt_volume** volume);

/* One voxel of uint8 at the origin, 1 wide: something to begin a description with. */
VKT_API void vkt_default_description(vkt_description* description);
/* A volume with a copy of the voxels, x fastest, then y, then z; zeros if `voxels` is null. */
VKT_API vkt_status vkt_create(vkt_description const* description, void const* voxels, vkt_volume** volume);
/* Called once, by any thread, when nothing uses those voxels any more. */
typedef void (*vkt_release_function)(void* user);
/* A structured volume of a header as vkt_header() gives it, with history and attributes; "kind", "dims", "dtype",
   "spacing", "origin", "direction", "slope" and "intercept" must be there. The voxels, `bytes` of them, x fastest, are
   copied if `release` is null; else they are used where they are, aligned to their size, and must not change until
   then. A call that fails does not release them. */
VKT_API vkt_status vkt_create_from_header(char const* json, void const* voxels, size_t bytes,
                                          vkt_release_function release, void* user, vkt_volume** volume);
VKT_API void vkt_free(vkt_volume* volume);

/* The strings stay valid as long as the volume. */
VKT_API vkt_status vkt_describe(vkt_volume const* volume, vkt_description* description);
/* The voxels in place, x fastest, valid as long as the volume, and their bytes (`bytes` may be null). */
VKT_API vkt_status vkt_voxels(vkt_volume const* volume, void const** voxels, size_t* bytes);
/* All that the header says, attributes and history too, as `vkt info --json`. For vkt_free_text(). */
VKT_API vkt_status vkt_header(vkt_volume const* volume, char** json);

/* Writes a file whose name tells the format. Options are those of `vkt write`: --force, --compress, --format. */
VKT_API vkt_status vkt_write(vkt_volume const* volume, char const* path, char const* const* words, size_t count);

/* Applies one operation, {"filter", "gaussian", "--sigma", "2"}. Inputs are passed beside the words; where the command
   takes them between other arguments, "-" stands for the next: {"arith", "sub", "-", "-"}, {"arith", "mul", "-", "2"}.
   --device, --threads and --memory are understood. */
VKT_API vkt_status vkt_apply(char const* const* words, size_t count, vkt_volume const* const* inputs,
                             size_t input_count, vkt_volume** result);
/* What a voxel becomes: x, y and z are its indices, `value` is physical, `user` is what vkt_transform() was given. */
typedef double (*vkt_voxel_function)(int64_t x, int64_t y, int64_t z, double value, void* user);
/* Calls a function once for every voxel, in this thread and in the order of the voxels in memory. Results are stored in
   the volume's type, rounded and limited to its range; options: --dtype TYPE, --roi REGION, beyond which voxels keep
   their values, --memory. Without a callback, {"transform", "v * 2 + x"} for vkt_apply() is faster. */
VKT_API vkt_status vkt_transform(vkt_volume const* volume, vkt_voxel_function function, void* user,
                                 char const* const* words, size_t count, vkt_volume** result);
/* What was lost when this volume was computed, "12 of 4096 voxels clipped", one remark a line; "" if nothing. */
VKT_API char const* vkt_remarks(vkt_volume const* volume);
/* What the operation that made this volume reported (label: sizes, threshold --otsu: the threshold), as JSON; "" if
   nothing. */
VKT_API char const* vkt_report(vkt_volume const* volume);

/* What an operation without a volume reports, {"diff", "--ssim"}, {"stats", "--per", "z"}, {"info"}: the JSON that the
   command prints with --json, {"text": …} of one that prints text alone. Words and inputs are those of vkt_apply(). For
   vkt_free_text(). */
VKT_API vkt_status vkt_measure(char const* const* words, size_t count, vkt_volume const* const* inputs,
                               size_t input_count, char** json);
/* vkt_measure() of {"stats"} and these words. */
VKT_API vkt_status vkt_statistics(vkt_volume const* volume, char const* const* words, size_t count, char** json);

/* A picture of a volume. Options are those of `vkt render` but for those of files and windows,
   {"--view", "x", "--size", "640x480", "--noise", "1"}. */
typedef struct vkt_picture vkt_picture;
VKT_API vkt_status vkt_render(vkt_volume const* volume, char const* const* words, size_t count, vkt_picture** picture);
/* Row by row from the top, valid as long as the picture. Null of a null picture. */
VKT_API int vkt_picture_width(vkt_picture const* picture);
VKT_API int vkt_picture_height(vkt_picture const* picture);
/* Four bytes a pixel: sRGB over the background and alpha, which is 255 where the background is opaque. */
VKT_API unsigned char const* vkt_picture_bytes(vkt_picture const* picture);
/* Four floats a pixel: linear light of the volume alone, premultiplied, and alpha. */
VKT_API float const* vkt_picture_light(vkt_picture const* picture);
/* What is not shown as it is, one remark a line; how it was drawn, in one line. */
VKT_API char const* vkt_picture_remarks(vkt_picture const* picture);
VKT_API char const* vkt_picture_report(vkt_picture const* picture);
/* A PNG file of it that says how it was made; valid as long as the picture. */
VKT_API vkt_status vkt_picture_png(vkt_picture const* picture, void const** bytes, size_t* size);
VKT_API void vkt_free_picture(vkt_picture* picture);

/* Gives memory of freed volumes back to the system; returns how many bytes. Until then up to as much as a volume may
   take is kept, since touching fresh memory can cost more than an operation. The system takes it back by itself when
   memory is short, and it is given back where the limit of a control group or of the process would be met. */
VKT_API size_t vkt_trim(void);

VKT_API void vkt_free_text(char* text);

#ifdef __cplusplus
}
#endif

#endif
