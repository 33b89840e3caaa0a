/* DAQP on the factored problem, and the optimum without rows that makes it unnecessary. */
#ifndef WBC_ACTIVE_SET_H
#define WBC_ACTIVE_SET_H

#include "factor.h"

static int row_is_dead(const wbc_tick *t, int i) {
    return t->scaling[i] == 0.0 || (t->low[i] <= -WBC_INF && t->high[i] >= WBC_INF);
}

/* Sides of the distance problem: bounds scaled, and moved by the unconstrained optimum -v */
static void shift(wbc_tick *t) {
    for (int i = 0; i < NV; i++) {
        const double sum = dot(t->inverse + i * WIDE, t->ldp_v, i) * t->scaling[i];
        t->dupper[i] = t->high[i] * t->scaling[i] + sum;
        t->dlower[i] = t->low[i] * t->scaling[i] + sum;
    }
    for (int k = 0; k < MC; k++) {
        if (t->idle[k]) continue;
        const double *row = t->M + k * NV;
        double sum = 0.0;
        for (int j = 0; j < NV; j++) sum += row[j] * t->ldp_v[j];
        t->dupper[NV + k] = t->high[NV + k] * t->scaling[NV + k] + sum;
        t->dlower[NV + k] = t->low[NV + k] * t->scaling[NV + k] + sum;
    }
}

/* By how much a row gives way per multiplier, of a price that it has or that a relaxation gives it; 0 for a hard row */
INLINE double softness(const wbc_tick *t, int k) {
    if (ELASTIC && t->elastic[k] > 0.0) return t->elastic[k];
    return SOFTENED(t, k) ? t->give[k] : 0.0;
}

/* By how much a soft row gives way per multiplier of the search */
INLINE double looseness(const wbc_tick *t, int k) {
#if SOFT_ROWS > 0
    return HELD(t, k) ? t->loose[k] : t->give[k];
#else
    (void)t, (void)k;
    return 0.0;
#endif
}

/* r = (M M')^-1 r for the first `count` active rows, from DAQP's factors L D L' */
static void solve_factors(const double *L, const double *D, int count, double *r) {
    for (int a = 0, at = 0; a < count; a++) {
        for (int b = 0; b < a; b++) r[a] -= L[at++] * r[b];
        at++;
    }
    for (int a = count - 1; a >= 0; a--) {
        r[a] /= D[a];
        for (int b = a + 1; b < count; b++) r[a] -= L[b * (b + 1) / 2 + a] * r[b];
    }
}

/* Put a row into the working set unless it depends on those that are in it; 1 if it went in */
static int activate(DAQPWorkspace *work, int i, int lower) {
    const int kind = work->sense[i] & (IMMUTABLE | SOFT);
    work->sense[i] = kind | ACTIVE | (lower ? LOWER : 0);
    add_constraint(work, i, lower ? -1.0 : 1.0);
    int ok = work->sing_ind == EMPTY_IND;
    for (int k = work->n_active > 2 ? work->n_active - 2 : 0; k < work->n_active; k++)
        if (work->D[k] < DEPENDENT) ok = 0;
    if (ok) return 1;
    for (int k = work->n_active - 1; k >= 0; k--)
        if (work->WS[k] == i) {
            work->sing_ind = EMPTY_IND;
            remove_constraint(work, k);
            break;
        }
    work->sing_ind = EMPTY_IND;
    work->sense[i] = kind;
    return 0;
}

