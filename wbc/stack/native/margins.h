/* Margins that the joints can still brake for, and rows that no allowed velocity can violate. */
#ifndef WBC_MARGINS_H
#define WBC_MARGINS_H

#include "settings.h"

/* Share of the joints' accelerations along a margin that braking in front of it counts on */
#define BRAKING_MARGIN 0.25

/* A margin h > 0 may fall by rate h, as the row says, or by the speed from which the joints can stop within h with a
 * part of their acceleration, whichever is less: v dt + v^2 / (2 a) <= h. What comes nearer by itself no joint brakes:
 * of the joints the second asks no more than to stand still. docs/reach.md */
static void brake_for_margins(wbc_tick *t) {
    double limit[NV];
    int limited = 0;
    for (int i = 0; i < NV; i++) {
        const int on = brake_at[i] >= 0 && t->bound_enabled[brake_at[i]] != 0.0;
        limit[i] = on ? BRAKING_MARGIN * brake_limit[i] : WBC_INF;
        limited |= on;
    }
    for (int k = 0; limited && k < MC; k++) {
        if (margin_at[k] < 0) continue;
        const double h = t->report.margin[margin_at[k]], plain = t->p[rate_at[k]] * h;
        if (!(plain > 0.0)) continue;
        double a = 0.0;
        for (int e = a_start[k]; e < a_start[k + 1]; e++)
            if (t->at[e] != 0.0) a += fabs(t->at[e]) * limit[a_col[e]];
        /* also where a is 0 and nothing moves the margin */
        if (!(a > 0.0 && a < WBC_INF * 1e-6)) continue;
        const double speed = 2.0 * h / (t->dt + sqrt(t->dt * t->dt + 2.0 * h / a));
        if (speed < plain) t->free_low[k] = smaller(t->free_low[k] + plain - speed, larger(t->free_low[k], 0.0));
    }
}

/* Rows that hold for every velocity within the bounds need not be looked at */
static void find_idle_rows(wbc_tick *t) {
    for (int k = 0; k < MC; k++) {
        const double low = t->low[NV + k], high = t->high[NV + k];
        double least = 0.0, most = 0.0;
        for (int e = a_start[k]; e < a_start[k + 1]; e++) {
            const int i = a_col[e];
            const double one = t->at[e] * t->low[i], other = t->at[e] * t->high[i];
            least += smaller(one, other);
            most += larger(one, other);
        }
        t->idle[k] = low < high && least > low + TOLERANCE * row_scale[k] && most < high - TOLERANCE * row_scale[k];
    }
}

#endif
