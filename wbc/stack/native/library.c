/* What a process loads: the tick, values from Python, and many ticks in one call */
#include "tick.c"

#include "follow.h"
#include "many.h"

/* Ticks go on here that other code of the same stack has done on the same fields of memory.h */
EXPORT void wbc_tick_take_over(wbc_tick *t, const int *carried) {
    const size_t known = offsetof(wbc_tick, prepared);
    memset((char *)t + known, 0, sizeof *t - known);
    begin(t);
    wbc_tick_resume(t, carried);
    memcpy(t->q_good, t->q, NQ * sizeof(double));
}