/* The same for a general equality after others of its kind, as DAQP would: M M' = L D L' with one row more */
static int activate_equality(wbc_tick *t, int i) {
    DAQPWorkspace *work = &t->daqp;
    const int count = work->n_active;
    const double *row = t->M + (i - NV) * NV;
    double *next = t->L + count * (count + 1) / 2, rest = 0.0;
    for (int j = 0; j < NV; j++) rest += row[j] * row[j];
    for (int a = 0; a < count; a++) {
        const double *other = t->M + (work->WS[a] - NV) * NV;
        four sum = {0};
        int j = 0;
        for (; j + 4 <= NV; j += 4) sum += GIVEN_FOUR(row + j) * GIVEN_FOUR(other + j);
        next[a] = SUM_OF_FOUR(sum);
        for (; j < NV; j++) next[a] += row[j] * other[j];
    }
    for (int a = 0, at = 0; a < count; a++, at++)
        for (int b = 0; b < a; b++) next[a] -= t->L[at++] * next[b];
    for (int a = 0; a < count; a++) {
        const double part = next[a] / t->D[a];
        rest -= part * next[a];
        next[a] = part;
    }
    if (rest < DEPENDENT) return 0;
    t->D[count] = next[count] = rest;
    work->sense[i] |= ACTIVE;
    work->WS[count] = i;
    work->lam[count] = 1.0;
    work->n_active = count + 1;
    return 1;
}

/* What DAQP is given as its limit, one more than the iterations it may make; 0 where the cap leaves none */
static int granted(wbc_tick *t) {
    const int limit = t->brief ? t->brief : 100 + 10 * M_ALL;
    if (!(t->cap > 0.0)) return limit;
    const double left = t->cap - t->report.iterations;
    if (left >= limit) return limit;
    if (left >= 1.0) return (int)left + 1;
    t->spent = 1;
    return 0;
}

/* DAQP from the working set at hand, with its iterations counted; DAQP's exit flag */
static int search(wbc_tick *t, DAQPWorkspace *work, int limit) {
    t->settings.iter_limit = limit;
    /* Where the cap ends the search before its first iterate, the optimum without rows stands for it */
    if (t->cap > 0.0) memset(work->u, 0, work->n * sizeof(double));
    const int flag = daqp_ldp(work);
    t->spent = t->cap > 0.0 && flag == EXIT_ITERLIMIT && limit != t->brief;
    t->report.iterations += work->iterations - t->spent;
    return flag;
}

/* Rows whose multiplier may have any sign: equalities, and soft rows that are held */
static int stays(const wbc_tick *t, int i) {
    return t->low[i] == t->high[i] || (i >= NV && HELD(t, i - NV) && SOFTENED(t, i - NV));
}

/* Rows that every answer meets exactly */
static int is_equality(const wbc_tick *t, int i) {
    return t->low[i] == t->high[i] && !(i >= NV && SOFTENED(t, i - NV));
}

/* Whether a row that stays is met at its lower bound */
static int below(const wbc_tick *t, int i) {
#if SOFT_ROWS > 0
    return t->held[i - NV] & LOWER;
#else
    (void)t, (void)i;
    return 0;
#endif
}

/* x onto its active rows, of a relaxation whose rows are as `class_rows` makes them: multipliers of slack at a price of
 * 1 / RHO are so large that what they leave of hard rows is seen, in N m, where those nearly depend on each other. Corrections
 * with the factors at hand, of residuals in wide arithmetic, leave rounding of x. */
static void meet_active(wbc_tick *t) {
    DAQPWorkspace *work = &t->daqp;
    double mu[ACTIVE_MAX];
    for (int round = 0; round < MEETINGS && work->n_active > 0; round++) {
        for (int a = 0; a < work->n_active; a++) {
            const int i = work->WS[a], k = i - NV;
            wide gap = t->sense[i] & LOWER ? -(wide)t->low[i] : -(wide)t->high[i];
            if (k < 0) gap += t->x[i];
            for (int e = k < 0 ? 0 : a_start[k]; k >= 0 && e < a_end[k]; e++) gap += (wide)t->at[e] * t->x[a_col[e]];
            mu[a] = (double)gap * t->scaling[i] / (k < 0 ? 1.0 : row_scale[k]);
            if (t->sense[i] & SOFT) mu[a] -= t->settings.rho_soft * t->scaling[i] * work->lam_star[a];
        }
        solve_factors(t->L, t->D, work->n_active, mu);
        for (int a = 0; a < work->n_active; a++) {
            const int i = work->WS[a], k = i - NV;
            work->lam_star[a] += mu[a] * t->scaling[i];
            if (k < 0) t->x[i] -= mu[a] * dof_scale[i];
            for (int e = k < 0 ? 0 : a_start[k]; k >= 0 && e < a_end[k]; e++)
                t->x[a_col[e]] -= mu[a] * t->scaling[i] / row_scale[k] * t->at[e] * dof_scale[a_col[e]] * dof_scale[a_col[e]];
        }
    }
}

