/* Ticks along rows of numbers, each from where the one before led to, until one needs to be looked at. */
#ifndef WBC_FOLLOW_H
#define WBC_FOLLOW_H

#include "builtins.h"

/* Which numbers, and what ends a run of ticks: a slack of one of some rows above `most`, or no velocity above `rest` */
typedef struct {
    const wbc_cycle *cycle;
    const int *at; /* where each number of a row goes in p */
    long long numbers, first, end; /* numbers of a row; general rows whose slack is watched */
    double most, rest;
    int flag, stopped; /* of the last tick; not 0: it is not among those that are done */
} wbc_follow;

static int is_pushed(const wbc_tick *t, const wbc_follow *f) {
    for (long long k = f->first; k < f->end; k++)
        if (t->report.slack[k] > f->most) return 1;
    return 0;
}

static int is_at_rest(const wbc_tick *t, double rest) {
    for (int i = 0; i < DOFS; i++)
        if (fabs(t->report.v[i]) >= rest) return 0;
    return 1;
}

/* How many ticks are done and lead from q[0] to q[1], ...: all, or those before one that has a flag, misses a pair, or is pushed, whose
 * report stands; or those up to one at rest */
EXPORT long long wbc_tick_follow(wbc_follow *f, const double *rows, long long count, double *q) {
    const wbc_cycle *c = f->cycle;
    const size_t size = (size_t)c->coordinates * sizeof(double);
    f->stopped = 0;
    for (long long k = 0; k < count; k++) {
        const double *row = rows + k * f->numbers;
        double *next = q + (k + 1) * c->coordinates;
        for (long long i = 0; i < f->numbers; i++) c->tick->p[f->at[i]] = row[i];
        memcpy(c->q, next - c->coordinates, size);
        if (c->watch->count) wbc_tick_sense(c->tick, c->watch);
        f->flag = wbc_tick_step(c->tick);
        f->stopped = f->flag || (c->watch->count && wbc_tick_missed(c->tick, c->watch) >= MISSED) || is_pushed(c->tick, f);
        if (f->stopped) return k;
        move_to_next(c, next);
        if (is_at_rest(c->tick, f->rest)) return k + 1;
    }
    return count;
}

#endif
