/* How calls run and how they end: policy, progress, cancel. calls policy | calls watch FILE | calls cancel FILE | calls
   even SPDX-License-Identifier: MIT */
#define _POSIX_C_SOURCE 200809L
#include "libvkt/c/vkt.h"

#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#define WORDS(...) (char const*[]){__VA_ARGS__}, sizeof((char const*[]){__VA_ARGS__}) / sizeof(char const*)
#define MUST(condition)                                                                                                \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            fprintf(stderr, "line %d: %s: %s\n", __LINE__, #condition, vkt_error());                                   \
            return 1;                                                                                                  \
        }                                                                                                              \
    } while (0)

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void* in_other_thread(void* result) {
    vkt_policy policy;
    *(int*)result = vkt_get_policy(&policy) == VKT_OK ? policy.threads : -1;
    return NULL;
}

static int policy(void) {
    vkt_policy p, at_first, asked = {"cpu", 3, (size_t)1 << 20};
    vkt_volume* volume = NULL;
    vkt_description d;
    pthread_t thread;
    int other = 0;
    MUST(vkt_get_policy(&at_first) == VKT_OK);
    MUST(strcmp(at_first.device, "auto") == 0 && at_first.threads >= 1 && at_first.memory > asked.memory);
    MUST(vkt_set_policy(&asked) == VKT_OK && vkt_get_policy(&p) == VKT_OK);
    MUST(strcmp(p.device, "cpu") == 0 && p.threads == 3 && p.memory == (size_t)1 << 20);
    MUST(pthread_create(&thread, NULL, in_other_thread, &other) == 0 && pthread_join(thread, NULL) == 0);
    MUST(other == at_first.threads);
    /* Its memory holds for calls, and words overrule it. */
    MUST(vkt_apply(WORDS("make", "ramp", "--dims", "200,200,200"), NULL, 0, &volume) == VKT_RESOURCES);
    MUST(strstr(vkt_error(), "1.0 MiB") != NULL && volume == NULL);
    MUST(vkt_apply(WORDS("make", "ramp", "--dims", "200,200,200", "--memory", "1GiB"), NULL, 0, &volume) == VKT_OK);
    vkt_free(volume);
    volume = NULL;
    /* Volumes of voxels of the program's too. */
    vkt_default_description(NULL);
    vkt_default_description(&d);
    d.dims[0] = (int64_t)1 << 39;
    MUST(vkt_create(&d, NULL, &volume) == VKT_RESOURCES && strstr(vkt_error(), "1.0 MiB") != NULL && volume == NULL);
    d.dims[0] = (int64_t)1 << 20;
    MUST(vkt_create(&d, NULL, &volume) == VKT_OK);
    vkt_free(volume);
    volume = NULL;
    d.dims[0] = -3;
    MUST(vkt_create(&d, NULL, &volume) == VKT_USAGE && strstr(vkt_error(), "dims") != NULL);
    d.dims[0] = 3;
    d.direction[0] = 3;
    MUST(vkt_create(&d, NULL, &volume) == VKT_USAGE && strstr(vkt_error(), "unit length") != NULL && volume == NULL);
    /* What cannot be changes nothing. */
    asked.threads = -2;
    MUST(vkt_set_policy(&asked) == VKT_USAGE && strstr(vkt_error(), "threads") != NULL);
    asked.threads = 0;
    asked.device = "abacus";
    MUST(vkt_set_policy(&asked) == VKT_USAGE && strstr(vkt_error(), "abacus") != NULL);
    asked.device = "gpu:77";
    MUST(vkt_set_policy(&asked) == VKT_RESOURCES);
    MUST(vkt_get_policy(&p) == VKT_OK && p.threads == 3);
    MUST(vkt_get_policy(NULL) == VKT_USAGE);
    MUST(vkt_set_policy(NULL) == VKT_OK && vkt_get_policy(&p) == VKT_OK);
    MUST(p.threads == at_first.threads && p.memory == at_first.memory);
    printf("%d threads\n", p.threads);
    return 0;
}

struct watch {
    int calls, end_after;    /* in calls; 0 never */
    double least, last, end; /* end: when, 0 never */
    pthread_t thread;
    int wrong;
};

static int watched(double done, void* user) {
    struct watch* const w = user;
    if (!(done >= w->last && done >= 0 && done <= 1)) ++w->wrong; /* never back */
    if (!pthread_equal(pthread_self(), w->thread)) ++w->wrong;
    if (w->calls++ == 0) w->least = done;
    w->last = done;
    return (w->end_after > 0 && w->calls >= w->end_after) || (w->end > 0 && now() >= w->end);
}

static double plus_one(int64_t x, int64_t y, int64_t z, double value, void* user) {
    (void)x, (void)y, (void)z, (void)user;
    return value + 1;
}