/* Whether x keeps what never gives way, bounds and rows of class 0, if that is below `checked`, but for rounding */
static int firm_rows_hold(const wbc_tick *t, int checked) {
    for (int i = 0; i < NV; i++) {
        const double tolerance = FIRMLY * dof_scale[i];
        if (!(t->x[i] >= t->low[i] - tolerance && t->x[i] <= t->high[i] + tolerance)) return 0;
    }
    for (int k = 0; k < MC; k++) {
        if (row_order[k] != 0 || checked == 0) continue;
        const double value = row_at(t, k, t->x), tolerance = FIRMLY * row_scale[k];
        if (!(value >= t->low[NV + k] - tolerance && value <= t->high[NV + k] + tolerance)) return 0;
    }
    return 1;
}

/* x of the point u that the search has found, in the metric of the factor, and multipliers of rows as they were given */
static void point(wbc_tick *t) {
    DAQPWorkspace *work = &t->daqp;
    double y[WIDE] = {0};
    for (int i = 0; i < NV; i++) y[i] = t->u[i] - t->ldp_v[i];
    for (int i = 0; i < NV; i++) t->x[i] = dot(t->inverse + i * WIDE, y, i);
    for (int a = 0; a < work->n_active; a++) work->lam_star[a] *= work->scaling[work->WS[a]];
}

/* Solve with the factorisation at hand. `warm`: start from the active set in `keep`. Rows of classes from
 * `checked` on may be violated where the solver cannot move them, rows that depend on others by `angle` |row| |v|.
 * `base`: the point that v is counted from, or NULL. DAQP's exit flag. */
static int active_set(wbc_tick *t, int warm, int checked, double angle, const double *base) {
    DAQPWorkspace *work = &t->daqp;
    const int limit = granted(t);
    int dependent = 0;
    if (limit == 0) return EXIT_ITERLIMIT;
    reset_daqp_workspace(work);
    for (int i = 0; i < M_ALL; i++) {
        const int soft = t->sense[i] & SOFT;
        t->sense[i] = row_is_dead(t, i) ? IMMUTABLE : soft;
        if (stays(t, i) && !row_is_dead(t, i)) t->sense[i] |= IMMUTABLE;
    }
    /* Equalities first: the later, dependent ones are left out and checked afterwards */
    int alike = 1;
    for (int i = 0; i < M_ALL; i++)
        if ((t->sense[i] & (IMMUTABLE | SOFT)) == IMMUTABLE && !row_is_dead(t, i)) {
            alike &= i >= NV;
            if (!(alike ? activate_equality(t, i) : activate(work, i, 0))) dependent = 1;
        }
    for (int i = NV; i < M_ALL; i++)
        if ((t->sense[i] & (IMMUTABLE | SOFT)) == (IMMUTABLE | SOFT) && !row_is_dead(t, i)) activate(work, i, below(t, i));
    if (warm)
        for (int i = 0; i < M_ALL; i++)
            if ((t->keep[i] & ACTIVE) && !(t->sense[i] & IMMUTABLE)) activate(work, i, t->keep[i] & LOWER);
    const int flag = search(t, work, limit);
    if (flag < 0) return flag;
    /* A relaxation has a metric of its own */
    if (base) ldp2qp_solution(work);
    else point(t);
    for (int i = 0; base && i < NV; i++) t->x[i] += base[i];
    /* A search can end with numbers that are none */
    if (!all_finite(t->x, NV)) return EXIT_CYCLE;
    if (base) {
        meet_active(t);
        if (!firm_rows_hold(t, checked)) return EXIT_CYCLE;
    }
    /* Rows that the solver did not look at: dependent equalities and rows that v cannot move. Of those that it did
     * look at, ones that v can hardly move may still be far off in their own units; a relaxation has seen to them. */
    for (int k = 0; k < MC; k++) {
        const int i = NV + k, seen = !dependent && t->scaling[i] != 0.0;
        if (t->idle[k] || row_order[k] >= checked) continue;
        if (seen ? angle > TIGHT : t->sense[i] & ACTIVE) continue;
        const double sum = row_at(t, k, t->x);
        double square = 0.0;
        for (int e = a_start[k]; e < a_end[k]; e++) square += t->at[e] * t->at[e];
        const double tolerance = (seen ? SEEN : TOLERANCE) * row_scale[k] + angle * sqrt(square * dot(t->x, t->x, 0));
        if (sum < t->low[i] - tolerance || sum > t->high[i] + tolerance) return EXIT_INFEASIBLE;
    }
    return flag;
}

