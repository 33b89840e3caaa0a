/* Ticks of many robots, one after the other on one tick's memory, which stays in the cache: a robot keeps its inputs, and
 * what its next tick starts from. */
#ifndef WBC_MANY_H
#define WBC_MANY_H

#include "carried.h"
#include "values.h"

#include <sched.h>

#define REPORT_SIZE sizeof(wbc_report)
/* Of what the caller writes, which stands between the report and H */
#define INPUT_SIZE (offsetof(wbc_tick, H) - offsetof(wbc_tick, q))
#define PROBLEM_SIZE (offsetof(wbc_tick, unusable) - offsetof(wbc_tick, H))

/* A value of each robot: where it is of the first, and how many bytes further of the next (0: one for all); what it is, see
 * values.h; where it goes in a robot's inputs, and how many numbers it has */
typedef struct {
    const char *from;
    long long stride, kind, at, size;
} wbc_given;

/* Where the threads of a call are; what they count together stands on lines of the cache of its own. All zero before the call,
 * and no thread waits or takes anything any more where all is `count`. */
typedef struct {
    long long checked, line_1[7]; /* first robot whose values no thread has taken to check */
    long long fine, line_2[7];    /* robots that are checked */
    long long refused, line_3[7]; /* not 0: a value is */
    long long next, line_4[7];    /* first robot that no thread has taken to write or tick */
} wbc_shared;

/* Robots that a thread takes at a time: to check or write their values, to tick; and to tick in a call */
#define VALUES_PIECE 256
#define PIECE 16
#define CALL 4096

static int values_fit(const wbc_given *given, int values, long long first, long long end) {
    for (const wbc_given *g = given; g < given + values; g++)
        for (long long k = first; k < (g->stride ? end : first + 1); k++)
            if (!is_value((int)g->kind, (int)g->size, (const double *)(g->from + k * g->stride))) return 0;
    return 1;
}

/* Whether all values of all robots fit: every thread that calls it is told so when all are checked */
static int all_fit(wbc_shared *s, const wbc_given *given, int values, long long count) {
    for (;;) {
        const long long first = __atomic_fetch_add(&s->checked, VALUES_PIECE, __ATOMIC_RELAXED);
        const long long end = first + VALUES_PIECE < count ? first + VALUES_PIECE : count;
        if (first >= end) break;
        if (!values_fit(given, values, first, end)) __atomic_store_n(&s->refused, 1, __ATOMIC_RELAXED);
        __atomic_fetch_add(&s->fine, end - first, __ATOMIC_RELEASE);
    }
    while (__atomic_load_n(&s->fine, __ATOMIC_ACQUIRE) < count) sched_yield();
    return !__atomic_load_n(&s->refused, __ATOMIC_RELAXED);
}

/* Values of robot k into its inputs */
INLINE void put_values(double *inputs, const wbc_given *given, int values, long long k) {
    double *to = (double *)((char *)inputs + k * (long long)INPUT_SIZE);
    for (const wbc_given *g = given; g < given + values; g++)
        put_value((int)g->kind, (int)g->size, (const double *)(g->from + k * g->stride), to + g->at);
}

/* Check values by several threads; 0 where one is refused */
EXPORT int wbc_many_fit(wbc_shared *s, const wbc_given *given, int values, long long count) {
    return all_fit(s, given, values, count);
}

/* Check values by several threads and write them into the inputs; 0, and nothing is written, where one is refused */
EXPORT int wbc_many_take(wbc_shared *s, const wbc_given *given, int values, long long count, double *inputs) {
    if (!all_fit(s, given, values, count)) return 0;
    for (;;) {
        const long long first = __atomic_fetch_add(&s->next, VALUES_PIECE, __ATOMIC_RELAXED);
        const long long end = first + VALUES_PIECE < count ? first + VALUES_PIECE : count;
        if (first >= end) return 1;
        for (long long k = first; k < end; k++) put_values(inputs, given, values, k);
    }
}

/* Check values, and write those of each robot and tick it, by several threads with a `t` each. 0, and nothing is changed, where
 * a value is refused; 1 where no robot is left; 2 where there are some: the caller has a look at signals, and calls again. Of a
 * robot whose tick ends with a flag in `left`, bits of 1 << flag, nothing but its values is changed: it is the caller's. Flags
 * with WBC_UNSOUND are bits above, refusals are not expected. */
EXPORT int wbc_tick_many(wbc_tick *t, wbc_shared *s, const wbc_given *given, int values, long long count, double *inputs,
                         double *reports, int *carried, int *flags, int left) {
    const int carry = wbc_tick_carried();
    if (!all_fit(s, given, values, count)) return 0;
    for (int done = 0; done < CALL; done += PIECE) {
        const long long first = __atomic_fetch_add(&s->next, PIECE, __ATOMIC_RELAXED);
        const long long end = first + PIECE < count ? first + PIECE : count;
        if (first >= end) return 1;
        for (long long k = first; k < end; k++) {
            char *input = (char *)inputs + k * (long long)INPUT_SIZE;
            put_values(inputs, given, values, k);
            memcpy(t->q, input, INPUT_SIZE);
            wbc_tick_resume(t, carried + k * carry);
            flags[k] = wbc_tick_step(t);
            if (flags[k] < 0 || (left >> flags[k] & 1)) continue;
            memcpy((char *)reports + k * (long long)REPORT_SIZE, &t->report, REPORT_SIZE);
            memcpy(input, t->q, INPUT_SIZE);
            wbc_tick_suspend(t, carried + k * carry);
        }
    }
    return 2;
}

/* H, g, A and the bounds of the QP of each robot at its inputs, as they stand in memory; where `tasks` is given, J, desired rates
 * and weights of the task rows [MT, NV], [MT], [MT] */
EXPORT void wbc_tick_qp_many(wbc_tick *t, long long count, const double *inputs, double *problems, double *tasks) {
    for (long long k = 0; k < count; k++) {
        memcpy(t->q, (const char *)inputs + k * (long long)INPUT_SIZE, INPUT_SIZE);
        wbc_tick_assemble(t);
        memcpy((char *)problems + k * (long long)PROBLEM_SIZE, t->H, PROBLEM_SIZE);
        if (!tasks) continue;
        double *J = tasks + k * MT * (NV + 2LL), *desired = J + MT * NV, *weight = desired + MT;
        wbc_tick_task_rows(t, J);
        for (int r = 0; r < MT; r++) desired[r] = t->desired[r], weight[r] = t->weight[r] * t->report.factor[r];
    }
}

#endif
