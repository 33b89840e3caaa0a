/* How far the command can be from the optimum. */
#ifndef WBC_CERTIFY_H
#define WBC_CERTIFY_H

#include "reduced_bound.h"

/* No output is NaN: an error without a value is reported as inf, a margin as -inf */
static void replace_nan(double *x, int count, double by) {
    for (int i = 0; i < count; i++)
        if (x[i] != x[i]) x[i] = by;
}

/* |v - v*| <= |R^-1| |R^-T size|, with 1 / |R^-1|^2 >= the smallest entry of the purely diagonal part of H */
static double quick_bound(wbc_tick *t, const double *size) {
    double floor = WBC_INF;
    for (int i = 0; i < NV; i++) t->y[i] = damping[i];
    DIAGONALS
    for (int i = 0; i < NV; i++)
        if (t->y[i] < floor) floor = t->y[i];
    return sqrt(dot(size, size, 0)) / floor;
}

/* |v_i - v*_i| <= |row i of R^-1| (| |R^-T| size | + the part of the active rows); without active rows, which turn what is
 * between the two, |R^-1| |R^-T| size entry by entry */
static double sharp_bound(wbc_tick *t, const double *size) {
    double longest = 0.0, worst = 0.0, image_of_size[WIDE] = {0};
    if (!t->factored) invert_factor(t);
    for (int i = 0; i < NV; i += 4)
        for (int at = i & ~7; at < WIDE; at += 4) {
            four sum = GIVEN_FOUR(image_of_size + at);
            for (int r = i; r < TALL && r < i + 4; r++) sum += SIZE_OF_FOUR(GIVEN_FOUR(t->inverse + r * WIDE + at)) * EACH(size[r]);
            FOUR(image_of_size + at) = sum;
        }
    if (t->daqp.n_active > 0) {
        if (!t->factored) find_scaling(t);
        for (int i = 0; i < DOFS; i++) longest = larger(1.0 / t->scaling[i], longest);
        return longest * (sqrt(dot(image_of_size, image_of_size, 0)) + active_residual(t));
    }
    for (int i = 0; i < DOFS; i++) {
        four sum = {0};
        for (int at = i & ~7; at < WIDE; at += 4) sum += SIZE_OF_FOUR(GIVEN_FOUR(t->inverse + i * WIDE + at)) * GIVEN_FOUR(image_of_size + at);
        worst = larger(SUM_OF_FOUR(sum), worst);
    }
    return worst;
}

/* Roundings that a term of H v + g and of forces on it goes through in `gradient` and `add_forces` at most: its product, those of
 * four rows, of the groups of four rows or columns, and what comes after */
#define SUMMED(t) ((NV < WIDE / 4 + 8 ? NV : WIDE / 4 + 8) + (t)->daqp.n_active + (t)->reduced + 4)

/* residual = H v + g, and the size of the terms that were added up; four rows at a time */
static void gradient(const wbc_tick *t, const double *v, double *residual, double *size) {
    for (int i = 0; i < WIDE; i++) {
        residual[i] = t->g[i];
        size[i] = fabs(t->g[i]);
    }
    for (int i = 0; i < NV; i += 4) {
        const int count = NV - i < 4 ? NV - i : 4;
        four part[4] = {{0}}, bulk[4] = {{0}};
        for (int at = i; at < WIDE; at += 4) {
            const four here = GIVEN_FOUR(v + at);
            four down = {0}, heap = {0};
            for (int r = 0; r < count; r++) {
                four h = GIVEN_FOUR(t->H + (i + r) * WIDE + at);
                const four up = h * here;
                part[r] += up;
                bulk[r] += SIZE_OF_FOUR(up);
                if (at == i) h[r] = 0.0;
                const four push = h * EACH(v[i + r]);
                down += push;
                heap += SIZE_OF_FOUR(push);
            }
            FOUR(residual + at) += down;
            FOUR(size + at) += heap;
        }
        for (int r = 0; r < count; r++) {
            residual[i + r] += SUM_OF_FOUR(part[r]);
            size[i + r] += SUM_OF_FOUR(bulk[r]);
        }
    }
}