static void remember(wbc_tick *t) {
    for (int i = 0; i < M_ALL; i++) t->keep[i] = t->sense[i];
    t->warm = 1;
}

static int within_bounds(const wbc_tick *t) {
    for (int i = 0; i < NV; i++)
        if (t->x[i] < t->low[i] || t->x[i] > t->high[i]) return 0;
    for (int k = 0; k < MC; k++) {
        const double low = t->low[NV + k], high = t->high[NV + k];
        if (t->idle[k]) continue;
        if (low == high || HELD(t, k)) return 0;
        const double sum = row_at(t, k, t->x);
        if (sum < low || sum > high) return 0;
    }
    return 1;
}

/* Whether the search begins with rows that were active in the last tick: then the optimum without rows is hardly the answer */
static int begins_with_rows(const wbc_tick *t) {
    int any = 0;
    for (int i = 0; t->warm && i < M_ALL; i++) any |= t->keep[i] & ACTIVE;
    return any != 0;
}

/* The optimum without rows; 1 if it respects all of them and is therefore the answer */
static int unconstrained(wbc_tick *t) {
    solve_transposed(t, t->y);
    solve_upper(t, t->y, t->x);
    t->daqp.n_active = 0;
    return within_bounds(t);
}

/* The active set of the QP whose factor is at hand, from the last one where that is of use */
static int from_last(wbc_tick *t, double angle) {
    for (int i = 0; i < M_ALL; i++) t->sense[i] = 0;
#if SOFT_ROWS > 0
    memcpy(t->soft_scaling, t->scaling, sizeof t->scaling);
    for (int k = 0; k < MC; k++) {
        if (!SOFTENED(t, k) || t->idle[k]) continue;
        t->sense[NV + k] = SOFT;
        t->soft_scaling[NV + k] *= sqrt(looseness(t, k));
    }
    t->daqp.scaling = t->soft_scaling;
    t->settings.rho_soft = 1.0;
#endif
    int flag = active_set(t, t->warm, LAST_ORDER + 1, angle, NULL);
    if (flag < 0 && t->warm && !t->spent) {
        for (int i = 0; i < M_ALL; i++) t->sense[i] &= SOFT;
        flag = active_set(t, 0, LAST_ORDER + 1, angle, NULL);
    }
#if SOFT_ROWS > 0
    t->daqp.scaling = t->scaling;
    t->settings.rho_soft = RHO;
    /* Multipliers came back in the scaling that says how soft a row is */
    for (int a = 0; flag >= 0 && a < t->daqp.n_active; a++)
        t->daqp.lam_star[a] *= t->scaling[t->daqp.WS[a]] / t->soft_scaling[t->daqp.WS[a]];
#endif
    return flag;
}

/* The distance problem of the factor at hand */
static void see_rows(wbc_tick *t) {
    if (!t->factored) {
        invert_factor(t);
        find_scaling(t);
        pack(t);
        image(t);
        for (int i = 0; i < WIDE; i++) t->ldp_v[i] = -t->y[i];
        t->factored = 1;
    }
    shift(t);
}

static int constrained(wbc_tick *t, double angle) {
    see_rows(t);
    return from_last(t, angle);
}

#endif
