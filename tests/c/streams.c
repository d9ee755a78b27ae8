/* Volumes through descriptors: streams cat|count|fail|forget|put|cancel|stuck|refuse, standard input to standard
   output. SPDX-License-Identifier: MIT */
#include "libvkt/c/vkt.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

static int complain(void) {
    fprintf(stderr, "%d: %s [%s]\n", (int)vkt_error_status(), vkt_error(), vkt_error_hint());
    return vkt_error_status();
}

static int cancel(double done, void* user) {
    int* const calls = user;
    if (done < 0 || done > 1) *calls += 1000000;
    return ++*calls > 3;
}

/* Passes all volumes on; `count` is how many there were. */
static int pass(vkt_stream_writer* writer, int* count) {
    vkt_stream_reader* reader = NULL;
    if (vkt_stream_open(0, &reader) != VKT_OK) return complain();
    for (*count = 0;; ++*count) {
        vkt_volume* volume = NULL;
        if (vkt_stream_next(reader, &volume) != VKT_OK) {
            int const status = complain();
            /* Once failed, always failed. */
            if (vkt_stream_next(reader, &volume) == VKT_OK || volume != NULL) return 99;
            if (writer != NULL && vkt_stream_fail(writer, "the input broke off") != VKT_OK) return 98;
            vkt_stream_free_reader(reader);
            return status;
        }
        if (volume == NULL) break;
        if (writer != NULL && vkt_stream_put(writer, volume) != VKT_OK) return complain();
        vkt_free(volume);
    }
    vkt_stream_free_reader(reader);
    return 0;
}

static int refuse(void) {
    vkt_stream_reader* reader = NULL;
    vkt_stream_writer* writer = NULL;
    vkt_volume* volume = NULL;
    int ends[2];
    char const* const wrong[] = {"--transport", "carrier"};
    char const* const gpu[] = {"--transport", "gpu"};
    if (pipe(ends) != 0) return 1;
    if (vkt_stream_open(77, &reader) != VKT_USAGE || reader != NULL) return 10;
    if (vkt_stream_open(ends[1], &reader) != VKT_USAGE || reader != NULL) return 11;
    if (vkt_stream_create(77, NULL, 0, &writer) != VKT_USAGE || writer != NULL) return 12;
    if (vkt_stream_create(ends[0], NULL, 0, &writer) != VKT_USAGE || writer != NULL) return 13;
    if (vkt_stream_create(ends[1], wrong, 2, &writer) != VKT_USAGE || strstr(vkt_error(), "carrier") == NULL) return 14;
    if (vkt_stream_create(ends[1], gpu, 2, &writer) == VKT_OK)
        vkt_stream_free_writer(writer);
    else if (vkt_stream_create(ends[1], gpu, 2, &writer) != VKT_RESOURCES ||
             strstr(vkt_error(), "--transport gpu: ") == NULL)
        return 20;
    writer = NULL;
    if (vkt_stream_next(NULL, &volume) != VKT_USAGE || vkt_stream_put(NULL, NULL) != VKT_USAGE) return 15;
    if (vkt_stream_open(ends[0], NULL) != VKT_USAGE || vkt_stream_create(ends[1], NULL, 0, NULL) != VKT_USAGE)
        return 16;
    if (vkt_stream_create(ends[1], NULL, 0, &writer) != VKT_OK) return 17;
    if (vkt_stream_put(writer, NULL) != VKT_USAGE || vkt_stream_fail(writer, NULL) != VKT_USAGE) return 18;
    if (vkt_stream_close(writer) != VKT_OK || vkt_stream_close(writer) != VKT_USAGE) return 19;
    vkt_stream_free_writer(writer);
    vkt_stream_free_writer(NULL);
    vkt_stream_free_reader(NULL);
    /* No reader: an error, and not the end of the program. */
    vkt_description d;
    vkt_default_description(&d);
    d.dims[0] = d.dims[1] = d.dims[2] = 128;
    if (vkt_create(&d, NULL, &volume) != VKT_OK) return 20;
    if (vkt_stream_create(ends[1], NULL, 0, &writer) != VKT_OK) return 21;
    close(ends[0]);
    vkt_status status = vkt_stream_put(writer, volume);
    if (status == VKT_OK) status = vkt_stream_close(writer);
    if (status != VKT_IO || strcmp(vkt_error(), "the reader of the stream is gone") != 0) return complain() + 22;
    vkt_stream_free_writer(writer);
    close(ends[1]);
    vkt_free(volume);
    printf("refused\n");
    return 0;
}

/* A pipe that nobody reads: the call that waits for it is ended, and so is freeing, with the reader's end still open.
 */
static int stuck(char const* const* words, size_t words_count) {
    vkt_description d;
    vkt_volume* volume = NULL;
    vkt_stream_writer* writer = NULL;
    int ends[2], count = 0;
    if (pipe(ends) != 0) return 1;
    vkt_default_description(&d);
    d.dims[0] = d.dims[1] = d.dims[2] = 160;
    if (vkt_create(&d, NULL, &volume) != VKT_OK) return complain();
    if (vkt_stream_create(ends[1], words, words_count, &writer) != VKT_OK) return complain();
    vkt_set_progress(cancel, &count);
    if (vkt_stream_put(writer, volume) != VKT_CANCELLED) return 99;
    if (vkt_stream_put(writer, volume) != VKT_CANCELLED || strstr(vkt_error(), "failed before") == NULL) return 98;
    vkt_set_progress(NULL, NULL);
    vkt_stream_free_writer(writer);
    vkt_free(volume);
    printf("%d calls\n", count);
    return 0;
}

int main(int argc, char** argv) {
    char const* const what = argc > 1 ? argv[1] : "";
    vkt_stream_writer* writer = NULL;
    vkt_stream_reader* reader = NULL;
    vkt_volume* volume = NULL;
    int count = 0;
    if (strcmp(what, "refuse") == 0) return refuse();
    if (strcmp(what, "stuck") == 0) return stuck((char const* const*)argv + 2, (size_t)argc - 2);
    if (strcmp(what, "count") == 0) {
        int const status = pass(NULL, &count);
        printf("%d\n", count);
        return status;
    }
    if (strcmp(what, "cancel") == 0) {
        if (vkt_stream_open(0, &reader) != VKT_OK) return complain();
        vkt_set_progress(cancel, &count);
        if (vkt_stream_next(reader, &volume) != VKT_CANCELLED || volume != NULL) return 99;
        vkt_stream_free_reader(reader);
        printf("%d calls\n", count);
        return vkt_error_status();
    }
    if (vkt_stream_create(1, (char const* const*)argv + 2, argc > 2 ? (size_t)argc - 2 : 0, &writer) != VKT_OK)
        return complain();
    if (strcmp(what, "fail") == 0) {
        if (vkt_stream_fail(writer, "the sun is down") != VKT_OK) return complain();
        vkt_stream_free_writer(writer);
        return 0;
    }
    int const status = pass(writer, &count);
    if (status == 0 && strcmp(what, "forget") != 0 && vkt_stream_close(writer) != VKT_OK) return complain();
    vkt_stream_free_writer(writer);
    return status;
}
