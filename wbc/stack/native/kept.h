/* What rows exert that keep the direction of a scaled task, or equality rows that bend, in a metric in which they are firm: see
 * reach.h. What keeps a direction takes part of its task's error, and that part has no curvature. */
#ifndef WBC_KEPT_H
#define WBC_KEPT_H

#include "factor.h"

/* Weighted errors without what the rows that keep their direction hold at `step`, in a metric with firm rows */
static void without_kept(const wbc_tick *t, const double *step, double *force) {
    for (int k = 0; k < MC; k++) {
        const int row = kept_of[k];
        if (row >= 0 && t->strength[k] != 0.0) force[row] -= t->strength[k] * row_at(t, k, step) * t->report.factor[row];
    }
}

/* What equality rows that bend hold against the weighted errors, behind those */
static void held_back(const wbc_tick *t, const double *step, double *force) {
    for (int k = 0; k < MC; k++) force[MT + k] = bent[k] ? -t->strength[k] * row_at(t, k, step) : 0.0;
}

/* Whether rows are exact: closed loops */
INLINE int has_exact_rows(void) {
    int any = 0;
    for (int k = 0; k < MC; k++) any |= bent[k] == 2;
    return any;
}

#endif