/* All kinds of calls on the file's volume; those that a monitor ends leave their results alone. */
static int all_calls(char const* path, struct watch* w, vkt_status want) {
    vkt_volume *volume = NULL, *result = NULL, *read = NULL;
    vkt_picture* picture = NULL;
    char* json = NULL;
    char const* const operations[][3] = {{"filter", "gaussian", "--sigma=3"},
                                         {"filter", "median", "--radius=2"},
                                         {"flip", "z", NULL},
                                         {"rotate", "--angle=30", NULL},
                                         {"distance", NULL, NULL},
                                         {"label", NULL, NULL},
                                         {"watershed", NULL, NULL},
                                         {"clahe", NULL, NULL},
                                         {"threshold", "--otsu", NULL},
                                         {"scan", NULL, NULL}};
    vkt_set_progress(NULL, NULL);
    MUST(vkt_read(path, NULL, 0, &volume) == VKT_OK);
    vkt_set_progress(watched, w);
#define WATCHED(call)                                                                                                  \
    w->calls = 0, w->last = 0;                                                                                         \
    MUST((call) == want);                                                                                              \
    MUST(w->calls >= 1 && w->wrong == 0 && w->least == 0 && (w->end_after == 0 || w->calls == w->end_after))
    WATCHED(vkt_read(path, NULL, 0, &read));
    WATCHED(vkt_write(volume, "written.nrrd", WORDS("--force")));
    WATCHED(vkt_write(volume, "written.vkt", WORDS("--force")));
    WATCHED(vkt_statistics(volume, NULL, 0, &json));
    vkt_free_text(json);
    json = NULL;
    WATCHED(vkt_measure(WORDS("histogram", "--bins", "16"), (vkt_volume const*[]){volume}, 1, &json));
    char* others = NULL;
    WATCHED(vkt_measure(WORDS("diff", "--ssim"), (vkt_volume const*[]){volume, volume}, 2, &others));
    vkt_free_text(others);
    others = NULL;
    WATCHED(vkt_measure(WORDS("diff", "--mutual-information"), (vkt_volume const*[]){volume, volume}, 2, &others));
    vkt_free_text(others);
    WATCHED(vkt_transform(volume, plus_one, NULL, NULL, 0, &result));
    WATCHED(vkt_render(volume, WORDS("--size", "64"), &picture));
    MUST((want == VKT_OK) == (read != NULL) && (want == VKT_OK) == (json != NULL));
    MUST((want == VKT_OK) == (picture != NULL) && (want == VKT_OK) == (result != NULL));
    vkt_free(read);
    vkt_free(result);
    vkt_free_text(json);
    vkt_free_picture(picture);
    for (size_t i = 0; i < sizeof operations / sizeof *operations; ++i) {
        size_t count = 0;
        while (count < 3 && operations[i][count] != NULL) ++count;
        result = NULL;
        WATCHED(vkt_apply(operations[i], count, (vkt_volume const*[]){volume}, 1, &result));
        MUST((want == VKT_OK) == (result != NULL));
        vkt_free(result);
    }
    vkt_set_progress(NULL, NULL);
    vkt_free(volume);
    return 0;
}

/* A call of seconds is ended 0.1 s after it began, how soon? */
static int ended_soon(char const* const* words, size_t count, vkt_volume const* volume) {
    struct watch w = {0, 0, 0, 0, now() + 0.1, pthread_self(), 0};
    vkt_volume* result = NULL;
    vkt_set_progress(watched, &w);
    vkt_status const status = vkt_apply(words, count, &volume, 1, &result);
    double const late = now() - w.end;
    vkt_set_progress(NULL, NULL);
    if (status == VKT_OK) fprintf(stderr, "%s %s was over before it could be ended\n", words[0], words[1]);
    MUST(status == VKT_CANCELLED && result == NULL && strcmp(vkt_error(), "cancelled") == 0);
    printf("%s %s: %.3f s\n", words[0], words[1], late);
    MUST(late < 1);
    return 0;
}

static int cancel(char const* path) {
    struct watch first = {0, 1, 0, 0, 0, pthread_self(), 0};
    vkt_volume* volume = NULL;
    if (all_calls(path, &first, VKT_CANCELLED) != 0) return 1;
    MUST(vkt_apply(WORDS("make", "noise", "--dims", "320,320,320", "--dtype", "uint16"), NULL, 0, &volume) == VKT_OK);
    if (ended_soon(WORDS("filter", "median", "--radius=9"), volume) != 0) return 1;
    if (ended_soon(WORDS("filter", "nlmeans", "--noise=9"), volume) != 0) return 1;
    if (ended_soon(WORDS("rotate", "--angle=20", "--method=lanczos3"), volume) != 0) return 1;
    if (ended_soon(WORDS("watershed", "--on=gradient"), volume) != 0) return 1;
    vkt_free(volume);
    return 0;
}

