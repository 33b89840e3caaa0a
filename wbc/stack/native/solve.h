/* From the QP to the command. */
#ifndef WBC_SOLVE_H
#define WBC_SOLVE_H

#include "margins.h"
#include "ease.h"

#if COMMAND == VELOCITY
INLINE int brakes_slowly(const wbc_tick *t, int i) { return brake_at[i] >= 0 && t->bound_enabled[brake_at[i]] != 0.0; }

/* Share of its speed that the joint has after this tick whose acceleration limit lets it stop last */
static double kept_speed(const wbc_tick *t) {
    double share = 0.0;
    for (int i = 0; i < DOFS; i++)
        if (brakes_slowly(t, i) && t->v_last[i] != 0.0) share = larger(share, 1.0 - brake_limit[i] * t->dt / fabs(t->v_last[i]));
    return share;
}
#endif

/* The command that brings a joint to rest, and the wrench that a contact keeps. Of velocities, what has no acceleration limit, such
 * as a floating base, stops together with the joint that takes longest; of torques a robot whose base floats stops as by damping. */
INLINE double rest(const wbc_tick *t, int i, double share) {
#if COMMAND == VELOCITY
    return i >= DOFS || brakes_slowly(t, i) ? 0.0 : share * t->v_last[i];
#else
    (void)share;
    return i < DOFS ? -t->v_last[i] * (ELASTIC ? REST_RATE : 1.0 / t->dt) : t->kept[i];
#endif
}

/* Damping and the weight, of a robot whose base floats: the accelerations nearest to -REST_RATE v, which contacts are in accord
 * with, and the wrenches nearest to those that are kept, that the base and loops have. What motors lack for them their torques are cut by. */
static void damp(wbc_tick *t) {
    double H[NV * WIDE], g[WIDE], nearest[NV];
    memcpy(H, t->H, sizeof t->H);
    memcpy(g, t->g, sizeof t->g);
    memcpy(nearest, t->x, sizeof nearest);
    own_sides(t);
    memset(t->H, 0, sizeof t->H);
    memset(t->g, 0, sizeof t->g);
    for (int i = 0; i < NV; i++) {
        t->H[i * WIDE + i] = (i < DOFS ? 1.0 : WRENCH_SHARE) / (dof_scale[i] * dof_scale[i]);
        t->g[i] = -t->H[i * WIDE + i] * nearest[i];
    }
    for (int k = 0; k < MC; k++) {
        if (row_order[k] < HOLDS && t->low[NV + k] == t->high[NV + k]) continue;
        t->low[NV + k] = -WBC_INF;
        t->high[NV + k] = WBC_INF;
        t->idle[k] = 1;
    }
    t->factored = 0;
    if (factor(t)) {
        solve_transposed(t, t->y);
        see_rows(t);
        memset(t->sense, 0, sizeof t->sense);
        if (active_set(t, 0, 0, LOOSE, NULL) < 0) memcpy(t->x, nearest, sizeof nearest);
    }
    memcpy(t->H, H, sizeof t->H);
    memcpy(t->g, g, sizeof t->g);
    t->factored = t->prepared = 0;
    own_sides(t);
}

/* Come to rest as fast as the bounds let each joint */
static void brake(wbc_tick *t) {
    /* A relaxation may have moved the bounds */
    form_bounds(t);
    memset(t->report.beyond, 0, sizeof t->report.beyond);
#if COMMAND == VELOCITY
    const double share = kept_speed(t);
#else
    const double share = 0.0;
#endif
    for (int i = 0; i < NV; i++) {
        const double low = t->low[i], high = t->high[i];
        t->x[i] = low <= high ? clamp(rest(t, i, share), low, high) : 0.0;
    }
    if (ELASTIC && t->unusable == 0.0) damp(t);
    t->daqp.n_active = 0;
    t->warm = 0;
}

/* The cap ended the search. From braking towards the velocity that was found so far, `found`, as far as no row leaves
 * its bounds by it, and rows that braking misses are not missed by more; braking itself where `share` is 0. */
static void partly(wbc_tick *t, const double *found, double share) {
    double step[NV];
    brake(t);
    for (int i = 0; i < NV; i++) step[i] = (isfinite(found[i]) ? clamp(found[i], t->low[i], t->high[i]) : 0.0) - t->x[i];
    for (int k = 0; k < MC; k++) {
        if (MINIMISED(k) || price_at[k] >= 0) continue;
        const double at = row_at(t, k, t->x), change = row_at(t, k, step), rounding = TOLERANCE * row_scale[k];
        const double down = t->free_low[k] - rounding - at, up = t->free_high[k] + rounding - at;
        if (change < 0.0 && change < down) share = smaller(share, smaller(down, 0.0) / change);
        if (change > 0.0 && change > up) share = smaller(share, larger(up, 0.0) / change);
    }
    for (int i = 0; i < NV; i++) t->x[i] += share * step[i];
}

