/* What rows exert that keep the direction of a scaled task, or equality rows that bend, in a metric in which they are firm: see
 * reach.h. What keeps a direction takes part of its task's error, and that part has no curvature. */
#ifndef WBC_KEPT_H
#define WBC_KEPT_H

#include "reduced.h"

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

/* The same where they are taken out of the problem: what slope - (H + more / dof_scale^2) step leaves on the variables that they give */
static void held_by_reduced(const wbc_tick *t, const double *slope, const double *step, double more, double *force) {
    double rest[WIDE], lambda[WIDE], z[WIDE] = {0};
    for (int c = 0; c < t->width; c++) z[c] = step[t->left[c]] / dof_scale[t->left[c]];
    for (int n = 0; n < t->reduced; n++) {
        const int i = t->given[n];
        rest[i] = thin_dot(t->product_of_basis + i * WIDE, z) + more / (dof_scale[i] * dof_scale[i]) * step[i] - slope[i];
    }
    multipliers_of(t, rest, lambda);
    for (int k = 0; k < MC; k++) force[MT + k] = 0.0;
    for (int k = 0; k < t->reduced; k++)
        if (bent[t->equal_row[k]]) force[MT + t->equal_row[k]] = -lambda[k];
}

/* Whether rows are exact: closed loops */
INLINE int has_exact_rows(void) {
    int any = 0;
    for (int k = 0; k < MC; k++) any |= bent[k] == 2;
    return any;
}

#endif
