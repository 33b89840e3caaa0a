/* check.c calls trapped_step in place of wbc_step: while it runs, any use of the heap ends the program. */
#include "wbc_tick.h"

#include <stdio.h>
#include <stdlib.h>

static int armed = 0;

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *old, size_t size);
void __real_free(void *old);

static void spring(void) {
    if (!armed) return;
    armed = 0;
    fputs("the heap was used within a step\n", stderr);
    exit(9);
}

void *__wrap_malloc(size_t size) {
    spring();
    return __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size) {
    spring();
    return __real_calloc(count, size);
}

void *__wrap_realloc(void *old, size_t size) {
    spring();
    return __real_realloc(old, size);
}

void __wrap_free(void *old) {
    spring();
    __real_free(old);
}

int trapped_step(wbc_controller *c, const double *q, const double *v) {
    armed = 1;
#ifdef LEAK
    void *volatile taken = malloc(16);
    free(taken);
#endif
    const int status = wbc_step(c, q, v);
    armed = 0;
    return status;
}