static int surface(void) {
    vkt_volume* volume = NULL;
    vkt_surface* made = NULL;
    vkt_surface_view view;
    MUST(vkt_apply(WORDS("make", "sphere", "--dims", "24,24,24", "--radius", "8"), NULL, 0, &volume) == VKT_OK);
    MUST(vkt_make_surface(volume, WORDS("--iso", "0.5"), &made) == VKT_OK && vkt_surface_parts(made) == 1);
    MUST(vkt_surface_part(made, 0, &view) == VKT_OK && view.label == 0 && view.vertices > 100);
    MUST(view.triangles == 2 * view.vertices - 4); /* as of every sphere */
    for (int64_t i = 0; i < 3 * view.triangles; ++i) MUST((int64_t)view.corners[i] < view.vertices);
    for (int64_t i = 0; i < view.vertices; ++i) {
        double r2 = 0;
        for (int a = 0; a < 3; ++a) r2 += (view.coordinates[3 * i + a] - 11.5) * (view.coordinates[3 * i + a] - 11.5);
        MUST(r2 > 6.5 * 6.5 && r2 < 9.5 * 9.5);
    }
    MUST(strstr(vkt_surface_report(made), "\"euler\": 2") != NULL && *vkt_surface_remarks(made) == 0);
    MUST(vkt_surface_part(made, 1, &view) == VKT_USAGE && strstr(vkt_error(), "counted from 0") != NULL);
    MUST(vkt_surface_write(made, "ball.ply", NULL, 0) == VKT_OK);
    MUST(vkt_surface_write(made, "ball.ply", NULL, 0) == VKT_IO && strstr(vkt_error(), "exists") != NULL);
    MUST(vkt_surface_write(made, "ball.ply", WORDS("--force", "--normals")) == VKT_OK);
    MUST(vkt_surface_write(made, "ball.xyz", NULL, 0) == VKT_USAGE);
    MUST(vkt_surface_write(made, "ball.stl", WORDS("--normals")) == VKT_USAGE);
    vkt_free_surface(made);
    made = NULL;
    MUST(vkt_make_surface(volume, WORDS("--iso", "1e9"), &made) == VKT_OK && *vkt_surface_remarks(made) != 0);
    vkt_free_surface(made);
    made = NULL;
    MUST(vkt_make_surface(volume, NULL, 0, &made) == VKT_USAGE && made == NULL);
    MUST(vkt_make_surface(NULL, WORDS("--iso", "1"), &made) == VKT_USAGE);
    MUST(vkt_make_surface(volume, WORDS("--iso", "0.5", "--memory", "10KiB"), &made) == VKT_RESOURCES && made == NULL);
    MUST(vkt_surface_parts(NULL) == 0);
    vkt_free_surface(NULL);
    vkt_free(volume);
    return 0;
}

struct steps {
    int calls;
    double told[4096];
};

static int noted(double done, void* user) {
    struct steps* const s = user;
    if (s->calls < 4096) s->told[s->calls++] = done;
    return 0;
}

/* What takes several passes over the voxels tells of all of them: not near the end after the first. */
static int even(void) {
    static struct steps s;
    vkt_volume *volume = NULL, *result = NULL;
    char* json = NULL;
    MUST(vkt_apply(WORDS("make", "noise", "--dims", "200", "200", "200", "--dtype", "uint16"), NULL, 0, &volume) ==
         VKT_OK);
    vkt_volume const* const both[] = {volume, volume};
    vkt_set_progress(noted, &s);
    double begin = now();
    MUST(vkt_measure(WORDS("diff", "--ssim"), both, 2, &json) == VKT_OK);
    double took = now() - begin;
    MUST(s.calls >= 10 || took < 0.5);
    MUST(s.calls < 40 || (s.told[s.calls / 4] < 0.5 && s.told[s.calls / 2] > 0.2 && s.told[s.calls - 1] > 0.9));
    vkt_free_text(json);
    s.calls = 0;
    begin = now();
    MUST(vkt_apply(WORDS("clahe", "--threads", "1"), both, 1, &result) == VKT_OK);
    took = now() - begin;
    MUST(s.calls >= 10 || took < 0.5);
    vkt_set_progress(NULL, NULL);
    vkt_free(result);
    vkt_free(volume);
    return 0;
}

int main(int argc, char** argv) {
    struct watch w = {0, 0, 0, 0, 0, pthread_self(), 0};
    if (argc == 2 && strcmp(argv[1], "policy") == 0) return policy();
    if (argc == 2 && strcmp(argv[1], "surface") == 0) return surface();
    if (argc == 2 && strcmp(argv[1], "even") == 0) return even();
    if (argc == 3 && strcmp(argv[1], "watch") == 0) return all_calls(argv[2], &w, VKT_OK);
    if (argc == 3 && strcmp(argv[1], "cancel") == 0) return cancel(argv[2]);
    return 2;
}