/* What a tick commands whose search the cap has ended; `first`: that of the whole problem, from which the next tick
 * goes on */
static void stop_early(wbc_tick *t, int first) {
    double found[NV];
    if (first) {
        point(t);
        remember(t);
    }
    memcpy(found, t->x, sizeof found);
    partly(t, found, first ? 1.0 : 0.0);
    t->warm = first;
}

/* x as the command: within its bounds, and exactly on those that are active */
static void command(wbc_tick *t) {
    for (int i = 0; i < NV; i++) t->report.v[i] = clamp(t->x[i], t->low[i], t->high[i]);
    for (int a = 0; a < t->daqp.n_active; a++) {
        const int i = t->daqp.WS[a];
        if (i < NV) t->report.v[i] = t->sense[i] & LOWER ? t->low[i] : t->high[i];
    }
}

/* By how much rows give way at the command; whether any does */
static int report_slack(wbc_tick *t, int flag) {
    int gave_way = 0;
    for (int k = 0; (flag == WBC_RELAXED || flag == WBC_CAPPED) && k < MC; k++) {
        const double value = row_at(t, k, t->report.v);
        const double slack = MINIMISED(k) || price_at[k] >= 0 ? 0.0 : fmax(t->free_low[k] - value, value - t->free_high[k]);
        const double rounding = larger(2.0 * TOLERANCE, exact_row(t, k) ? 2.0 * room_of(t, t->eased) : 0.0);
        t->report.slack[k] = slack > rounding * row_scale[k] ? slack : 0.0;
        gave_way |= t->report.slack[k] > 0.0;
    }
    for (int i = 0; i < NV; i++) gave_way |= t->report.beyond[i] > 0.0;
    return gave_way;
}

/* Whether the search ended at a point that misses bounds or rows: in single precision it may not see that they contradict
 * each other, and multipliers grow until nothing of the point is true */
static int mistaken(const wbc_tick *t) {
#ifdef WBC_SINGLE
    for (int i = 0; i < NV; i++) {
        const double tolerance = SOUND * dof_scale[i];
        if (!(t->x[i] >= t->low[i] - tolerance && t->x[i] <= t->high[i] + tolerance)) return 1;
    }
    for (int k = 0; k < MC; k++) {
        const double value = row_at(t, k, t->x), tolerance = SOUND * row_scale[k];
        if (!(value >= t->low[NV + k] - tolerance && value <= t->high[NV + k] + tolerance)) return 1;
    }
#endif
    (void)t;
    return 0;
}

EXPORT int wbc_tick_solve(wbc_tick *t) {
    int flag = uncross(t) ? WBC_RELAXED : WBC_SOLVED;
    t->report.iterations = 0.0;
    t->factored = t->spent = t->alone = t->proven = 0;
    t->eased = 0.0;
    memset(t->report.beyond, 0, sizeof t->report.beyond);
    memset(t->elastic, 0, sizeof t->elastic);
    find_idle_rows(t);
    if (t->unusable != 0.0) {
        brake(t);
        flag = WBC_BRAKED;
    } else {
        int exit_flag = optimum(t, TIGHT);
        const int first = t->spent;
        if (exit_flag >= 0 && mistaken(t)) exit_flag = -1;
        if (exit_flag < 0 && MC > 0 && !first) {
            exit_flag = again_with_room(t, &flag);
        }
        if (t->spent) {
            stop_early(t, first);
            flag = WBC_CAPPED;
        } else if (exit_flag < 0) {
            own_sides(t);
            t->proven = impossible(t) && !t->spent;
            brake(t);
            flag = WBC_BRAKED;
        } else if (t->alone) {
            t->warm = 0;
        } else {
            remember(t);
        }
    }
    int finite = 1;
    for (int i = 0; i < NV; i++) finite &= isfinite(t->x[i]) != 0;
    if (!finite) {
        brake(t);
        flag = WBC_BRAKED;
    }
    command(t);
    const int gave_way = report_slack(t, flag);
    /* Rows that contradict each other by rounding only: what is certified are their own bounds */
    if (flag == WBC_RELAXED && !gave_way) {
        flag = WBC_SOLVED;
        own_sides(t);
    }
    t->report.flag = flag;
    return flag;
}

#endif
