/* What one tick leaves to the next beside its inputs: the active sets of its searches, as integers one after the other. */
#ifndef WBC_CARRIED_H
#define WBC_CARRIED_H

#include "tick.h"

#define FIRST_CARRIED(X) X(keep, M_ALL)
#if SOFT_ROWS > 0
#define SOFT_CARRIED(X) X(held, MC + 1) X(later, MC + 1)
#else
#define SOFT_CARRIED(X)
#endif
#if LEVELS > 0
#define LEVELS_CARRIED(X) X(levels.keep, (LEVELS + 1) * M_ALL) X(levels.warm, LEVELS + 1)
#else
#define LEVELS_CARRIED(X)
#endif
#define CARRIED(X) FIRST_CARRIED(X) SOFT_CARRIED(X) LEVELS_CARRIED(X)

/* How many integers they are */
EXPORT int wbc_tick_carried(void) {
#define COUNTED(name, count) +(count)
    return 1 CARRIED(COUNTED);
}

/* Take over what was carried */
EXPORT void wbc_tick_resume(wbc_tick *t, const int *from) {
#define TAKEN(name, count) \
    memcpy(t->name, from, (size_t)(count) * sizeof(int)); \
    from += count;
    t->warm = *from++;
    CARRIED(TAKEN)
}

/* What is carried from here on */
EXPORT void wbc_tick_suspend(const wbc_tick *t, int *to) {
#define LEFT(name, count) \
    memcpy(to, t->name, (size_t)(count) * sizeof(int)); \
    to += count;
    *to++ = t->warm;
    CARRIED(LEFT)
}

#endif
