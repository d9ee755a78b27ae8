/* Several volumes: series round FROM TO, series pieces FILE, series wrong FILE. SPDX-License-Identifier: MIT */
#include "libvkt/c/vkt.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define WORDS(...) (char const*[]){__VA_ARGS__}, sizeof((char const*[]){__VA_ARGS__}) / sizeof(char const*)
#define MUST(condition)                                                                                                \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            fprintf(stderr, "line %d: %s: %s\n", __LINE__, #condition, vkt_error());                                   \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

/* Says how many volumes a file has, and writes them and the second once more into another one. */
static void round_trip(char const* from, char const* to) {
    vkt_series_reader* reader = NULL;
    vkt_series_writer* writer = NULL;
    vkt_volume* volume = NULL;
    int64_t all = -1, some = -1, met = 0;
    MUST(vkt_count_volumes(from, NULL, 0, &all) == VKT_OK);
    MUST(vkt_count_volumes(from, WORDS("--index", "1::2"), &some) == VKT_OK);
    printf("%d %d\n", (int)all, (int)some);
    MUST(vkt_series_open(from, NULL, 0, &reader) == VKT_OK && vkt_series_create(to, NULL, 0, &writer) == VKT_OK);
    for (;; ++met) {
        MUST(vkt_series_next(reader, &volume) == VKT_OK);
        if (volume == NULL) break;
        MUST(vkt_series_put(writer, volume) == VKT_OK);
        vkt_free(volume);
    }
    MUST(met == all && vkt_series_next(reader, &volume) == VKT_OK && volume == NULL);
    vkt_series_free_reader(reader);
    MUST(vkt_series_open(from, WORDS("--index", "1:2"), &reader) == VKT_OK);
    MUST(vkt_series_next(reader, &volume) == VKT_OK && volume != NULL && vkt_series_put(writer, volume) == VKT_OK);
    vkt_free(volume);
    vkt_series_free_reader(reader);
    MUST(vkt_series_close(writer) == VKT_OK);
    MUST(vkt_series_close(writer) == VKT_USAGE && strstr(vkt_error(), "closed") != NULL);
    vkt_series_free_writer(writer);
}

static int same(vkt_volume const* a, vkt_volume const* b) {
    void const *x = NULL, *y = NULL;
    size_t n = 0, m = 1;
    MUST(vkt_voxels(a, &x, &n) == VKT_OK && vkt_voxels(b, &y, &m) == VKT_OK);
    return n == m && memcmp(x, y, n) == 0;
}

/* All that a reader has; they are counted. */
static int taken(vkt_series_reader* reader, vkt_volume* to[200]) {
    int n = 0;
    for (; n < 200; ++n) {
        MUST(vkt_series_next(reader, &to[n]) == VKT_OK);
        if (to[n] == NULL) break;
    }
    vkt_series_free_reader(reader);
    return n;
}

static void pieces(char const* path) {
    vkt_volume *volume = NULL, *again = NULL, *piece[200];
    vkt_volume const* turned[200];
    vkt_series_reader* reader = NULL;
    vkt_description d;
    int n = 0;
    MUST(vkt_read(path, NULL, 0, &volume) == VKT_OK && vkt_describe(volume, &d) == VKT_OK);
    MUST(vkt_split(volume, &reader) == VKT_OK);
    n = taken(reader, piece);
    MUST(n == d.dims[2]);
    MUST(vkt_stack((vkt_volume const* const*)piece, (size_t)n, NULL, 0, &again) == VKT_OK && same(volume, again));
    vkt_free(again);
    MUST(vkt_stack((vkt_volume const* const*)piece + 1, 0, NULL, 0, &again) == VKT_USAGE);
    turned[0] = piece[2], turned[1] = piece[0];
    MUST(vkt_stack(turned, 2, NULL, 0, &again) == VKT_DATA);
    MUST(vkt_stack(turned, 2, WORDS("--force-uniform"), &again) == VKT_OK);
    vkt_free(again);
    for (int i = 0; i < n; ++i) vkt_free(piece[i]);
    MUST(vkt_brick(volume, WORDS("--size", "10", "--ghost", "1"), &reader) == VKT_OK);
    n = taken(reader, piece);
    printf("%d\n", n);
    for (int i = 0; i < n; ++i) turned[i] = piece[n - 1 - i];
    MUST(vkt_merge(turned, (size_t)n, &again) == VKT_OK && same(volume, again));
    vkt_free(again);
    MUST(vkt_merge(turned, (size_t)n - 1, &again) == VKT_DATA && strstr(vkt_error(), "missing") != NULL);
    for (int i = 0; i < n; ++i) vkt_free(piece[i]);
    /* By the names that people look for. */
    vkt_volume const* in[] = {volume};
    MUST(vkt_apply(WORDS("reorient", "zyx"), in, 1, &again) == VKT_OK && !vkt_measures("reorient"));
    vkt_free(again);
    vkt_free(volume);
}

static int end_at_once(double done, void* user) {
    (void)done, (void)user;
    return 1;
}

static void wrong(char const* path) {
    vkt_series_reader* reader = NULL;
    vkt_series_writer* writer = NULL;
    vkt_volume* volume = NULL;
    int64_t count = 0;
    MUST(vkt_series_open(NULL, NULL, 0, &reader) == VKT_USAGE && vkt_series_open(path, NULL, 0, NULL) == VKT_USAGE);
    MUST(vkt_series_open("nowhere", NULL, 0, &reader) == VKT_IO && vkt_count_volumes(path, NULL, 0, NULL) == VKT_USAGE);
    MUST(vkt_series_next(NULL, &volume) == VKT_USAGE && vkt_series_put(NULL, NULL) == VKT_USAGE);
    MUST(vkt_split(NULL, &reader) == VKT_USAGE && vkt_merge(NULL, 2, &volume) == VKT_USAGE);
    MUST(vkt_count_volumes(path, WORDS("--index", "7:9"), &count) == VKT_USAGE && count == 0);
    /* What is not closed leaves nothing. */
    MUST(vkt_read(path, WORDS("--index", "0"), &volume) == VKT_OK);
    MUST(vkt_series_create("left.nii.gz", NULL, 0, &writer) == VKT_OK && vkt_series_put(writer, volume) == VKT_OK);
    vkt_series_free_writer(writer);
    MUST(vkt_series_create("left.nope", NULL, 0, &writer) == VKT_USAGE);
    vkt_free(volume);
    volume = NULL;
    MUST(vkt_read(path, NULL, 0, &volume) == VKT_USAGE && strstr(vkt_error_hint(), "vkt_series_open()") != NULL);
    /* A call that is ended ends the series. */
    MUST(vkt_series_open(path, NULL, 0, &reader) == VKT_OK);
    vkt_set_progress(end_at_once, NULL);
    MUST(vkt_series_next(reader, &volume) == VKT_CANCELLED && volume == NULL);
    vkt_set_progress(NULL, NULL);
    MUST(vkt_series_next(reader, &volume) == VKT_CANCELLED && strstr(vkt_error(), "failed before") != NULL);
    vkt_series_free_reader(reader);
    vkt_series_free_reader(NULL);
    vkt_series_free_writer(NULL);
}

int main(int argc, char** argv) {
    if (argc == 4 && strcmp(argv[1], "round") == 0) round_trip(argv[2], argv[3]);
    if (argc == 3 && strcmp(argv[1], "pieces") == 0) pieces(argv[2]);
    if (argc == 3 && strcmp(argv[1], "wrong") == 0) wrong(argv[2]);
    return 0;
}
