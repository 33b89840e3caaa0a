/* Where accelerations lead until the next tick: loops are closed there, and the velocity keeps them closed. docs/robots.md */
#ifndef WBC_ARRIVE_H
#define WBC_ARRIVE_H

#include "bend.h"

#if COMMAND != VELOCITY

/* Newton steps at most, and how often joints are left out of them as they would pass their bounds */
#define CLOSING_STEPS 8
#define CLOSING_TRIES 4
/* What corrections of configurations within a tick come to at most [characteristic lengths or rad per second], with a share of the
 * fastest joint's way: linkages near dead points bend fast. Loops open by more are closed by their rows */
#define CLOSING_SPEED 0.1
#define CLOSING_SHARE 0.1
/* And those of velocities */
#define BENT_SPEED 1.0
/* Rows whose square without those before is below this share of it depend on them */
#define DEPENDENT_SQUARE 1e-12
/* The share of a bound that accelerations may pass it by, by rounding */
#define ROUNDED_BOUND 1e-9

#if CLOSING > 0

/* J W J' = L D L', L and 1 / D into `closing_factor`; 1 / D is 0 of rows that depend on those before. W is 0 of joints that are held */
static void factor_closing(wbc_tick *t, const int *held) {
    for (int i = 0; i < CLOSING; i++) {
        const double *row = t->closing_rows + i * DOFS;
        double *own = t->closing_factor + i * CLOSING, product[CLOSING + 1], square = 0.0;
        for (int k = 0; k <= i; k++) {
            const double *other = t->closing_rows + k * DOFS, *known = t->closing_factor + k * CLOSING;
            double sum = 0.0;
            for (int j = 0; j < DOFS; j++) sum += held[j] ? 0.0 : row[j] * other[j] * (dof_scale[j] * dof_scale[j]);
            square = sum;
            for (int n = 0; n < k; n++) sum -= product[n] * (k == i ? own[n] : known[n]);
            product[k] = sum;
            own[k] = k < i ? sum * known[k] : sum > DEPENDENT_SQUARE * square ? 1.0 / sum : 0.0;
        }
    }
}

/* The shortest change of joints that changes the rows by -e, which is changed */
static void shortest_change(const wbc_tick *t, const int *held, double *e, double *change) {
    for (int i = 0; i < CLOSING; i++)
        for (int k = 0; k < i; k++) e[i] -= t->closing_factor[i * CLOSING + k] * e[k];
    for (int i = 0; i < CLOSING; i++) e[i] *= t->closing_factor[i * CLOSING + i];
    for (int i = CLOSING - 1; i >= 0; i--)
        for (int k = i + 1; k < CLOSING; k++) e[i] -= t->closing_factor[k * CLOSING + i] * e[k];
    for (int j = 0; j < DOFS; j++) {
        double sum = 0.0;
        for (int i = 0; i < CLOSING; i++) sum -= t->closing_rows[i * DOFS + j] * e[i];
        change[j] = held[j] ? 0.0 : sum * (dof_scale[j] * dof_scale[j]);
    }
}

/* Where `way` leads from a configuration, what the loops are open by there, and their rows; the largest that they are open by */
static double arrive_at(wbc_tick *t, const double *from, const double *way) {
    const double *arg[4] = {from, way, t->p, &t->dt};
    double *res[3] = {t->report.next_q, t->opened, t->closing_rows}, most = 0.0;
    arrival(arg, res, t->work_iw, t->work_w, 0);
    for (int k = 0; k < CLOSING; k++) {
        t->report.lost[CLOSING_FIRST + k] = t->opened[k];
        most = larger(most, fabs(t->opened[k]) / row_scale[CLOSING_FIRST + k]);
        if (!isfinite(t->opened[k])) return WBC_INF;
    }
    return most;
}

/* Adds a change to their sum; whether that stays below `most` of each */
static int adds(const double *change, double *sum, double most) {
    int within = 1;
    for (int i = 0; i < DOFS; i++) {
        sum[i] += change[i];
        within &= fabs(sum[i]) <= most * dof_scale[i];
    }
    return within;
}

/* Loops closed to EXACT without the joints that are held, and the velocity `v` as near as keeps them closed; 0 where that takes larger
 * corrections than there may be */
