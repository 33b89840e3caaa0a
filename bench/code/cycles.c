/* Times every step of an exported tick along a recorded path:  ./cycles path.bin ROUNDS [times.bin]
 *
 * path.bin holds numbers of 8 bytes: ticks, NQ, NV, NP; then for each tick q, the run-time inputs and v commanded. One
 * round is a pass from a reset, after one that is not timed; times.bin receives the nanoseconds of every tick of every
 * round. Printed: statuses other than 0, the largest difference from v, and what two readings of the clock take. */
#define _POSIX_C_SOURCE 199309L
#include "wbc_tick.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double nanoseconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return 1e9 * (double)now.tv_sec + (double)now.tv_nsec;
}

static int bad;
static double largest;

/* One pass; `spent` may be NULL */
static void pass(wbc_controller *c, const double *path, int ticks, double *spent) {
    wbc_reset(c, NULL);
    for (int k = 0; k < ticks; k++) {
        const double *q = path + k * (WBC_NQ + WBC_NP + WBC_NV), *v = q + WBC_NQ + WBC_NP;
        for (int i = 0; i < WBC_NP; i++) wbc_inputs(c)[i] = q[WBC_NQ + i];
        const double begin = nanoseconds();
        const int status = wbc_step(c, q, NULL);
        const double end = nanoseconds();
        if (spent) spent[k] = end - begin;
        bad += status != 0;
        for (int i = 0; i < WBC_NV; i++) largest = fmax(largest, fabs(wbc_last(c)->v[i] - v[i]));
    }
}

static double empty(void) {
    double least = HUGE_VAL;
    for (int k = 0; k < 1000; k++) {
        const double begin = nanoseconds();
        least = fmin(least, nanoseconds() - begin);
    }
    return least;
}

int main(int argc, char **argv) {
    static wbc_memory memory;
    double head[4];
    FILE *file = argc > 2 ? fopen(argv[1], "rb") : NULL;
    if (!file || fread(head, 8, 4, file) != 4 || head[1] != WBC_NQ || head[2] != WBC_NV || head[3] != WBC_NP) return 2;
    const int ticks = (int)head[0], rounds = atoi(argv[2]);
    const size_t numbers = (size_t)ticks * (WBC_NQ + WBC_NP + WBC_NV);
    double *path = malloc(8 * numbers), *spent = malloc(8 * (size_t)ticks);
    if (!path || !spent || fread(path, 8, numbers, file) != numbers) return 2;
    fclose(file);
    FILE *times = argc > 3 ? fopen(argv[3], "wb") : NULL;
    if (argc > 3 && !times) return 2;
    wbc_controller *c = wbc_init(&memory);
    pass(c, path, ticks, NULL);
    for (int k = 0; k < rounds; k++) {
        pass(c, path, ticks, spent);
        if (times && fwrite(spent, 8, (size_t)ticks, times) != (size_t)ticks) return 2;
    }
    if (times) fclose(times);
    printf("%d %.3g %.0f\n", bad, largest, empty());
    free(path);
    free(spent);
    return 0;
}
