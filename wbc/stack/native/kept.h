/* What keeps the direction of a scaled task takes part of its error, and that part has no curvature: see reach.h. */
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

#endif
