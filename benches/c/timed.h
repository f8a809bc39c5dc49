/* Time, and what a run of reads prints: shared by the masters of this folder. */
#ifndef TIMED_H
#define TIMED_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static inline int64_t now_on(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static inline int64_t now(void) { return now_on(CLOCK_MONOTONIC); }

static int by_size(const void *a, const void *b) {
    int64_t left = *(const int64_t *)a, right = *(const int64_t *)b;
    return (left > right) - (left < right);
}

/* Calls `cycle` (0 is success) `warm` times, then `cycles` times or until `limit` is over, and prints JSON, in seconds. */
__attribute__((unused)) static int timed_run(int (*cycle)(void), long warm, long cycles, int64_t limit) {
    int64_t *took = calloc((size_t)cycles, sizeof *took);
    if (took == NULL) return 1;
    for (long n = 0; n < warm; n++)
        if (cycle() != 0) return 1;
    int64_t cpu = now_on(CLOCK_PROCESS_CPUTIME_ID), start = now(), before = start;
    long done = 0;
    while (done < cycles && before - start < limit) {
        if (cycle() != 0) return 1;
        int64_t after = now();
        took[done++] = after - before;
        before = after;
    }
    cpu = now_on(CLOCK_PROCESS_CPUTIME_ID) - cpu;
    qsort(took, (size_t)done, sizeof *took, by_size);
    printf("{\"cycles\": %ld, \"seconds\": %.9f, \"median\": %.9f, \"cpu\": %.9f}\n", done, 1e-9 * (double)(before - start),
           1e-9 * (double)took[done / 2], 1e-9 * (double)cpu);
    free(took);
    return 0;
}

#endif
