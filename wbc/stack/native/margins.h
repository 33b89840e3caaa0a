/* Margins that the joints can still brake for, and rows that no allowed velocity can violate. */
#ifndef WBC_MARGINS_H
#define WBC_MARGINS_H

#include "settings.h"

/* Share of the joints' accelerations along a margin that braking in front of it counts on */
#define BRAKING_MARGIN 0.25

/* How fast the joints may lessen a margin h > 0 that falls by `closing` without them, so that with the deceleration a
 * they stand still before it is used up: v dt + v^2 / (2 a) + closing v / a = h */
INLINE double stopping(double h, double a, double closing, double dt) {
    const double lag = dt + closing / a;
    return 2.0 * h / (lag + sqrt(lag * lag + 2.0 * h / a));
}

/* What each velocity counts on to brake in front of margins, WBC_INF without a limit; whether any has one */
static int find_braking(const wbc_tick *t, double *limit) {
    int limited = 0;
    for (int i = 0; i < NV; i++) {
        const int on = brake_at[i] >= 0 && t->bound_enabled[brake_at[i]] != 0.0;
        limit[i] = on ? BRAKING_MARGIN * brake_limit[i] : WBC_INF;
        limited |= on;
    }
    return limited;
}

/* A margin h > 0 may fall by rate h, as the row says, or as fast as the joints can stop with a part of their
 * acceleration, whichever is less. Joints at rest always satisfy the second. docs/reach.md */
static void brake_for_margins(wbc_tick *t) {
    double limit[NV];
    const int limited = find_braking(t, limit);
    for (int k = 0; limited && k < MC; k++) {
        if (margin_at[k] < 0 || t->free_low[k] <= -WBC_INF) continue;
        const double h = t->report.margin[margin_at[k]], plain = t->p[rate_at[k]] * h;
        if (!(plain > 0.0)) continue;
        double a = 0.0;
        for (int e = a_start[k]; e < a_end[k]; e++)
            if (t->at[e] != 0.0 && a_col[e] < DOFS) a += fabs(t->at[e]) * limit[a_col[e]];
        /* also where a is 0 and nothing moves the margin */
        if (!(a > 0.0 && a < WBC_INF * 1e-6)) continue;
        const double closing = t->free_low[k] + plain, speed = stopping(h, a, larger(closing, 0.0), t->dt);
        t->free_low[k] = larger(t->free_low[k], smaller(closing, 0.0) - speed);
    }
}

/* Rows that hold for every velocity within the bounds need not be looked at */
static void find_idle_rows(wbc_tick *t) {
    for (int k = 0; k < MC; k++) {
        const double low = t->low[NV + k], high = t->high[NV + k];
        t->idle[k] = low <= -WBC_INF && high >= WBC_INF;
        if (t->idle[k] || low == high) continue;
        double least = 0.0, most = 0.0;
        for (int e = a_start[k]; e < a_end[k]; e++) {
            const int i = a_col[e];
            const double one = t->at[e] * t->low[i], other = t->at[e] * t->high[i];
            least += smaller(one, other);
            most += larger(one, other);
        }
        t->idle[k] = least > low + TOLERANCE * row_scale[k] && most < high - TOLERANCE * row_scale[k];
    }
}

#endif
