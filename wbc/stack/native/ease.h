/* Closed loops are no choice of the tick: where limits leave them no way, rounding gives way first, then limits of acceleration and
 * velocity, at last limits of position. docs/robots.md#closed-loops */
#ifndef WBC_EASE_H
#define WBC_EASE_H

#include "relax.h"

/* Rows that are exact may miss 0 at q (+) v dt by so much [rad, or characteristic lengths] */
#define EXACT 1e-10
/* By how much loops may stay open where joints at their stops would close them [rad, or characteristic lengths] */
#define EASED 2e-10
/* Steps between limits and what loops allow at most, on the way to where these are nearest to each other */
#define NEARINGS 50

/* Where a row whose bounds have crossed is met: half-way, and of a limit of motion, a row of one joint, where it asks for least */
INLINE double meeting(const wbc_tick *t, int k) {
    const double low = t->low[NV + k], high = t->high[NV + k];
    const int motion = ELASTIC && row_order[k] > HOLDS && a_end[k] - a_start[k] == 1 && a_col[a_start[k]] < DOFS;
    return motion ? clamp(0.0, high, low) : 0.5 * (low + high);
}

/* Rows whose bounds have crossed meet them; 1 if any gives way by more than rounding. Actuators never do. */
static int uncross(wbc_tick *t) {
    int crossed = 0;
    for (int k = 0; k < MC; k++) {
        const double gap = t->low[NV + k] - t->high[NV + k];
        if (gap <= 0.0) continue;
        t->low[NV + k] = t->high[NV + k] = meeting(t, k);
        t->prepared = 0;
        if (gap <= 4.0 * TOLERANCE * row_scale[k]) continue;
        crossed = 1;
        if (row_order[k] == 0) t->unusable = 1.0;
    }
    return crossed;
}

/* The bounds as they were before anything gave way, those that cross met half-way */
static void own_sides(wbc_tick *t) {
    form_bounds(t);
    for (int k = 0; k < MC; k++) {
        t->low[NV + k] = MINIMISED(k) ? -WBC_INF : t->free_low[k];
        t->high[NV + k] = MINIMISED(k) ? WBC_INF : t->free_high[k];
    }
    uncross(t);
}

#if COMMAND == VELOCITY && BENDING > 0

INLINE int exact_row(const wbc_tick *t, int k) { return bent[k] == 2 && t->free_low[k] == t->free_high[k]; }

/* Closed loops get room, in units of rows; whether there are any */
static int ease_loops(wbc_tick *t, double room) {
    for (int k = 0; k < MC; k++) {
        if (!exact_row(t, k) || MINIMISED(k)) continue;
        t->low[NV + k] = t->free_low[k] - room * row_scale[k] / t->dt;
        t->high[NV + k] = t->free_high[k] + room * row_scale[k] / t->dt;
        t->eased = room;
    }
    t->prepared = t->reduced = 0;
    t->whole = 1;
    return t->eased > 0.0;
}

/* Whether loops open at x */
static int loops_open(const wbc_tick *t) {
    int open = 0;
    for (int k = 0; k < MC; k++)
        open |= exact_row(t, k) && fabs(row_at(t, k, t->x) - t->free_low[k]) > 2.0 * EASED * row_scale[k] / t->dt;
    return open;
}

/* Where loops branch no velocity makes up for what they lose at the last one */
static void unbend_loops(wbc_tick *t) {
    for (int k = 0; k < MC; k++) {
        if (!exact_row(t, k)) continue;
        t->free_low[k] = t->free_high[k] = t->free_low[k] - t->bend[k];
        t->bend[k] = 0.0;
    }
}

/* Loops alone, and limits of position as far as they count in a tick where `stops`; other rows and limits go */
static void only_loops(wbc_tick *t, int stops) {
    for (int k = 0; k < MC; k++) {
        const int exact = exact_row(t, k);
        t->low[NV + k] = exact ? t->free_low[k] : -WBC_INF;
        t->high[NV + k] = exact ? t->free_high[k] : WBC_INF;
        t->idle[k] = !exact;
    }
    for (int i = 0; i < NV; i++) {
        const double far = FAR_AWAY * dof_scale[i];
        const int ends = stops && stop_at[i] >= 0 && t->bound_enabled[stop_at[i]] != 0.0;
        t->low[i] = ends ? smaller(t->low[i], larger(-far, (stop_low[i] - t->q[stop_q[i]]) / t->dt)) : -far;
        t->high[i] = ends ? larger(t->high[i], smaller(far, (stop_high[i] - t->q[stop_q[i]]) / t->dt)) : far;
    }
}

/* The velocity of loops nearest to the limits, into `x`; 0 where there is none */
static int nearest_to_limits(wbc_tick *t, const double *low, const double *high) {
    memset(t->H, 0, sizeof t->H);
    for (int i = 0; i < NV; i++) t->H[i * WIDE + i] = 1.0 / (dof_scale[i] * dof_scale[i]);
    for (int n = 0; n < NEARINGS; n++) {
        for (int i = 0; i < NV; i++) t->g[i] = -t->H[i * WIDE + i] * clamp(t->x[i], low[i], high[i]);
        t->prepared = t->factored = t->warm = 0;
        if (optimum(t, LOOSE) < 0) return 0;
    }
    return 1;
}

/* Limits give way as far as loops need it, where these have a way */
static void limits_give_way(wbc_tick *t) {
    double H[NV * WIDE], g[WIDE], low[NV], high[NV];
    int found = 0;
    memcpy(H, t->H, sizeof t->H);
    memcpy(g, t->g, sizeof t->g);
    memcpy(t->x, t->v_last, sizeof t->v_last);
    form_bounds(t);
    memcpy(low, t->low, sizeof low);
    memcpy(high, t->high, sizeof high);
    for (int n = 0; !found && n < 4 && !t->spent; n++) {
        if (n == 2) unbend_loops(t);
        only_loops(t, n % 2 == 0);
        found = nearest_to_limits(t, low, high);
    }
    memcpy(t->H, H, sizeof t->H);
    memcpy(t->g, g, sizeof t->g);
    own_sides(t);
    for (int i = 0; found && i < NV; i++) {
        t->low[i] = smaller(t->low[i], t->x[i]);
        t->high[i] = larger(t->high[i], t->x[i]);
        t->report.beyond[i] = larger(low[i] - t->low[i], t->high[i] - high[i]);
    }
    t->prepared = 0;
}

#endif

/* The QP again, where no velocity keeps all rows: those of loops are the last to give way */
static int again_with_room(wbc_tick *t, int *flag) {
    int found = -1;
#if COMMAND == VELOCITY && BENDING > 0
    if (ease_loops(t, EASED)) found = optimum(t, TIGHT);
    if (found >= 0 || t->spent) return found;
#endif
    *flag = WBC_RELAXED;
    found = relaxed(t);
#if COMMAND == VELOCITY && BENDING > 0
    if (t->eased > 0.0 && !t->spent && (found < 0 || loops_open(t))) {
        limits_give_way(t);
        ease_loops(t, EXACT);
        found = relaxed(t);
    }
#endif
    return found;
}

#endif
