/* The optimum of the QP, soft rows included, and what is left to try where the search finds none.
 *
 * A soft row that is violated costs stiffness x^2 / 2. Rows that are known to be violated are held: they become a part
 * of H, or where that would make H ill-conditioned, partly of the factor and for the rest equalities that give way. What
 * is not held is left to the search, which lets rows give way by their multiplier. Rows that were held and are not
 * violated are let go, and the search goes on until there are none. */
#ifndef WBC_SOFT_H
#define WBC_SOFT_H

#include "reduced_search.h"

/* Corrections of the rows that are held, before all is left to the search */
#define CORRECTED 12
/* Roundings of an entry of H, times its size */
#define ROUNDINGS 16.0

/* Weights may be so far apart that rounding makes H indefinite: as much as that on its diagonal makes it definite */
static void steady(double *H) {
    for (int i = 0; i < NV; i++) H[i * WIDE + i] *= 1.0 + ROUNDINGS * NV * EPS;
}

#if SOFT_ROWS > 0

/* 0: a soft row holds at x; else the bound that it violates */
static int violated(const wbc_tick *t, int k, const double *x) {
    const double at = row_at(t, k, x), least = 1e-12 * row_scale[k];
    if (at > t->high[NV + k] + least) return ACTIVE;
    return at < t->low[NV + k] - least ? ACTIVE | LOWER : 0;
}

INLINE int may_give(const wbc_tick *t, int k) {
    return SOFTENED(t, k) && (t->low[NV + k] > -WBC_INF || t->high[NV + k] < WBC_INF);
}

/* Equalities stay, rows that were switched off or moved out of reach go */
static void held_from_last(wbc_tick *t) {
    for (int k = 0; k < MC; k++) {
        if (t->later[k]) t->held[k] = t->later[k];
        t->later[k] = 0;
        const double bound = t->held[k] & LOWER ? t->low[NV + k] : t->high[NV + k];
        if (!may_give(t, k) || (t->idle[k] && !t->melted[k])) t->held[k] = 0;
        else if (t->low[NV + k] == t->high[NV + k]) t->held[k] = ACTIVE;
        else if (fabs(bound) >= WBC_INF) t->held[k] = 0;
    }
}

/* Rows that are held and modest go into H */
static void melt(wbc_tick *t) {
    double largest = 0.0;
    int stiff = 0;
    memcpy(t->H, t->own_H, sizeof t->H);
    memcpy(t->g, t->own_g, sizeof t->g);
    for (int i = 0; i < NV; i++) largest = larger(largest, t->H[i * WIDE + i] * dof_scale[i] * dof_scale[i]);
    /* Of more stiff rows than there are variables no few decide alone: together they make H well-conditioned again */
    for (int k = 0; k < MC; k++) stiff += t->held[k] != 0;
    const double modest = stiff > 2 * NV ? 1.0 / EPS : MODEST;
    for (int k = 0; k < MC; k++) {
        double square = 0.0;
        if (t->melted[k]) t->idle[k] = 0;
        t->melted[k] = 0;
        if (!t->held[k]) continue;
        for (int e = a_start[k]; e < a_end[k]; e++) {
            const double a = t->at[e] * dof_scale[a_col[e]];
            square += a * a;
        }
        const double cost = 1.0 / t->give[k];
        if (square > DEAD && cost * square > modest * largest) continue;
        t->melted[k] = t->idle[k] = 1;
        for (int e = a_start[k]; e < a_end[k]; e++) {
            const double f = cost * t->at[e];
            t->g[a_col[e]] -= f * met_side(t, k);
            for (int c = e; c < a_end[k]; c++) t->H[a_col[e] * WIDE + a_col[c]] += f * t->at[c];
        }
    }
}

/* Hold what x violates of the rows that were not held, let go what it does not of those that were; 1 if any changed.
 * `active`: rows that the search has made give way are no news. */
static int revise(wbc_tick *t, int active) {
    int changed = 0;
    for (int k = 0; k < MC; k++) {
        if (!may_give(t, k) || t->low[NV + k] == t->high[NV + k] || (t->idle[k] && !t->melted[k])) continue;
        const int now = violated(t, k, t->x);
        if (now == t->held[k] || (active && !t->held[k])) continue;
        t->held[k] = now;
        changed = 1;
    }
    return changed;
}