/* Add the forces of the active rows, set the multipliers and the complementarity */
static void add_forces(wbc_tick *t, const double *v, double *residual, double *size) {
    wbc_report *out = &t->report;
    const DAQPWorkspace *work = &t->daqp;
    for (int i = 0; i < M_ALL; i++) out->lambda[i] = 0.0;
    out->complementarity = 0.0;
    for (int a = 0; a < work->n_active; a++) {
        const int i = work->WS[a], k = i - NV;
        if (i < NV || MC == 0) continue; /* the second for compilers that look for rows where there are none */
        const double value = row_at(t, k, v);
        double lambda = work->lam_star[a];
        if (t->strength[k] > 0.0) lambda += t->strength[k] * (value - met_side(t, k));
        out->lambda[i] = lambda;
        for (int e = a_start[k]; e < a_end[k]; e++) {
            const double part = t->at[e] * lambda;
            residual[a_col[e]] += part;
            size[a_col[e]] += fabs(part);
        }
        const double given = t->give[k] * lambda;
        const double gap = fabs(lambda * (value - given - (t->sense[i] & LOWER ? t->low[i] : t->high[i])));
        if (gap > out->complementarity) out->complementarity = gap;
    }
    if (REDUCES && t->reduced) add_equality_forces(t, v, residual, size);
    /* Any multiplier of the right sign certifies: that of an active bound is what the other forces leave, which takes
     * their rounding too */
    for (int a = 0; a < work->n_active; a++) {
        const int i = work->WS[a];
        if (i >= NV) continue;
        const double lambda = -residual[i], rounding = SUMMED(t) * EPS * size[i];
        if (t->low[i] != t->high[i] && (t->sense[i] & LOWER ? -lambda : lambda) <= rounding) continue;
        out->lambda[i] = lambda;
        residual[i] = size[i] = 0.0;
    }
}

/* Row k, which is `value` at the command, among those that are violated */
INLINE void count_violation(wbc_tick *t, int k, double value) {
    const double missed = larger(lower_side(t, k) - value, value - upper_side(t, k));
    t->report.violation = larger(missed, t->report.violation);
    if (FIRM_ROW(k)) t->firm_missed = larger(missed, t->firm_missed);
}

/* Residuals and the error bound of v; leaves the residual of the stationarity in `scratch` */
static void examine(wbc_tick *t) {
    wbc_report *out = &t->report;
    double *residual = t->scratch, *size = t->product, v[WIDE] = {0};
    memcpy(v, out->v, sizeof out->v);
    gradient(t, v, residual, size);
    add_forces(t, v, residual, size);
    out->violation = t->firm_missed = 0.0;
    for (int k = 0, n = 0; k < MC; k++) {
        if (REDUCES && n < t->reduced && t->equal_row[n] == k) {
            count_violation(t, k, t->low[NV + k] + t->missed[n++]);
            continue;
        }
        if (t->low[NV + k] <= -WBC_INF && t->high[NV + k] >= WBC_INF) continue;
        if (SOFTENED(t, k) && (HELD(t, k) || t->sense[NV + k] & ACTIVE)) continue;
        count_violation(t, k, row_at(t, k, v));
    }
    out->stationarity = 0.0;
    for (int i = 0; i < NV; i++) {
        if (fabs(residual[i]) > out->stationarity) out->stationarity = fabs(residual[i]);
        /* residual of the exact sum: what was computed plus the rounding of its terms */
        size[i] = fabs(residual[i]) + SUMMED(t) * EPS * size[i];
    }
    if (REDUCES && t->reduced) {
        out->error_bound = reduced_bound(t, size);
        return;
    }
    out->error_bound = t->factored || t->curved ? WBC_INF : quick_bound(t, size);
    if (out->error_bound > QUICK_BOUND) out->error_bound = sharp_bound(t, size);
}

