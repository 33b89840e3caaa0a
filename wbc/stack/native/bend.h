/* Equality rows hold at q, and what they keep at 0 bends until q (+) v dt: they are made to make up for it. docs/reach.md */
#ifndef WBC_BEND_H
#define WBC_BEND_H

#include "primal.h"

/* A residual may bend by so much [rad, or characteristic lengths, per second]; at a gain of 10/s a tenth of that remains */
#define BENDS 1e-3
/* Rows that are exact may miss 0 at q (+) v dt by so much [rad, or characteristic lengths] */
#define EXACT 1e-10
/* Where joints that are stopped by bounds are to be left out of account, as others make up for them in one tick more than their
 * Jacobians say: as above */
#define STRETCHED 2e-2
/* Corrections at most, and where exact rows alone miss what they may; how often at most the step gets shorter, each time by so much
 * more on the diagonal of H */
#define BENDINGS 8
#define REFINED 24
#define SHORTER 3
#define STEEPER 100.0
/* A joint that moves at this rate and moved at it the other way in the last tick turns round [rad, or characteristic lengths, per
 * second]: where rows bend it is not their tasks that want it */
#define TURNING 1.0

/* What the equality rows lose at the command and do not make up for; the largest as a rate, in row units. `all`: what they miss
 * of moved sides, too, which is not what the order of sacrifice has taken. */
EXPORT double wbc_tick_find_lost(wbc_tick *t, int all) {
#if BENDING > 0
    const double *arg[4] = {t->q, t->report.v, t->p, &t->dt};
    double *res[1] = {t->report.lost}, worst = 0.0;
    lost(arg, res, t->work_iw, t->work_w, 0);
    for (int k = 0; k < MC; k++) {
        t->report.lost[k] += (t->bend[k] + (all ? row_at(t, k, t->report.v) - t->free_low[k] : 0.0)) * t->dt;
        if (!(bent[k] && t->free_low[k] == t->free_high[k] && isfinite(t->report.lost[k]))) t->report.lost[k] = 0.0;
        worst = larger(worst, fabs(t->report.lost[k]) / row_scale[k]);
    }
    return worst / t->dt;
#else
    (void)t, (void)all;
    return 0.0;
#endif
}

#if BENDING > 0
/* How far rows are from what is allowed: `worst` of those that bend, and what exact ones miss; above 1 where they are */
static double bent_by(const wbc_tick *t, double worst) {
    double opened = 0.0;
    for (int k = 0; k < MC; k++)
        if (bent[k] == 2) opened = larger(opened, fabs(t->report.lost[k]) / row_scale[k]);
    return larger(worst / BENDS, opened / EXACT);
}
#endif

/* The rows as they are at q */
static void unbend(wbc_tick *t) {
    memset(t->bend, 0, sizeof t->bend);
    memset(t->stopped, 0, sizeof t->stopped);
    t->curving = t->shortened = 0.0;
}

#if BENDING > 0

/* Both sides of the equality rows to where `bend` wants them, and the problem as it was assembled */
static void bend_rows(wbc_tick *t, const double *bend) {
#if SOFT_ROWS > 0
    unmelt(t);
#endif
    for (int k = 0; k < MC; k++) {
        if (t->free_low[k] != t->free_high[k]) continue;
        t->free_low[k] = t->free_high[k] = t->free_low[k] + (bend[k] - t->bend[k]);
        t->bend[k] = bend[k];
    }
    t->prepared = 0;
    memset(t->report.slack, 0, sizeof t->report.slack);
    own_sides(t);
}

/* The problem again, with the curvature of equality rows, and without counting on joints that bounds stop at the command; 0 where
 * that is what it was */
static int curve_rows(wbc_tick *t) {
    int changed = !CALM;
    own_sides(t);
    for (int i = 0; i < NV; i++) {
        t->stopped[i] = t->report.lambda[i] != 0.0 && t->low[i] != t->high[i];
        changed |= t->stopped[i] != 0.0;
    }
    t->curving = 1.0;
    if (changed) assemble(t, 1);
    return changed;
}

/* The problem again, with a shorter step */
static void shorten(wbc_tick *t) {
    memset(t->bend, 0, sizeof t->bend);
    t->shortened = t->shortened == 0.0 ? t->stiffness : STEEPER * t->shortened;
    assemble(t, 1);
}

static int turns_round(const wbc_tick *t) {
    int turns = 0;
    for (int i = 0; i < DOFS; i++) {
        const double now = t->report.v[i] / dof_scale[i], before = t->v_last[i] / dof_scale[i];
        turns |= now * before < 0.0 && smaller(fabs(now), fabs(before)) > TURNING;
    }
    return turns;
}

/* A row that loses too much gives way by it; whether any does */
static int report_lost(wbc_tick *t) {
    int gave_way = 0;
    for (int k = 0; k < MC; k++) {
        const double rate = fabs(t->report.lost[k]) / t->dt;
        if (rate <= BENDS * row_scale[k]) continue;
        t->report.slack[k] = larger(t->report.slack[k], rate);
        gave_way = 1;
    }
    return gave_way;
}

#endif

#endif
