# The C API: a program in C99 builds against the installed tree, and does what the command does.
load helper

setup_file() {
    [ -n "${VKT_BUILD:-}" ] && [ -z "${VKT_SANITIZED:-}" ] || return 0
    cmake --install "$VKT_BUILD" --prefix "$BATS_FILE_TMPDIR/installed" >"$BATS_FILE_TMPDIR/log"
    cat >"$BATS_FILE_TMPDIR/program.c" <<'EOF'
#include "libvkt/c/vkt.h"

#include <stdio.h>
#include <string.h>

#define OPTIONS(...) (char const*[]){__VA_ARGS__}, sizeof((char const*[]){__VA_ARGS__}) / sizeof(char const*)

static int complain(void) {
    fprintf(stderr, "%d: %s [%s]\n", (int)vkt_error_status(), vkt_error(), vkt_error_hint());
    return vkt_error_status();
}

/* program apply OUT IN WORD...: applies an operation to a file. */
static int apply_to_file(int argc, char** argv) {
    vkt_volume *in = NULL, *out = NULL;
    int status = vkt_read(argv[3], NULL, 0, &in);
    vkt_volume const* inputs[] = {in};
    if (status == VKT_OK) status = vkt_apply((char const* const*)argv + 4, (size_t)argc - 4, inputs, 1, &out);
    if (status == VKT_OK) printf("%s", vkt_remarks(out));
    if (status == VKT_OK) status = vkt_write(out, argv[2], OPTIONS("--force"));
    vkt_free(in);
    vkt_free(out);
    return status == VKT_OK ? 0 : complain();
}

/* program memory: voxels in, voxels out. */
static int in_memory(void) {
    int16_t const voxels[12] = {-5, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 300};
    vkt_description d;
    vkt_volume *a = NULL, *b = NULL;
    void const* result = NULL;
    size_t bytes = 0;
    char* json = NULL;
    vkt_default_description(&d);
    d.dims[0] = 3, d.dims[1] = 2, d.dims[2] = 2;
    d.dtype = "int16";
    d.spacing[2] = 2.5;
    d.origin[0] = -1;
    d.units = "HU";
    if (vkt_create(&d, voxels, &a) != VKT_OK) return complain();
    if (vkt_apply(OPTIONS("flip", "x"), (vkt_volume const*[]){a}, 1, &b) != VKT_OK) return complain();
    vkt_describe(b, &d);
    printf("%d %d %d %s %g %g %g %s\n", (int)d.dims[0], (int)d.dims[1], (int)d.dims[2], d.dtype, d.spacing[2],
           d.origin[0], d.direction[0], d.units);
    if (vkt_voxels(b, &result, &bytes) != VKT_OK) return complain();
    for (size_t i = 0; i < bytes / 2; ++i) printf("%d ", ((int16_t const*)result)[i]);
    vkt_free(b);
    if (vkt_apply(OPTIONS("arith", "sub", "-", "-"), (vkt_volume const*[]){a, a}, 2, &b) != VKT_OK) return complain();
    if (vkt_statistics(b, NULL, 0, &json) != VKT_OK) return complain();
    printf("\n%s\n", strstr(json, "\"max\": 0,") != NULL ? "zero" : json);
    vkt_free_text(json);
    vkt_free(b);
    /* Clipping is said, not hidden. */
    if (vkt_apply(OPTIONS("convert", "--dtype", "uint8"), (vkt_volume const*[]){a}, 1, &b) != VKT_OK) return complain();
    printf("%s\n", vkt_remarks(b));
    vkt_free(b);
    vkt_free(a);
    return 0;
}

/* program several: what takes several volumes, said or not, and those in the place of a file. */
static int several(void) {
    vkt_volume *big = NULL, *small = NULL, *result = NULL;
    vkt_description d;
    char* json = NULL;
    vkt_default_description(&d);
    d.dims[0] = d.dims[1] = d.dims[2] = 3;
    if (vkt_create(&d, NULL, &small) != VKT_OK) return complain();
    d.dims[0] = 7;
    if (vkt_create(&d, NULL, &big) != VKT_OK) return complain();
    vkt_volume const* const both[] = {big, small};
    char const* const words[] = {"stats", "-", "-"};
    for (size_t n = 1; n <= 3; ++n) {
        if (vkt_measure(words, n, both, 2, &json) != VKT_OK) return complain();
        char const *first = strstr(json, "\"count\": 63"), *second = strstr(json, "\"count\": 27");
        printf("%d %d\n", first != NULL && second > first, strstr(json, "name") != NULL);
        vkt_free_text(json);
    }
    if (vkt_apply(OPTIONS("arith", "sub", "-", "-"), both, 1, &result) == VKT_OK) return 9;
    printf("%s\n", vkt_error());
    char const* const like[][4] = {{"crop", "-", "--like", "-"}, {"crop", "--like", "-"}};
    for (size_t i = 0; i < 2; ++i) {
        if (vkt_apply(like[i], 4 - i, both, 2, &result) != VKT_OK) return complain();
        vkt_describe(result, &d);
        printf("%d\n", (int)d.dims[0]);
        vkt_free(result);
    }
    if (vkt_apply(OPTIONS("filter", "kernel", "-"), both, 2, &result) != VKT_OK) return complain();
    vkt_describe(result, &d);
    printf("%d\n", (int)d.dims[0]);
    vkt_free(result);
    if (vkt_apply(OPTIONS("crop", "--like", "-"), both, 1, &result) == VKT_OK) return 9;
    vkt_free(big);
    vkt_free(small);
    return 0;
}

/* program refuse N: a call that fails, with the N-th reason. */
static int refuse(int reason) {
    vkt_volume *volume = NULL, *other = NULL;
    vkt_description d;
    vkt_default_description(&d);
    if (vkt_create(&d, NULL, &volume) != VKT_OK) return complain();
    vkt_status status = VKT_OK;
    if (reason == 0) status = vkt_apply(OPTIONS("flop", "x"), (vkt_volume const*[]){volume}, 1, &other);
    if (reason == 1) status = vkt_apply(OPTIONS("crop", "--roy", ":,:,:"), (vkt_volume const*[]){volume}, 1, &other);
    if (reason == 2) status = vkt_read("truncated.nrrd", NULL, 0, &other);
    if (reason == 3) status = vkt_read("missing.nrrd", NULL, 0, &other);
    if (reason == 4)
        status = vkt_apply(OPTIONS("make", "ramp", "--dims", "1000", "1000", "1000", "--memory", "1MiB"), NULL, 0, &other);
    if (reason == 5) status = vkt_write(volume, "existing.nrrd", NULL, 0);
    vkt_free(volume);
    if (status != VKT_OK && other != NULL) return 99;
    return status == VKT_OK ? 0 : complain();
}

/* program null: each call with a null pointer says so, and leaves alone what it would have set. */
static int take_null(void) {
    vkt_volume *volume = NULL, *untouched = NULL;
    void const* voxels = NULL;
    char* json = NULL;
    vkt_description d;
    vkt_default_description(&d);
    if (vkt_create(&d, NULL, &volume) != VKT_OK) return complain();
    vkt_volume const* const missing[] = {volume, NULL};
    int wrong = 0;
#define REFUSED(call, name) \
    if ((call) != VKT_USAGE || strcmp(vkt_error(), "argument '" name "' is null") != 0) \
        fprintf(stderr, "%s: %d %s\n", #call, ++wrong, vkt_error())
    REFUSED(vkt_describe(NULL, &d), "volume");
    REFUSED(vkt_describe(volume, NULL), "description");
    REFUSED(vkt_header(NULL, &json), "volume");
    REFUSED(vkt_header(volume, NULL), "json");
    REFUSED(vkt_statistics(NULL, NULL, 0, &json), "volume");
    REFUSED(vkt_statistics(volume, NULL, 0, NULL), "json");
    REFUSED(vkt_statistics(volume, NULL, 1, &json), "words");
    REFUSED(vkt_voxels(NULL, &voxels, NULL), "volume");
    REFUSED(vkt_voxels(volume, NULL, NULL), "voxels");
    int host = -7, device = -7;
    REFUSED(vkt_residence(NULL, &host, &device), "volume");
    REFUSED(vkt_residence(volume, NULL, &device), "host");
    REFUSED(vkt_residence(volume, &host, NULL), "device");
    REFUSED(vkt_migrate(NULL, "cpu"), "volume");
    REFUSED(vkt_migrate(volume, NULL), "device");
    REFUSED(vkt_device_voxels(NULL, &voxels, NULL, NULL), "volume");
    REFUSED(vkt_device_voxels(volume, NULL, NULL, NULL), "voxels");
    REFUSED(vkt_create_on_device(NULL, volume, 1, NULL, NULL, &untouched), "json");
    REFUSED(vkt_create_on_device("{}", NULL, 1, NULL, NULL, &untouched), "voxels");
    REFUSED(vkt_create_on_device("{}", volume, 1, NULL, NULL, NULL), "volume");
    if (host != -7 || device != -7) return 3;
    REFUSED(vkt_write(NULL, "null.nrrd", NULL, 0), "volume");
    REFUSED(vkt_write(volume, NULL, NULL, 0), "path");
    REFUSED(vkt_write(volume, "null.nrrd", OPTIONS("--force", NULL)), "words[1]");
    REFUSED(vkt_read(NULL, NULL, 0, &untouched), "path");
    REFUSED(vkt_read("volume.nrrd", NULL, 0, NULL), "volume");
    REFUSED(vkt_apply(OPTIONS("arith", "sub", "-", "-"), missing, 2, &untouched), "inputs[1]");
    REFUSED(vkt_apply(OPTIONS("flip", "x"), NULL, 1, &untouched), "inputs");
    REFUSED(vkt_apply(OPTIONS("flip", "x"), missing, 1, NULL), "result");
    REFUSED(vkt_create(NULL, NULL, &untouched), "description");
    REFUSED(vkt_create(&d, NULL, NULL), "volume");
    d.dtype = NULL;
    REFUSED(vkt_create(&d, NULL, &untouched), "description->dtype");
    vkt_free(volume);
    vkt_free(NULL);
    vkt_free_text(NULL);
    return wrong != 0 || untouched != NULL || json != NULL || voxels != NULL || *vkt_remarks(NULL) != '\0';
}

static void must_not_be_called(void* user) { *(int*)user = 1; }

/* program residence: voxels are on the host; without a GPU nothing else can be had, and nothing is released. */
static int residence(void) {
    vkt_volume *volume = NULL, *untouched = NULL;
    vkt_description d;
    void const* voxels = NULL;
    char* json = NULL;
    int host = -7, device = -7, released = 0;
    vkt_default_description(&d);
    if (vkt_create(&d, NULL, &volume) != VKT_OK || vkt_header(volume, &json) != VKT_OK) return complain();
    if (vkt_migrate(volume, "cpu") != VKT_OK || vkt_residence(volume, &host, &device) != VKT_OK) return complain();
    if (host != 1 || device != -1) return 3;
    if (vkt_migrate(volume, "moon") != VKT_USAGE) return 4;
    vkt_status const moved = vkt_migrate(volume, "gpu");
    if (moved == VKT_OK) { /* there is one: tests/gpu.sh looks at more */
        if (vkt_device_voxels(volume, &voxels, NULL, &device) != VKT_OK || device < 0 || voxels == NULL) return 5;
    } else {
        if (moved != VKT_RESOURCES || vkt_device_voxels(volume, &voxels, NULL, &device) != VKT_RESOURCES) return 6;
        if (vkt_create_on_device(json, volume, 1, must_not_be_called, &released, &untouched) != VKT_RESOURCES) return 7;
        if (voxels != NULL || device != -1 || untouched != NULL || released != 0) return 8;
    }
    vkt_free_text(json);
    vkt_free(volume);
    return 0;
}

static double shifted(int64_t x, int64_t y, int64_t z, double value, void* user) {
    int64_t* const calls = user;
    return value + 10.0 * (double)x + 100.0 * (double)y + 1000.0 * (double)z + 0.0 * (double)++*calls;
}

/* program transform: a function of index and physical value, in the order of memory. */
static int transform(void) {
    int16_t const voxels[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    vkt_description d;
    vkt_volume *a = NULL, *b = NULL;
    void const* result = NULL;
    int64_t calls = 0;
    vkt_default_description(&d);
    d.dims[0] = d.dims[1] = d.dims[2] = 2;
    d.dtype = "int16";
    d.slope = 2;
    if (vkt_create(&d, voxels, &a) != VKT_OK) return complain();
    if (vkt_transform(a, shifted, &calls, OPTIONS("--roi", "1:2,:,:"), &b) != VKT_OK) return complain();
    if (vkt_voxels(b, &result, NULL) != VKT_OK) return complain();
    for (int i = 0; i < 8; ++i) printf("%d ", ((int16_t const*)result)[i]);
    printf("calls %d\n", (int)calls);
    vkt_free(b);
    if (vkt_transform(a, shifted, &calls, OPTIONS("--dtype", "int8"), &b) != VKT_OK) return complain();
    printf("%s\n", vkt_remarks(b));
    vkt_free(b);
    b = NULL;
    if (vkt_transform(a, NULL, NULL, NULL, 0, &b) != VKT_USAGE || b != NULL) return 99;
    if (vkt_transform(NULL, shifted, &calls, NULL, 0, &b) != VKT_USAGE || b != NULL) return 99;
    if (vkt_apply(OPTIONS("transform", "v + 10 * x + 100 * y + 1000 * z"), (vkt_volume const*[]){a}, 1, &b) != VKT_OK)
        return complain();
    if (vkt_voxels(b, &result, NULL) != VKT_OK) return complain();
    for (int i = 0; i < 8; ++i) printf("%d ", ((int16_t const*)result)[i]);
    printf("\n");
    vkt_free(a);
    vkt_free(b);
    return 0;
}

/* program trim: memory of freed volumes is kept, used again, and given back. */
static int trim(void) {
    vkt_volume *a = NULL, *b = NULL;
    vkt_description d;
    void const *first = NULL, *second = NULL;
    vkt_default_description(&d);
    d.dims[0] = d.dims[1] = d.dims[2] = 256;
    if (vkt_create(&d, NULL, &a) != VKT_OK) return complain();
    for (int i = 0; i < 2; ++i) {
        if (vkt_apply(OPTIONS("flip", "x"), (vkt_volume const*[]){a}, 1, &b) != VKT_OK) return complain();
        if (vkt_voxels(b, i == 0 ? &first : &second, NULL) != VKT_OK) return complain();
        vkt_free(b);
    }
    vkt_free(a);
    printf("%d ", first == second);
    printf("%d ", vkt_trim() >= 2u * 256 * 256 * 256);
    printf("%d\n", (int)vkt_trim());
    return 0;
}

/* program render OUT: a picture of volume.nrrd as a file, and facts about it. */
static int draw(char const* path) {
    vkt_volume* volume = NULL;
    vkt_picture* picture = NULL;
    void const* png = NULL;
    size_t size = 0;
    FILE* file = fopen(path, "wb");
    if (vkt_read("volume.nrrd", NULL, 0, &volume) != VKT_OK) return complain();
    if (vkt_render(volume, OPTIONS("--size", "24x18", "--background", "1,0,0"), &picture) != VKT_OK) return complain();
    unsigned char const* const corner = vkt_picture_bytes(picture);
    printf("%d %d %d %d %d %d %g\n", vkt_picture_width(picture), vkt_picture_height(picture), corner[0], corner[1],
           corner[2], corner[3], (double)vkt_picture_light(picture)[3]);
    printf("%s[%s]\n", strstr(vkt_picture_report(picture), "ray marching") != NULL ? "march" : "?",
           vkt_picture_remarks(picture));
    if (vkt_picture_png(picture, &png, &size) != VKT_OK) return complain();
    fwrite(png, 1, size, file);
    fclose(file);
    vkt_free_picture(picture);
    picture = NULL;
    vkt_free_picture(picture);
    if (vkt_render(volume, OPTIONS("--size", "0"), &picture) != VKT_USAGE || picture != NULL) return 9;
    if (vkt_render(NULL, NULL, 0, &picture) != VKT_USAGE || vkt_render(volume, NULL, 0, NULL) != VKT_USAGE) return 9;
    vkt_free(volume);
    return 0;
}

int main(int argc, char** argv) {
    if (argc == 3 && strcmp(argv[1], "render") == 0) return draw(argv[2]);
    if (argc > 4 && strcmp(argv[1], "apply") == 0) return apply_to_file(argc, argv);
    if (argc == 3 && strcmp(argv[1], "refuse") == 0) return refuse(argv[2][0] - '0');
    if (argc == 2 && strcmp(argv[1], "memory") == 0) return in_memory();
    if (argc == 2 && strcmp(argv[1], "several") == 0) return several();
    if (argc == 2 && strcmp(argv[1], "null") == 0) return take_null();
    if (argc == 2 && strcmp(argv[1], "residence") == 0) return residence();
    if (argc == 2 && strcmp(argv[1], "trim") == 0) return trim();
    if (argc == 2 && strcmp(argv[1], "transform") == 0) return transform();
    printf("%s\n", vkt_version());
    for (char const* const* name = vkt_operations(); *name != NULL; ++name) printf("%s\n", *name);
    return 0;
}
EOF
    pc=$(find "$BATS_FILE_TMPDIR/installed" -name vkt.pc)
    cd "$BATS_FILE_TMPDIR"
    eval "cc -std=c99 -pedantic -Wall -Wextra -Werror program.c -o program \
        $(PKG_CONFIG_PATH="${pc%/*}" pkg-config --cflags --libs vkt)" 2>compiler || true
}

setup_more() {
    [ -n "${VKT_BUILD:-}" ] || skip "VKT_BUILD does not name a build folder"
    [ -z "${VKT_SANITIZED:-}" ] || skip "a plain C program does not link with a sanitized library"
    program=$BATS_FILE_TMPDIR/program
    [ -x "$program" ] || { cat "$BATS_FILE_TMPDIR/compiler" >&2; false; }
    cp "$VKT_ROOT/examples/data/phantom.nrrd" volume.nrrd
}

@test "the version and the operations are those of the command" {
    "$program" >list
    [ "$(head -n 1 list)" = "$(vkt --version | sed -n '1s/vkt //p')" ]
    vkt help --list >verbs
    [ "$(wc -l <list)" -gt 10 ]
    sed 1d list | while IFS= read -r name; do
        grep -qxF -e "$name" verbs || { echo "$name is no command" >&2; false; }
    done
}

@test "words do what they do on the command line" {
    while IFS= read -r line; do
        eval "vkt read volume.nrrd | vkt $line -o want.nrrd --force -q"
        eval "\"\$program\" apply got.nrrd volume.nrrd $line" >/dev/null
        cmp want.nrrd got.nrrd # geometry, attributes, history and voxels
    done <<'EOF'
flip z
filter gaussian --sigma 1,2,0.5 --boundary border:-3.5
crop --roi 10:-5,:,25%:75%
convert --dtype int16 --range=p1:p99
resample --dims 20 30 40 --method cubic
resample --dims=20,30,40
set -spacing 1,2,3 --attribute a=b 'c=d e'
fill --value 7 --first 1 2 3 --last 10 10 10 --threads 2
EOF
}

@test "volumes from memory and back" {
    run "$program" memory
    [ "$status" -eq 0 ]
    [ "${lines[0]}" = "3 2 2 int16 2.5 1 -1 HU" ]
    [ "${lines[1]}" = "2 1 -5 5 4 3 8 7 6 300 10 9 " ]
    [ "${lines[2]}" = "zero" ]
    [[ "${lines[3]}" == "2 of 12 voxels"*"clipped to [0,255]" ]]
}

@test "several volumes are measured whether words say so or not, and stand for files that options name" {
    run -0 "$program" several
    # Of a kernel the words say the file, so that the volume, which they do not say, comes first.
    printf '%s\n' '1 0' '1 0' '1 0' 'arith takes 2 volumes, not 1' 3 3 7 | diff - <(echo "$output")
}

@test "errors have the kind, the text and the hint of the command" {
    head -c 20000 volume.nrrd >truncated.nrrd
    cp volume.nrrd existing.nrrd
    fails_with 2 "2: 'flop x' is not an operation [" "$program" refuse 0
    fails_with 2 "2: unknown option '--roy' [did you mean '--roi'?]" "$program" refuse 1
    fails_with 3 "3: " "$program" refuse 2
    fails_with 4 "4: cannot open 'missing.nrrd'" "$program" refuse 3
    fails_with 5 "5: the volume needs 3.7 GiB of memory" "$program" refuse 4
    fails_with 4 "existing.nrrd" "$program" refuse 5
    cmp volume.nrrd existing.nrrd
}

@test "null pointers are refused by name" {
    "$program" null
    [ ! -e null.nrrd ]
}

@test "where voxels are, and that a GPU is needed for more" {
    "$program" residence
}

@test "a function of index and value is called for every voxel" {
    run "$program" transform
    [ "$status" -eq 0 ]
    [ "${lines[0]}" = "0 6 2 58 4 510 6 562 calls 4" ]
    [[ "${lines[1]}" == "4 of 8 voxels"*"clipped to [-128,127]" ]]
    [ "${lines[2]}" = "0 6 52 58 504 510 556 562 " ]
}

@test "memory of freed volumes serves the next result until it is given back" {
    [ "$("$program" trim)" = "1 1 0" ]
}

@test "a picture has the pixels of the command" {
    run "$program" render a.png
    [ "$status" -eq 0 ]
    [ "${lines[0]}" = "24 18 255 0 0 255 0" ]
    [ "${lines[1]}" = "march[]" ]
    vkt render volume.nrrd --size 24x18 --background 1,0,0 -o b.png
    /usr/bin/python3 -c "
import re
data = [re.search(b'IDAT.*', open(name, 'rb').read(), re.S)[0] for name in ('a.png', 'b.png')]
assert data[0] == data[1]"
}
