/** \file
   The C API of vkt: volumes in memory, read, written, measured and worked on with the words of the command line.
   SPDX-License-Identifier: MIT

   Volumes are opaque. Functions that can fail return a status, which is the exit code that the command would have; what
   went wrong is said by vkt_error() and vkt_error_hint(). Nothing is thrown across this border. Options are words as on
   the command line, {"--dims", "40,30,10"}, and are those of the command that does the same. Device, number of threads
   and memory follow vkt_set_policy(), and VKT_DEVICE, VKT_THREADS and VKT_MEMORY. Memory of volumes that were freed is
   kept for the results that come next, see vkt_trim(). A pointer that must not be null, but is, makes a call fail with
   VKT_USAGE. What a call that fails would have set (*volume, *result, *json) stays untouched. Several threads may use
   different volumes, and read from the same one. */
#ifndef LIBVKT_C_VKT_H
#define LIBVKT_C_VKT_H

#include <stddef.h>
#include <stdint.h>

/** What programs link to. */
#define VKT_API __attribute__((visibility("default")))

#ifdef __cplusplus
extern "C" {
#endif

/** How a call ended. */
typedef enum vkt_status {
    VKT_OK = 0,        /**< as it should */
    VKT_FAILURE = 1,   /**< the operation itself failed */
    VKT_USAGE = 2,     /**< the request makes no sense: option, argument, region */
    VKT_DATA = 3,      /**< the input is malformed or truncated, or whoever made it failed */
    VKT_IO = 4,        /**< a file or descriptor cannot be read or written */
    VKT_RESOURCES = 5, /**< memory, device or limit exhausted */
    VKT_CANCELLED = 6  /**< the thread's vkt_progress_function ended it */
} vkt_status;

/** Voxels, or bricks of cells, with a header. */
typedef struct vkt_volume vkt_volume;

/** What a volume is. Position of the centre of voxel i = origin + sum over the axes a of
   direction[3a .. 3a+2] * spacing[a] * i[a]; physical value = slope * stored value + intercept. */
typedef struct vkt_description {
    int64_t dims[3];     /**< voxels along x, y, z; of a hierarchical volume, finest cells */
    char const* dtype;   /**< uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64 */
    double origin[3];    /**< of the first voxel's centre, in the world */
    double spacing[3];   /**< of voxels along x, y, z */
    double direction[9]; /**< one unit vector per axis of the volume */
    double slope;        /**< of the line from stored to physical values */
    double intercept;    /**< physical value of a stored 0 */
    char const* units;   /**< of the physical values; "" if unknown */
    int hierarchical;    /**< bricks of several resolutions: `apply` "resample" makes a grid of it */
    char const* space;   /**< what the world's axes mean, for example "left-posterior-superior"; "" if unknown */
} vkt_description;

/** The version of the library that the program runs with, "0.1.0". */
VKT_API char const* vkt_version(void);

/** About the last call of this thread that failed; valid until it makes another call. One line of UTF-8 that a terminal
   shows and does not act on, whatever files and arguments say. */
VKT_API char const* vkt_error(void);
/** What to do instead; may be "". */
VKT_API char const* vkt_error_hint(void);
/** The status of the last call of this thread that failed. */
VKT_API vkt_status vkt_error_status(void);

/** How the calls of a thread run whose words say nothing of --device, --threads and --memory. */
typedef struct vkt_policy {
    char const* device; /**< "auto", "cpu", "gpu", "gpu:N", "gpu:all"; null: what VKT_DEVICE says, or "auto" */
    int threads;        /**< to compute with; 0: what VKT_THREADS says, or one for each processor that it may use */
    size_t memory;      /**< bytes that a volume may take; 0: what VKT_MEMORY says, or a quarter of the machine's */
} vkt_policy;
/** From now on the calls of this thread run so; null: as they did at first. Other threads are not affected, and those
   that this one starts inherit nothing. What "gpu" cannot do is refused, not done elsewhere. VKT_RESOURCES if there is
   no such device; then all stays as it was. */
VKT_API vkt_status vkt_set_policy(vkt_policy const* policy);
/** How calls of this thread run, without a 0 or null; `device` is valid until it asks again. */
VKT_API vkt_status vkt_get_policy(vkt_policy* policy);

/** Is told which share of a call is done: an estimate between 0 and 1 that never goes back. Ends the call by returning
   another number than 0. It must not make calls of this library on volumes of the call, nor leave by longjmp(). */
typedef int (*vkt_progress_function)(double done, void* user);
/** Has the calls of this thread watched that read, write, apply, measure, draw or stream: the function is called in
   this thread, at first when a call begins to work and then about every 20 ms; null ends that. A call that it ended
   returns VKT_CANCELLED within what a thread does between two looks, mostly milliseconds, and leaves nothing behind: no
   result, no file, no temporary. */
VKT_API void vkt_set_progress(vkt_progress_function function, void* user);

/** Names of the operations that vkt_apply() and vkt_measure() know, ended by a null pointer; also those by which people
   look for them, "reorient" for "permute" and "edit" for "set". */
VKT_API char const* const* vkt_operations(void);
/** 1 if the operation of this name makes no volume but reports, which is for vkt_measure(); 0 if it makes one, which is
   for vkt_apply(), or if there is none. */
VKT_API int vkt_measures(char const* name);
/** What the library knows of an operation, as a JSON object: its texts, what it makes, its parameters with their help,
   kinds, choices and defaults (libvkt/engine/operation_help.h says which keys). For vkt_free_text(). */
VKT_API vkt_status vkt_operation_help(char const* name, char** json);

/** Reads the volume of a file, or maps that of a segment of shared memory ("shm:NAME"). Options are those of
   `vkt read`, also "--trust-paths", and "--index N" for a file of several volumes, which vkt_series_open() reads one
   after another. */
VKT_API vkt_status vkt_read(char const* path, char const* const* words, size_t count, vkt_volume** volume);

/** One voxel of uint8 at the origin, 1 wide: something to begin a description with. */
VKT_API void vkt_default_description(vkt_description* description);
/** A volume with a copy of the voxels, x fastest, then y, then z; zeros if `voxels` is null. */
VKT_API vkt_status vkt_create(vkt_description const* description, void const* voxels, vkt_volume** volume);
/** Called once, by any thread, when nothing uses those voxels any more. */
typedef void (*vkt_release_function)(void* user);
/** A structured volume of a header as vkt_header() gives it, with history and attributes; "kind", "dims", "dtype",
   "spacing", "origin", "direction", "slope" and "intercept" must be there. The voxels, `bytes` of them, x fastest, are
   copied if `release` is null; else they are used where they are, aligned to their size, and must not change until
   then. A call that fails does not release them. */
VKT_API vkt_status vkt_create_from_header(char const* json, void const* voxels, size_t bytes,
                                          vkt_release_function release, void* user, vkt_volume** volume);
/** The same of voxels in memory of a GPU, 256-byte aligned, once all that was asked of that GPU before is done: copied
   there if `release` is null, else used where they are. VKT_USAGE for memory of the host, VKT_RESOURCES without GPU. */
VKT_API vkt_status vkt_create_on_device(char const* json, void const* voxels, size_t bytes,
                                        vkt_release_function release, void* user, vkt_volume** volume);
/** Takes null, too. */
VKT_API void vkt_free(vkt_volume* volume);

/** The strings stay valid as long as the volume. */
VKT_API vkt_status vkt_describe(vkt_volume const* volume, vkt_description* description);
/** The voxels in place, x fastest, valid as long as the volume, and their bytes (`bytes` may be null). */
VKT_API vkt_status vkt_voxels(vkt_volume const* volume, void const** voxels, size_t* bytes);
/** Where the voxels or cells are: `host` is 1 if they are in memory of the host, `device` the index of the GPU that has
   them, or -1. They may be in both; calls move them just before use, and what is there already stays. */
VKT_API vkt_status vkt_residence(vkt_volume const* volume, int* host, int* device);
/** Brings them there before use: "cpu", "gpu" or "gpu:N". What a GPU has already stays on that one. */
VKT_API vkt_status vkt_migrate(vkt_volume const* volume, char const* device);
/** The voxels in memory of a GPU, that of the policy of the thread if none has them yet, as vkt_voxels(); all work on
   them is done. `device` (may be null) is its index. */
VKT_API vkt_status vkt_device_voxels(vkt_volume const* volume, void const** voxels, size_t* bytes, int* device);
/** All that the header says, attributes and history too, as `vkt info --json`. For vkt_free_text(). */
VKT_API vkt_status vkt_header(vkt_volume const* volume, char** json);

/** Writes a file whose name tells the format. Options are those of `vkt write`: --force, --compress, --format. */
VKT_API vkt_status vkt_write(vkt_volume const* volume, char const* path, char const* const* words, size_t count);

/** How many volumes a file has of those that the words, which are those of vkt_read(), ask for. Headers are read, and
   no voxels but of compressed files and of streams, which are read to their end; a pipe is used up by that. */
VKT_API vkt_status vkt_count_volumes(char const* path, char const* const* words, size_t count, int64_t* volumes);
/** Several volumes, one after another: of a file, of files that a pattern names, slices or bricks. */
typedef struct vkt_series_reader vkt_series_reader;
/** Opens a file of several volumes, such as times or channels, or of one. Options are those of vkt_read(), of which
   "--index A:B:S" chooses some. */
VKT_API vkt_status vkt_series_open(char const* path, char const* const* words, size_t count,
                                   vkt_series_reader** reader);
/** Reads the next volume, or VKT_OK and a null pointer after the last. After a failure every further call fails. */
VKT_API vkt_status vkt_series_next(vkt_series_reader* reader, vkt_volume** volume);
/** Takes null, too. */
VKT_API void vkt_series_free_reader(vkt_series_reader* reader);
/** A file that several volumes are being written to. */
typedef struct vkt_series_writer vkt_series_writer;
/** Begins a file whose name tells the format, "out.nii.gz"; or one for each volume, "out%03d.nrrd", of which each
   appears when it is complete. Options are those of vkt_write(). */
VKT_API vkt_status vkt_series_create(char const* path, char const* const* words, size_t count,
                                     vkt_series_writer** writer);
/** Writes the next volume, which a format may ask to be like the first. After a failure every further call fails. */
VKT_API vkt_status vkt_series_put(vkt_series_writer* writer, vkt_volume const* volume);
/** The series is complete: its file appears. */
VKT_API vkt_status vkt_series_close(vkt_series_writer* writer);
/** Of a file that was not closed nothing remains. Takes null, too. */
VKT_API void vkt_series_free_writer(vkt_series_writer* writer);

/** Volumes on one another along z, {"stack", "--along", "z"}: they must have one type, one extent along x and y, and
   lie behind one another, if they say where they lie; "--force-uniform" takes them in this order all the same. */
VKT_API vkt_status vkt_stack(vkt_volume const* const* volumes, size_t volume_count, char const* const* words,
                             size_t count, vkt_volume** result);
/** The slices of a volume along z, each with its place in the world. The volume may be freed before the reader. */
VKT_API vkt_status vkt_split(vkt_volume const* volume, vkt_series_reader** slices);
/** The bricks of a volume, x fastest, which say in attributes where they belong. Options are those of `vkt brick`:
   --size, --ghost, --boundary. The volume may be freed before the reader. */
VKT_API vkt_status vkt_brick(vkt_volume const* volume, char const* const* words, size_t count,
                             vkt_series_reader** bricks);
/** Bricks put together again, in any order: bit for bit the volume that was cut, or what was made of its bricks. Ghosts
   are dropped; bricks that are missing, overlap or belong elsewhere are refused. */
VKT_API vkt_status vkt_merge(vkt_volume const* const* bricks, size_t count, vkt_volume** result);

/** Applies one operation, {"filter", "gaussian", "--sigma", "2"}. Inputs are passed beside the words; where the command
   takes them between other arguments, "-" stands for the next: {"arith", "sub", "-", "-"}, {"arith", "mul", "-", "2"}.
   Inputs that no word stands for come first. One more volume than the operation takes is one whose file --like, or the
   first argument of "filter kernel", would name: {"resample", "--like", "-"}, {"filter", "kernel", "-"}. --device,
   --threads and --memory are understood. */
VKT_API vkt_status vkt_apply(char const* const* words, size_t count, vkt_volume const* const* inputs,
                             size_t input_count, vkt_volume** result);
/** What a voxel becomes: x, y and z are its indices, `value` is physical, `user` is what vkt_transform() was given. */
typedef double (*vkt_voxel_function)(int64_t x, int64_t y, int64_t z, double value, void* user);
/** Calls a function once for every voxel, in this thread and in the order of the voxels in memory. Results are stored
   in the volume's type, rounded and limited to its range; options: --dtype TYPE, --roi REGION, beyond which voxels keep
   their values, --memory. Without a callback, {"transform", "v * 2 + x"} for vkt_apply() is faster. */
VKT_API vkt_status vkt_transform(vkt_volume const* volume, vkt_voxel_function function, void* user,
                                 char const* const* words, size_t count, vkt_volume** result);
/** What was lost when this volume was computed, "12 of 4096 voxels clipped", one remark a line; "" if nothing. */
VKT_API char const* vkt_remarks(vkt_volume const* volume);
/** What the operation that made this volume reported (label: sizes, threshold --otsu: the threshold), as JSON; "" if
   nothing. */
VKT_API char const* vkt_report(vkt_volume const* volume);

/** What an operation without a volume reports, {"diff", "--ssim"}, {"stats", "--per", "z"}, {"info"}: the JSON that the
   command prints with --json, {"text": …} of one that prints text alone. Words and inputs are those of vkt_apply(); of
   several volumes, {"stats"}, the JSON is a list in their order. For vkt_free_text(). */
VKT_API vkt_status vkt_measure(char const* const* words, size_t count, vkt_volume const* const* inputs,
                               size_t input_count, char** json);
/** vkt_measure() of {"stats"} and these words. */
VKT_API vkt_status vkt_statistics(vkt_volume const* volume, char const* const* words, size_t count, char** json);

/** The volumes of a stream of vkt, see vkt-stream(5), one after another. */
typedef struct vkt_stream_reader vkt_stream_reader;
/** Reads what a command of vkt, or a vkt_stream_writer, writes into this pipe, socket or file. The descriptor stays the
   program's, which may close it at once; what else lies in it after the stream may have been read, too. */
VKT_API vkt_status vkt_stream_open(int descriptor, vkt_stream_reader** reader);
/** The next volume, or VKT_OK and a null pointer after the last. VKT_DATA if the stream is damaged or breaks off; and
   if the command at its other end failed, with that command's name and message in vkt_error(). After a failure every
   further call fails. Cancelled also while it waits for bytes. */
VKT_API vkt_status vkt_stream_next(vkt_stream_reader* reader, vkt_volume** volume);
/** Whoever writes finds the pipe closed if the stream was not read to its end. Takes null, too. */
VKT_API void vkt_stream_free_reader(vkt_stream_reader* reader);

/** A stream that is being written. */
typedef struct vkt_stream_writer vkt_stream_writer;
/** Begins a stream. The descriptor stays the program's, and must stay open until the writer is freed. Options:
   --transport pipe, shm or gpu (else what VKT_TRANSPORT says; shm gives voxels to a vkt at the other end of a pipe
   without copying them, gpu leaves them in the memory of the first GPU for one that works there), --no-checksum. A
   reader that goes away is VKT_IO and no signal. */
VKT_API vkt_status vkt_stream_create(int descriptor, char const* const* words, size_t count,
                                     vkt_stream_writer** writer);
/** Writes a volume. If that fails, the reader is told why. Cancelled also while it waits for a pipe to take bytes; what
   follows in the stream means nothing then, and its reader finds it broken off. */
VKT_API vkt_status vkt_stream_put(vkt_stream_writer* writer, vkt_volume const* volume);
/** Tells the reader, whose call or command fails with it, why no more will come; in place of vkt_stream_close(). */
VKT_API vkt_status vkt_stream_fail(vkt_stream_writer* writer, char const* message);
/** The stream is whole; only freeing is left. The reader sees the end when the program closes the descriptor. */
VKT_API vkt_status vkt_stream_close(vkt_stream_writer* writer);
/** Why voxels do not go the way that was asked for; "" if they do. Valid until the next call. */
VKT_API char const* vkt_stream_notice(vkt_stream_writer const* writer);
/** Of a stream that was not closed, the reader is told that it is not whole. Takes null, too. */
VKT_API void vkt_stream_free_writer(vkt_stream_writer* writer);

/** A picture of a volume. */
typedef struct vkt_picture vkt_picture;
/** Draws a volume. Options are those of `vkt render` but for those of files and windows,
   {"--view", "x", "--size", "640x480", "--noise", "1"}. */
VKT_API vkt_status vkt_render(vkt_volume const* volume, char const* const* words, size_t count, vkt_picture** picture);
/** Pixels across; 0 of a null picture. */
VKT_API int vkt_picture_width(vkt_picture const* picture);
/** Pixels down; 0 of a null picture. */
VKT_API int vkt_picture_height(vkt_picture const* picture);
/** Four bytes a pixel: sRGB over the background and alpha, which is 255 where the background is opaque. Row by row from
   the top, valid as long as the picture. Null of a null picture. */
VKT_API unsigned char const* vkt_picture_bytes(vkt_picture const* picture);
/** Four floats a pixel: linear light of the volume alone, premultiplied, and alpha. Otherwise as vkt_picture_bytes().
 */
VKT_API float const* vkt_picture_light(vkt_picture const* picture);
/** What is not shown as it is, in one line; "" if nothing. */
VKT_API char const* vkt_picture_remarks(vkt_picture const* picture);
/** How it was drawn, in one line. */
VKT_API char const* vkt_picture_report(vkt_picture const* picture);
/** A PNG file of it that says how it was made; valid as long as the picture. */
VKT_API vkt_status vkt_picture_png(vkt_picture const* picture, void const** bytes, size_t* size);
/** Takes null, too. */
VKT_API void vkt_free_picture(vkt_picture* picture);

/** Surfaces through a volume, as triangles. */
typedef struct vkt_surface vkt_surface;
/** One of them; valid as long as the surface. */
typedef struct vkt_surface_view {
    int64_t label;             /**< whose surface it is; 0 of a value */
    int64_t vertices;          /**< how many */
    double const* coordinates; /**< x, y and z of each, in the world */
    int64_t triangles;         /**< how many */
    uint32_t const* corners;   /**< three numbers of vertices of each, counterclockwise seen from outside */
} vkt_surface_view;
/** Makes the closed surface of a value, {"--iso", "0.5"}, or of each label, {"--labels"}. Options are those of
   `vkt mesh` but for those of its file. VKT_RESOURCES where the triangles exceed the memory. */
VKT_API vkt_status vkt_make_surface(vkt_volume const* volume, char const* const* words, size_t count,
                                    vkt_surface** surface);
/** How many: one of a value, and one of each label. 0 of a null surface. */
VKT_API int64_t vkt_surface_parts(vkt_surface const* surface);
/** VKT_USAGE for a part that is not there; they are counted from 0. */
VKT_API vkt_status vkt_surface_part(vkt_surface const* surface, int64_t part, vkt_surface_view* view);
/** What `vkt mesh --json` reports: vertices, triangles, area, volume and Euler characteristic. */
VKT_API char const* vkt_surface_report(vkt_surface const* surface);
/** That a value has no surface, in one line; "" if nothing. */
VKT_API char const* vkt_surface_remarks(vkt_surface const* surface);
/** Writes a file whose name tells the format: .stl, .ply, .obj or .vtp. Options: --format, --ascii, --normals,
   --force. */
VKT_API vkt_status vkt_surface_write(vkt_surface const* surface, char const* path, char const* const* words,
                                     size_t count);
/** Takes null, too. */
VKT_API void vkt_free_surface(vkt_surface* surface);

/** Gives memory of freed volumes back to the system; returns how many bytes. Until then up to as much as a volume may
   take is kept, since touching fresh memory can cost more than an operation. The system takes it back by itself when
   memory is short, and it is given back where the limit of a control group or of the process would be met. */
VKT_API size_t vkt_trim(void);

/** Takes null, too. */
VKT_API void vkt_free_text(char* text);

#ifdef __cplusplus
}
#endif

#endif
