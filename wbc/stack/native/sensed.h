/* Rows of sensed pairs: the entry of a velocity is side * (line . screw), see sensed_rows of a constraint. A row without a
 * pair, whose distance is FAR, is left out of the tick. */
#ifndef WBC_SENSED_H
#define WBC_SENSED_H

#include "balls.h"

#if SENSED > 0

INLINE double sensed_entry(const wbc_tick *t, const double *line, double side, int i) {
    const double *screw = t->screw + 6 * i;
    double sum = 0.0;
    for (int j = 0; j < 6; j++) sum += line[j] * screw[j];
    return side * sum;
}

static void sensed_rows(wbc_tick *t, int screen) {
    for (int b = 0; b < SENSED; b++) {
        for (int r = 0; r < sensed_count[b]; r++) {
            const int k = sensed_row[b] + r;
            const double *line = t->p + sensed_line[b] + 6 * r, *side = t->p + sensed_side[b] + DOFS * r;
            if (screen && t->p[sensed_distance[b] + r] >= 0.5 * FAR) {
                leave_out(t, k);
                continue;
            }
            t->far[k] = 0;
            for (int i = 0; i < DOFS; i++)
                t->at[a_start[k] + i] = side[i] == 0.0 ? 0.0 : sensed_entry(t, line, side[i], i);
        }
    }
}

/* The margins one step later: what the pairs close in a tick is added to what they are now */
static void sensed_ahead(wbc_tick *t) {
    for (int b = 0; b < SENSED; b++) {
        for (int r = 0; r < sensed_count[b]; r++) {
            const double *line = t->p + sensed_line[b] + 6 * r, *side = t->p + sensed_side[b] + DOFS * r;
            if (t->p[sensed_distance[b] + r] >= 0.5 * FAR) continue;
            double rate = 0.0;
            for (int i = 0; i < DOFS; i++)
                if (side[i] != 0.0) rate += sensed_entry(t, line, side[i], i) * t->report.v[i];
            t->report.ahead[margin_at[sensed_row[b] + r]] += rate * t->dt;
        }
    }
}

#endif

#endif
