/* Ticks of many robots, one after the other on one tick's memory, which stays in the cache: a robot keeps its inputs, and
 * what its next tick starts from. */
#ifndef WBC_MANY_H
#define WBC_MANY_H

#include "tick.h"

#define REPORT_SIZE sizeof(wbc_report)
/* Of what the caller writes, which stands between the report and H */
#define INPUT_SIZE (offsetof(wbc_tick, H) - offsetof(wbc_tick, q))
#define PROBLEM_SIZE (offsetof(wbc_tick, unusable) - offsetof(wbc_tick, H))

/* What one tick leaves to the next beside its inputs: the active sets of its searches */
typedef struct {
    int warm, keep[M_ALL];
#if SOFT_ROWS > 0
    int held[MC + 1], later[MC + 1];
#endif
#if LEVELS > 0
    int level_keep[(LEVELS + 1) * M_ALL], level_warm[LEVELS + 1];
#endif
} wbc_carried;

EXPORT long long wbc_tick_carried_size(void) { return (long long)sizeof(wbc_carried); }

/* Take over what a robot carries */
EXPORT void wbc_tick_resume(wbc_tick *t, const wbc_carried *from) {
    t->warm = from->warm;
    memcpy(t->keep, from->keep, sizeof t->keep);
#if SOFT_ROWS > 0
    memcpy(t->held, from->held, sizeof t->held);
    memcpy(t->later, from->later, sizeof t->later);
#endif
#if LEVELS > 0
    memcpy(t->levels.keep, from->level_keep, sizeof t->levels.keep);
    memcpy(t->levels.warm, from->level_warm, sizeof t->levels.warm);
#endif
}

/* What the robot carries from here on */
EXPORT void wbc_tick_suspend(const wbc_tick *t, wbc_carried *to) {
    to->warm = t->warm;
    memcpy(to->keep, t->keep, sizeof t->keep);
#if SOFT_ROWS > 0
    memcpy(to->held, t->held, sizeof t->held);
    memcpy(to->later, t->later, sizeof t->later);
#endif
#if LEVELS > 0
    memcpy(to->level_keep, t->levels.keep, sizeof t->levels.keep);
    memcpy(to->level_warm, t->levels.warm, sizeof t->levels.warm);
#endif
}

/* One tick of each robot. Of a robot whose tick ends with a flag in `left`, bits of 1 << flag, nothing is changed: it is
 * the caller's. Flags with WBC_UNSOUND are bits above, refusals are not expected. */
EXPORT void wbc_tick_many(wbc_tick *t, long long count, double *inputs, double *reports, wbc_carried *carried, int *flags,
                          int left) {
    for (long long k = 0; k < count; k++) {
        char *input = (char *)inputs + k * (long long)INPUT_SIZE;
        memcpy(t->q, input, INPUT_SIZE);
        wbc_tick_resume(t, carried + k);
        flags[k] = wbc_tick_step(t);
        if (flags[k] < 0 || (left >> flags[k] & 1)) continue;
        memcpy((char *)reports + k * (long long)REPORT_SIZE, &t->report, REPORT_SIZE);
        memcpy(input, t->q, INPUT_SIZE);
        wbc_tick_suspend(t, carried + k);
    }
}

/* H, g, A and the bounds of the QP of each robot at its inputs, as they stand in memory */
EXPORT void wbc_tick_qp_many(wbc_tick *t, long long count, const double *inputs, double *problems) {
    for (long long k = 0; k < count; k++) {
        memcpy(t->q, (const char *)inputs + k * (long long)INPUT_SIZE, INPUT_SIZE);
        wbc_tick_assemble(t);
        memcpy((char *)problems + k * (long long)PROBLEM_SIZE, t->H, PROBLEM_SIZE);
    }
}

#endif