/* Rows that the search has made give way are held in the next tick */
static void hold_active(wbc_tick *t) {
    for (int a = 0; a < t->daqp.n_active; a++) {
        const int i = t->daqp.WS[a], k = i - NV;
        if (i >= NV && SOFTENED(t, k) && !t->held[k]) t->later[k] = ACTIVE | (t->sense[i] & LOWER);
    }
}

static void only_equalities(wbc_tick *t) {
    for (int k = 0; k < MC; k++)
        if (t->low[NV + k] != t->high[NV + k]) t->held[k] = 0;
}

/* H and g as they were, without rows that are held */
static void unmelt(wbc_tick *t) {
    memcpy(t->H, t->own_H, sizeof t->H);
    memcpy(t->g, t->own_g, sizeof t->g);
    for (int k = 0; k < MC; k++) t->idle[k] &= !t->melted[k];
    memset(t->melted, 0, sizeof t->melted);
}

/* Whether x keeps all that is hard */
static int hard_rows_hold(const wbc_tick *t) {
    for (int i = 0; i < NV; i++)
        if (t->x[i] < t->low[i] || t->x[i] > t->high[i]) return 0;
    for (int k = 0; k < MC; k++) {
        if (t->idle[k] || SOFTENED(t, k)) continue;
        const double sum = row_at(t, k, t->x);
        if (t->low[NV + k] == t->high[NV + k] || sum < t->low[NV + k] || sum > t->high[NV + k]) return 0;
    }
    return 1;
}

/* One search with the rows that are held; 1 where it has to be made again with others */
static int search_again(wbc_tick *t, int round, double angle, int *flag) {
    melt(t);
    t->factored = 0;
    *flag = -1;
    if (!factor(t)) {
        steady(t->own_H);
        melt(t);
        if (!factor(t)) return 0;
    }
    if (unconstrained(t)) {
        if (round < CORRECTED && revise(t, 0)) return 1;
        t->alone = 1;
        *flag = 0;
        return 0;
    }
    if (round < CORRECTED && hard_rows_hold(t) && revise(t, 0)) return 1;
    if (round == 0 && !t->warm) {
        for (int i = 0; i < NV; i++) t->x[i] = clamp(t->x[i], t->low[i], t->high[i]);
        if (revise(t, 0)) return 1;
    }
    *flag = constrained(t, angle);
    if (t->spent || round == CORRECTED) return 0;
    if (*flag >= 0) {
        if (revise(t, 1)) return 1;
        hold_active(t);
        return 0;
    }
    /* Hold all that the point without rows violates; where that is nothing new, the hard rows are at fault */
    solve_upper(t, t->y, t->x);
    for (int i = 0; i < NV; i++) t->x[i] = clamp(t->x[i], t->low[i], t->high[i]);
    return revise(t, 0);
}

#endif

/* DAQP's exit flag; `alone` where no row of the search binds */
static int optimum(wbc_tick *t, double angle) {
    int flag = -1;
    t->alone = 0;
#if SOFT_ROWS > 0
    memcpy(t->own_H, t->H, sizeof t->H);
    memcpy(t->own_g, t->g, sizeof t->g);
    memset(t->melted, 0, sizeof t->melted);
    held_from_last(t);
    t->settled = 1;
    for (int round = 0; round <= CORRECTED; round++) {
        if (round == CORRECTED) only_equalities(t);
        if (!search_again(t, round, angle, &flag)) break;
    }
    if (flag < 0) unmelt(t);
#else
    if (REDUCES) {
        flag = reduced_optimum(t);
        if (flag >= 0) return flag;
        if (t->reduced) t->prepared = 0;
        t->reduced = 0;
        t->whole = 1;
    }
    t->factored = 0;
    if (!t->prepared && !factor(t)) {
        steady(t->H);
        if (!factor(t)) return -1;
    }
    const int likely = begins_with_rows(t);
    if (likely) solve_transposed(t, t->y);
    else t->alone = unconstrained(t);
    flag = t->alone ? 0 : constrained(t, angle);
    if (likely && flag < 0) solve_upper(t, t->y, t->x);
#endif
    return flag;
}

#endif