/* One Newton step on the active set, with y = R v:   dy + M' mu = -R^-T residual,   M dy = side - M y.
 * Needs what `constrained` leaves: R^-1, M, and the factors of M M'; without active rows R^-1. */
static void refine(wbc_tick *t) {
    DAQPWorkspace *work = &t->daqp;
    double dy[WIDE] = {0}, mu[ACTIVE_MAX];
    if (REDUCES && t->reduced) {
        double missed[WIDE];
        memcpy(missed, t->missed, sizeof t->missed);
        correct_reduced(t, missed, t->scratch);
        command(t);
        return;
    }
    for (int i = 0; i < NV; i++) axpy(dy, t->inverse + i * WIDE, -t->scratch[i], i);
    for (int a = 0; a < work->n_active; a++) mu[a] = side_gap(t, a) + seen_through(t, work->WS[a], dy);
    solve_gram(t, work->n_active, mu);
    for (int a = 0; a < work->n_active; a++) {
        push_back(t, work->WS[a], -mu[a], dy);
        work->lam_star[a] += mu[a] * t->scaling[work->WS[a]];
    }
    for (int i = 0; i < NV; i++) t->x[i] = t->report.v[i] + dot(t->inverse + i * WIDE, dy, i);
    command(t);
}

/* The same with the bound in wide arithmetic where it is not good enough */
static void examine_closely(wbc_tick *t) {
    examine(t);
    if (!(t->report.error_bound > GOOD_BOUND) || t->reduced) return;
    if (!t->factored) find_scaling(t);
    t->report.error_bound = smaller(wide_bound(t), t->report.error_bound);
}

/* No refinement is worth its while */
static int good(const wbc_report *out) { return out->error_bound <= GOOD_BOUND && out->violation <= GOOD_VIOLATION; }

static void tidy(wbc_report *out) {
    replace_nan(out->error, MT, HUGE_VAL);
    replace_nan(out->factor, MT, 0.0);
    replace_nan(out->margin, MH, -HUGE_VAL);
    replace_nan(out->margin_factor, MH, 0.0);
}

EXPORT void wbc_tick_certify(wbc_tick *t) {
    wbc_report *out = &t->report;
    tidy(out);
    if (out->flag == WBC_BRAKED || out->flag == WBC_CAPPED) {
        for (int i = 0; i < M_ALL; i++) out->lambda[i] = 0.0;
        out->stationarity = out->violation = out->complementarity = out->error_bound = WBC_INF;
        return;
    }
    examine_closely(t);
    for (int step = 0; step < REFINEMENTS && !good(out) && (t->factored || t->alone); step++) {
        const double bound = out->error_bound, missed = out->violation;
        double v[NV], multipliers[ACTIVE_MAX];
        memcpy(v, out->v, sizeof v);
        memcpy(multipliers, t->daqp.lam_star, sizeof multipliers);
        refine(t);
        examine_closely(t);
        if (!(out->error_bound < bound || (out->error_bound <= GOOD_BOUND && out->violation < missed))) {
            memcpy(out->v, v, sizeof v);
            memcpy(t->daqp.lam_star, multipliers, sizeof multipliers);
            examine_closely(t);
            break;
        }
    }
}

EXPORT void wbc_tick_look_ahead(wbc_tick *t) {
#if MH > 0
#if COMMAND == VELOCITY
    const double *way = t->report.v;
#else
    /* The mean velocity until the next tick */
    double way[NV];
    for (int i = 0; i < NV; i++) way[i] = t->v_last[i] + 0.5 * t->dt * t->report.v[i];
#endif
    const double *arg[4] = {t->q, way, t->p, &t->dt};
    double *res[2] = {t->report.ahead, t->segment_ahead};
    ahead(arg, res, t->work_iw, t->work_w, 0);
#if BALLS > 0
    balls_ahead(t);
#endif
#if SENSED > 0
    sensed_ahead(t);
#endif
    replace_nan(t->report.ahead, MH, -HUGE_VAL);
#else
    (void)t;
#endif
}

#endif
