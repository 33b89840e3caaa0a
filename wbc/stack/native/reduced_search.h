/* The optimum of the reduced problem, see reduced.h: rows that bind are found by DAQP among the motions that are left. */
#ifndef WBC_REDUCED_SEARCH_H
#define WBC_REDUCED_SEARCH_H

#include "active_set.h"

/* Whether general row k is one that the search looks at */
INLINE int is_looked_at(const wbc_tick *t, int k) { return !t->idle[k] && t->low[NV + k] != t->high[NV + k]; }

/* x of the reduced problem without bounds */
static void reduced_point(wbc_tick *t) {
    double sides[WIDE], y[WIDE];
    for (int k = 0; k < t->reduced; k++) sides[k] = t->low[NV + t->equal_row[k]];
    by_rows(t, sides, t->x, 0);
    reduced_forces(t, t->x, t->g, y);
    for (int i = 0; i < NV; i++) t->x[i] -= thin_dot(t->through + i * WIDE, y);
}

static int reduced_point_holds(const wbc_tick *t) {
    for (int i = 0; i < NV; i++)
        if (t->x[i] < t->low[i] || t->x[i] > t->high[i]) return 0;
    for (int k = 0; k < MC; k++) {
        if (!is_looked_at(t, k)) continue;
        const double value = row_at(t, k, t->x);
        if (value < t->low[NV + k] || value > t->high[NV + k]) return 0;
    }
    return 1;
}

/* Row i, of length one, as the search sees it, and its sides from the point x on; 0 where no motion that is left changes it, and it
 * does not hold */
static int see_reduced(wbc_tick *t, int i, double *row, double value, double unit) {
    double *packed = t->seen + i * t->width;
    const double square = thin_dot(row, row), scale = square > DEAD ? 1.0 / sqrt(square) : 0.0;
    t->scaling[i] = scale;
    for (int c = 0; c < t->width; c++) packed[c] = row[c] * scale;
    t->dupper[i] = (t->high[i] - value) * scale;
    t->dlower[i] = (t->low[i] - value) * scale;
    return scale != 0.0 || (value >= t->low[i] - TOLERANCE * unit && value <= t->high[i] + TOLERANCE * unit);
}

static int see_all_reduced(wbc_tick *t) {
    double row[WIDE];
    int ok = 1;
    for (int i = 0; i < NV; i++) ok &= see_reduced(t, i, t->through + i * WIDE, t->x[i], dof_scale[i]);
    for (int k = 0; k < MC; k++) {
        t->scaling[NV + k] = 0.0;
        if (!is_looked_at(t, k)) continue;
        for (int at = 0; at < THIN; at += 4) FOUR(row + at) = (four){0};
        for (int e = a_start[k]; e < a_end[k]; e++) thin_add(row, t->through + a_col[e] * WIDE, t->at[e]);
        ok &= see_reduced(t, NV + k, row, row_at(t, k, t->x), row_scale[k]);
    }
    return ok;
}

/* DAQP, from the rows that bound in the last tick; its exit flag */
static int search_reduced(wbc_tick *t, int warm) {
    DAQPWorkspace *work = &t->daqp;
    reset_daqp_workspace(work);
    for (int i = 0; i < M_ALL; i++) t->sense[i] = row_is_dead(t, i) ? IMMUTABLE : 0;
    for (int i = 0; warm && i < M_ALL; i++)
        if ((t->keep[i] & ACTIVE) && !(t->sense[i] & IMMUTABLE)) activate(work, i, t->keep[i] & LOWER);
    const int flag = search(t, work, granted(t));
    return flag < 0 && warm ? search_reduced(t, 0) : flag;
}

/* DAQP's exit flag; below 0 also where the problem is one for all variables. `alone`: no row binds but equalities */
static int reduced_optimum(wbc_tick *t) {
    DAQPWorkspace *work = &t->daqp;
    if (t->cap > 0.0 || t->whole) return EXIT_INFEASIBLE;
    if (!(t->reduced && same_equalities(t))) {
        t->prepared = 0;
        if (!eliminate(t)) return EXIT_INFEASIBLE;
    }
    if (!t->prepared && !factor_reduced(t)) return EXIT_INFEASIBLE;
    see_basis(t);
    reduced_point(t);
    t->prepared = t->factored = 1;
    work->n_active = 0;
    for (int i = 0; i < M_ALL; i++) t->sense[i] = 0;
    t->alone = reduced_point_holds(t);
    if (t->alone) return 0;
    if (t->width == 0 || !see_all_reduced(t)) return EXIT_INFEASIBLE;
    work->n = t->width;
    work->ms = 0;
    work->M = t->seen;
    const int flag = search_reduced(t, t->warm);
    work->n = work->ms = NV;
    work->M = t->M;
    if (flag < 0) return flag;
    for (int i = 0; i < NV; i++) {
        double sum = 0.0;
        for (int c = 0; c < t->width; c++) sum += t->through[i * WIDE + c] * t->u[c];
        t->x[i] += sum;
    }
    for (int a = 0; a < work->n_active; a++) work->lam_star[a] *= t->scaling[work->WS[a]];
    return flag;
}

#endif
