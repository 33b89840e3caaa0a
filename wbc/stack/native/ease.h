/* Closed loops are no choice of the tick: where limits leave them no way, rounding gives way first, then limits of acceleration and
 * velocity, at last limits of position. docs/robots.md#closed-loops */
#ifndef WBC_EASE_H
#define WBC_EASE_H

#include "relax.h"

/* Rows that are exact may miss 0 at q (+) v dt by so much [rad, or characteristic lengths] */
#define EXACT 1e-10
/* By how much loops may stay open where joints at their stops would close them [rad, or characteristic lengths] */
#define EASED 2e-10
/* How much rows miss of loops that stay so: by velocities all of it in a tick, by accelerations w^2 e, w = 0.2 / dt, as in second.py */
#define CLOSING_RATE_SQUARED 0.04
INLINE double room_of(const wbc_tick *t, double open) {
    return COMMAND == VELOCITY ? open / t->dt : CLOSING_RATE_SQUARED * open / (t->dt * t->dt);
}
/* Whether there are loops, and whether limits give way to them as they need it: at prices they do in any case */
#define LOOPS ((COMMAND == VELOCITY ? BENDING : CLOSING) > 0)
#define LOOPS_LAST (LOOPS && !ELASTIC)
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

INLINE int exact_row(const wbc_tick *t, int k) {
    const int closes = COMMAND == VELOCITY ? bent[k] == 2 : k >= CLOSING_FIRST && k < CLOSING_FIRST + CLOSING;
    return closes && t->free_low[k] == t->free_high[k];
}

/* Closed loops get room, in units of rows; whether there are any */
static int ease_loops(wbc_tick *t, double room) {
    for (int k = 0; k < MC; k++) {
        if (!exact_row(t, k) || MINIMISED(k)) continue;
        t->low[NV + k] = t->free_low[k] - room_of(t, room) * row_scale[k];
        t->high[NV + k] = t->free_high[k] + room_of(t, room) * row_scale[k];
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
        open |= exact_row(t, k) && fabs(row_at(t, k, t->x) - t->free_low[k]) > 2.0 * room_of(t, EASED) * row_scale[k];
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

/* What takes joint i from where it is to `place` within the tick */
INLINE double command_to(const wbc_tick *t, int i, double place) {
    const double rate = (place - t->q[stop_q[i]]) / t->dt;
    return COMMAND == VELOCITY ? rate : 2.0 * (rate - t->v_last[i]) / t->dt;
}

/* Loops, what never gives way, and limits of position as far as they count in a tick where `stops`; other rows and limits go */
static void only_loops(wbc_tick *t, int stops) {
    for (int k = 0; k < MC; k++) {
        const int stays = exact_row(t, k) || FIRM_ROW(k);
        t->low[NV + k] = stays ? t->free_low[k] : -WBC_INF;
        t->high[NV + k] = stays ? t->free_high[k] : WBC_INF;
        t->idle[k] = !stays;
    }
    for (int i = 0; i < NV; i++) {
        const double far = FAR_AWAY * dof_scale[i];
        const int ends = stops && stop_at[i] >= 0 && t->bound_enabled[stop_at[i]] != 0.0;
        t->low[i] = ends ? smaller(t->low[i], larger(-far, command_to(t, i, stop_low[i]))) : -far;
        t->high[i] = ends ? larger(t->high[i], smaller(far, command_to(t, i, stop_high[i]))) : far;
    }
}

/* The command of loops nearest to the limits, into `x`; 0 where there is none */
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
    for (int i = 0; i < NV; i++) t->x[i] = COMMAND == VELOCITY ? t->v_last[i] : 0.0;
    form_bounds(t);
    memcpy(low, t->low, sizeof low);
    memcpy(high, t->high, sizeof high);
    for (int n = 0; !found && n < (COMMAND == VELOCITY ? 4 : 2) && !t->spent; n++) {
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

/* The QP again, where no velocity keeps all rows: those of loops are the last to give way */
static int again_with_room(wbc_tick *t, int *flag) {
    int found = -1;
    if (LOOPS && ease_loops(t, EASED)) found = optimum(t, TIGHT);
    if (found >= 0 || t->spent) return found;
    *flag = WBC_RELAXED;
    found = relaxed(t);
    if (LOOPS_LAST && t->eased > 0.0 && !t->spent && (found < 0 || loops_open(t))) {
        limits_give_way(t);
        ease_loops(t, EXACT);
        found = relaxed(t);
    }
    return found;
}

#endif