static int close_there(wbc_tick *t, const double *way, const int *held, double share, double *v) {
    double from[NQ + 1], e[CLOSING + 1], change[NV], sum[NV] = {0};
    double fastest = 0.0, off = arrive_at(t, t->q, way);
    for (int i = 0; i < DOFS; i++) fastest = larger(fastest, fabs(way[i]) / dof_scale[i]);
    factor_closing(t, held);
    for (int n = 0; n < CLOSING_STEPS && off > EXACT; n++) {
        memcpy(e, t->opened, CLOSING * sizeof(double));
        shortest_change(t, held, e, change);
        if (!adds(change, sum, (CLOSING_SPEED + share * fastest) * t->dt)) return 0;
        for (int i = 0; i < DOFS; i++) change[i] /= t->dt;
        memcpy(from, t->report.next_q, NQ * sizeof(double));
        off = arrive_at(t, from, change);
        factor_closing(t, held);
    }
    if (!(off <= EXACT)) return 0;
    for (int i = 0; i < DOFS; i++) sum[i] = 0.0;
    /* Twice, as the squares of rows lose half of the digits */
    for (int n = 0; n < 2; n++) {
        for (int k = 0; k < CLOSING; k++) {
            e[k] = 0.0;
            for (int j = 0; j < DOFS; j++) e[k] += t->closing_rows[k * DOFS + j] * v[j];
        }
        shortest_change(t, held, e, change);
        if (!adds(change, sum, BENT_SPEED)) return 0;
        for (int i = 0; i < DOFS; i++) v[i] += change[i];
    }
    return 1;
}

/* Whether a number passes an end that the command keeps, or passes it by more than that */
INLINE int passes(double low, double high, double command, double number) {
    const double most = larger(high, command), least = smaller(low, command);
    return number > most + ROUNDED_BOUND * (1.0 + fabs(most)) || number < least - ROUNDED_BOUND * (1.0 + fabs(least));
}

/* Joints that would pass bounds of acceleration, rows of them alone, or limits of position are held from now on; whether there are
 * any */
static int hold_beyond(const wbc_tick *t, const double *v, int *held) {
    int before = 0, after = 0;
    double a[NV];
    for (int i = 0; i < DOFS; i++) {
        const double there = t->report.next_q[stop_q[i]];
        before += held[i];
        a[i] = (v[i] - t->v_last[i]) / t->dt;
        held[i] |= passes(t->low[i], t->high[i], t->report.v[i], a[i]);
        held[i] |= stop_at[i] >= 0 && t->bound_enabled[stop_at[i]] != 0.0 && (there < stop_low[i] || there > stop_high[i]);
    }
    for (int k = 0; k < MC; k++) {
        const int i = a_col[a_start[k]];
        const double factor = t->at[a_start[k]];
        if (a_end[k] - a_start[k] != 1 || i >= DOFS) continue;
        held[i] |= passes(t->free_low[k], t->free_high[k], factor * t->report.v[i], factor * a[i]);
    }
    for (int i = 0; i < DOFS; i++) after += held[i];
    return after > before;
}

/* As above, with joints at their bounds held as far as the loops can be closed without them */
static int close_within(wbc_tick *t, const double *way, double share) {
    int held[NV], none[NV];
    double v[NV];
    for (int i = 0; i < DOFS; i++) held[i] = none[i] = 0;
    for (int n = 0; n < CLOSING_TRIES; n++) {
        memcpy(v, t->report.next_v, DOFS * sizeof(double));
        if (!close_there(t, way, held, share, v)) break;
        if (!hold_beyond(t, v, held)) {
            memcpy(t->report.next_v, v, DOFS * sizeof(double));
            return 1;
        }
    }
    memcpy(v, t->report.next_v, DOFS * sizeof(double));
    if (!close_there(t, way, none, share, v)) return 0;
    memcpy(t->report.next_v, v, DOFS * sizeof(double));
    return 1;
}

/* The share is for loops that are closed where the tick begins */
static void close_arrival(wbc_tick *t, const double *way) {
    double rest[NV] = {0};
    if (close_within(t, way, 0.0)) return;
    if (arrive_at(t, t->q, rest) <= 10.0 * EXACT && close_within(t, way, CLOSING_SHARE)) return;
    arrive_at(t, t->q, way);
}

#endif

/* The velocity that the next tick counts from, and where loops are closed until then: at the mean velocity of accelerations that are
 * held */
EXPORT void wbc_tick_arrive(wbc_tick *t) {
    for (int i = 0; i < DOFS; i++) t->report.next_v[i] = t->v_last[i] + t->dt * t->report.v[i];
#if CLOSING > 0
    double way[NV];
    for (int i = 0; i < DOFS; i++) way[i] = t->v_last[i] + 0.5 * t->dt * t->report.v[i];
    if (CLOSING > 0) close_arrival(t, way);
#endif
    memcpy(t->v_last, t->report.next_v, DOFS * sizeof(double));
}

#endif

#endif
