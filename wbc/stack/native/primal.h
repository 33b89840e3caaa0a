/* The optimum again, where double precision or DAQP leaves it uncertain: a primal active set in wide arithmetic.
 *
 * From a point that keeps all hard rows, each step minimises the cost over the rows that hold it,
 *
 *     K p + G + A_E' mu = 0,   A_E p = d,      K = H + sum of a a' / give over violated soft rows,
 *
 * on the variables that no bound fixes, and ends where a row or a bound is met, which then holds too, or where a soft row
 * begins or ends to be violated. At the optimum of a set the row that pushes away from its bound most is released. The cost
 * falls from step to step, so that no set comes back unless steps have no length. docs/solvers.md */
#ifndef WBC_PRIMAL_H
#define WBC_PRIMAL_H

#include "certify.h"

/* Steps at most */
#define PRIMAL_STEPS (6 * NV + 60)
/* Rows whose part beside the others is shorter than this depend on them */
#define BESIDE 1e-9L
/* Rows that the search begins beyond by at most this, in row units, are held: its first steps meet them */
#define NEAR 1e-2
/* Shares of whole numbers of it are apart from each other */
#define GOLDEN 0.6180339887498949
/* A step below this leaves the point where it is; sets of which the optimum is refined at most so often */
#define STILL 1e-15L
#define REPEATS 3

typedef struct {
    const double *H, *g;
    int apart;                  /* whether rows end apart by a rounding */
    wide x[NV], p[NV], G[NV], L[NV * NV], y[NV], Q[NV * NV], R[NV * NV], mu[NV], size[NV];
    int active[M_ALL];          /* 0, or which bound the row is held at: ACTIVE the upper, ACTIVE | LOWER the lower */
    int free[NV], count;        /* variables that no bound fixes */
    int row[NV], rows;          /* general rows that are held, of those that are independent */
    double slip[MC + 1];        /* by how much further out a row ends: see let_slip */
} wbc_primal;

static wide wide_row(const wbc_tick *t, int k, const wide *x) {
    wide sum = 0.0L;
    for (int e = a_start[k]; e < a_end[k]; e++) sum += (wide)t->at[e] * x[a_col[e]];
    return sum;
}

INLINE int is_soft(const wbc_tick *t, int i) { return i >= NV && softness(t, i - NV) > 0.0; }

/* A rounding of row k, of another size for each row */
INLINE double rounding_apart(int k) {
    const double share = k * GOLDEN;
    return (1.0 + share - floor(share)) * TOLERANCE * row_scale[k];
}

/* Where a row ends. Of a relaxation at prices hard rows end apart by a rounding each: many meet at the point of a cone,
 * where steps would have no length. */
static double side(const wbc_tick *t, const wbc_primal *s, int i, int lower) {
    const double end = lower ? t->low[i] : t->high[i];
    if (MC == 0 || i < NV || t->low[i] == t->high[i] || is_soft(t, i)) return end;
    const double gap = (s->apart ? 4.0 * rounding_apart(i - NV) : 0.0) + s->slip[i - NV];
    return lower ? end - gap : end + gap;
}

static double active_bound(const wbc_tick *t, const wbc_primal *s, int i) { return side(t, s, i, s->active[i] & LOWER); }

/* Where the search begins: the command, if it keeps all hard rows or nearly does; 0 if it does not */
static int begin_primal(wbc_tick *t, wbc_primal *s) {
    memset(s->active, 0, sizeof s->active);
    for (int i = 0; i < NV; i++) {
        s->x[i] = clamp(t->report.v[i], t->low[i], t->high[i]);
        if (t->low[i] == t->high[i]) s->active[i] = ACTIVE;
    }
    for (int k = 0; k < MC; k++) {
        const int i = NV + k;
        const wide at = wide_row(t, k, s->x);
        if (t->low[i] <= -WBC_INF && t->high[i] >= WBC_INF) continue;
        if (is_soft(t, i)) {
            if (t->low[i] == t->high[i]) s->active[i] = ACTIVE;
            else s->active[i] = at > t->high[i] ? ACTIVE : at < t->low[i] ? ACTIVE | LOWER : 0;
            continue;
        }
        const wide below = (side(t, s, i, 1) - at) / row_scale[k], above = (at - side(t, s, i, 0)) / row_scale[k];
        if (below > NEAR || above > NEAR) return 0;
        if (t->low[i] == t->high[i] || above > 4.0 * TOLERANCE) s->active[i] = ACTIVE;
        else if (below > 4.0 * TOLERANCE) s->active[i] = ACTIVE | LOWER;
    }
    for (int a = 0; a < t->daqp.n_active; a++) {
        const int i = t->daqp.WS[a], lower = t->sense[i] & LOWER;
        if ((i >= NV && MC == 0) || s->active[i] || is_soft(t, i)) continue;
        const wide at = i < NV ? s->x[i] : wide_row(t, i - NV, s->x), end = side(t, s, i, lower);
        if (i < NV ? at == end : fabsl(at - end) <= TOLERANCE * row_scale[i - NV]) s->active[i] = ACTIVE | lower;
    }
    return 1;
}

/* G at x, and the size of the terms that were added up */
static void wide_gradient(const wbc_tick *t, wbc_primal *s) {
    for (int i = 0; i < NV; i++) {
        s->G[i] = s->g[i];
        s->size[i] = fabsl(s->G[i]);
    }
    for (int i = 0; i < NV; i++)
        for (int j = i; j < NV; j++) {
            const wide h = s->H[i * WIDE + j];
            s->G[i] += h * s->x[j];
            s->size[i] += fabsl(h * s->x[j]);
            if (j == i) continue;
            s->G[j] += h * s->x[i];
            s->size[j] += fabsl(h * s->x[i]);
        }
    for (int k = 0; k < MC; k++) {
        if (!is_soft(t, NV + k) || !s->active[NV + k]) continue;
        const wide force = (wide_row(t, k, s->x) - active_bound(t, s, NV + k)) / softness(t, k);
        for (int e = a_start[k]; e < a_end[k]; e++) {
            s->G[a_col[e]] += force * t->at[e];
            s->size[a_col[e]] += fabsl(force * t->at[e]);
        }
    }
}

/* L L' = K on the free variables; 0 where it is not positive definite */
static int factor_free(const wbc_tick *t, wbc_primal *s) {
    int place[NV];
    s->count = 0;
    for (int i = 0; i < NV; i++) {
        place[i] = -1;
        if (s->active[i]) continue;
        place[i] = s->count;
        s->free[s->count++] = i;
    }
    for (int a = 0; a < s->count; a++)
        for (int b = 0; b <= a; b++) s->L[a * NV + b] = s->H[s->free[b] * WIDE + s->free[a]];
    for (int k = 0; k < MC; k++) {
        if (!is_soft(t, NV + k) || !s->active[NV + k]) continue;
        for (int e = a_start[k]; e < a_end[k]; e++)
            for (int c = a_start[k]; c <= e; c++) {
                const int a = place[a_col[e]], b = place[a_col[c]];
                if (a < 0 || b < 0) continue;
                s->L[(a > b ? a : b) * NV + (a > b ? b : a)] += (wide)t->at[e] * t->at[c] / softness(t, k);
            }
    }
    for (int a = 0; a < s->count; a++)
        for (int b = 0; b <= a; b++) {
            wide sum = s->L[a * NV + b];
            for (int c = 0; c < b; c++) sum -= s->L[a * NV + c] * s->L[b * NV + c];
            if (a == b && !(sum > 0.0L)) return 0;
            s->L[a * NV + b] = a == b ? sqrtl(sum) : sum / s->L[b * NV + b];
        }
    return 1;
}

/* y = L^-1 y */
static void forward(const wbc_primal *s, wide *y) {
    for (int a = 0; a < s->count; a++) {
        for (int b = 0; b < a; b++) y[a] -= s->L[a * NV + b] * y[b];
        y[a] /= s->L[a * NV + a];
    }
}

static wide wide_inner(const wide *x, const wide *y, int count) {
    wide sum = 0.0L;
    for (int i = 0; i < count; i++) sum += x[i] * y[i];
    return sum;
}

/* Rows that are held, seen through L and made orthonormal; those that depend on others are left out */
static void hold_rows(const wbc_tick *t, wbc_primal *s) {
    s->rows = 0;
    for (int k = 0; k < MC && s->rows < s->count; k++) {
        if (!s->active[NV + k] || is_soft(t, NV + k)) continue;
        wide *q = s->Q + s->rows * NV, *r = s->R + s->rows * NV, whole[NV] = {0};
        for (int e = a_start[k]; e < a_end[k]; e++) whole[a_col[e]] = t->at[e];
        for (int a = 0; a < s->count; a++) q[a] = whole[s->free[a]];
        forward(s, q);
        const wide length = sqrtl(wide_inner(q, q, s->count));
        for (int b = 0; b < s->rows; b++) r[b] = 0.0L;
        for (int twice = 0; twice < 2; twice++)
            for (int b = 0; b < s->rows; b++) {
                const wide along = wide_inner(q, s->Q + b * NV, s->count);
                r[b] += along;
                for (int a = 0; a < s->count; a++) q[a] -= along * s->Q[b * NV + a];
            }
        const wide left = sqrtl(wide_inner(q, q, s->count));
        if (!(left > BESIDE * length)) continue;
        for (int a = 0; a < s->count; a++) q[a] /= left;
        r[s->rows] = left;
        s->row[s->rows++] = k;
    }
}

/* Rows at the optimum of a set that depend on those that are held leave the set, and end where they are and a rounding beyond,
 * unless they are further off than a row that never gives way may be. Left out but in the set, one comes back as soon as a row
 * that it depends on is released, and pushes that row over its end: the two would take turns until no step is left. */
static void let_slip(const wbc_tick *t, wbc_primal *s) {
    for (int k = 0, b = 0; k < MC; k++) {
        const int i = NV + k;
        if (b < s->rows && s->row[b] == k) {
            b++;
            continue;
        }
        if (!s->active[i] || t->low[i] == t->high[i] || is_soft(t, i)) continue;
        const wide at = wide_row(t, k, s->x), end = active_bound(t, s, i);
        const double off = (double)(s->active[i] & LOWER ? end - at : at - end);
        if (off > FIRMLY * row_scale[k]) continue;
        s->slip[k] += larger(off + rounding_apart(k), 0.0);
        s->active[i] = 0;
    }
}

/* p and mu of the set at hand; 0 where there is none */
static int primal_step(const wbc_tick *t, wbc_primal *s) {
    wide first[NV];
    if (!factor_free(t, s)) return 0;
    wide_gradient(t, s);
    for (int a = 0; a < s->count; a++) s->y[a] = -s->G[s->free[a]];
    forward(s, s->y);
    hold_rows(t, s);
    memcpy(first, s->y, sizeof first);
    for (int b = 0; b < s->rows; b++) {
        wide gap = active_bound(t, s, NV + s->row[b]) - wide_row(t, s->row[b], s->x);
        for (int c = 0; c < b; c++) gap -= s->R[b * NV + c] * s->mu[c];
        s->mu[b] = gap / s->R[b * NV + b];
    }
    for (int b = 0; b < s->rows; b++) {
        const wide change = s->mu[b] - wide_inner(s->Q + b * NV, s->y, s->count);
        for (int a = 0; a < s->count; a++) s->y[a] += change * s->Q[b * NV + a];
    }
    for (int b = s->rows - 1; b >= 0; b--) {
        wide sum = 0.0L;
        for (int a = 0; a < s->count; a++) sum += s->Q[b * NV + a] * (first[a] - s->y[a]);
        for (int c = b + 1; c < s->rows; c++) sum -= s->R[c * NV + b] * s->mu[c];
        s->mu[b] = sum / s->R[b * NV + b];
    }
    for (int i = 0; i < NV; i++) s->p[i] = 0.0L;
    for (int a = s->count - 1; a >= 0; a--) {
        wide sum = s->y[a];
        for (int b = a + 1; b < s->count; b++) sum -= s->L[b * NV + a] * s->p[s->free[b]];
        s->p[s->free[a]] = sum / s->L[a * NV + a];
    }
    return 1;
}

/* Along p as far as the set stays what it is; the row that ends it, -1 for none */
static int walk(const wbc_tick *t, wbc_primal *s) {
    wide share = 1.0L;
    int ends = -1, lower = 0;
    for (int i = 0; i < M_ALL; i++) {
        const wide change = i < NV ? s->p[i] : wide_row(t, i - NV, s->p);
        const int soft = is_soft(t, i);
        if (change == 0.0L || (s->active[i] && !soft) || (soft && t->low[i] == t->high[i])) continue;
        const wide at = i < NV ? s->x[i] : wide_row(t, i - NV, s->x);
        wide remaining;
        int down = change < 0.0L;
        if (soft && s->active[i]) {
            /* It ends to be violated on its way back */
            if (down == ((s->active[i] & LOWER) != 0)) continue;
            remaining = active_bound(t, s, i) - at;
        } else {
            const double end = side(t, s, i, down);
            if (fabs(end) >= WBC_INF) continue;
            remaining = end - at;
        }
        const wide part = remaining / change > 0.0L ? remaining / change : 0.0L;
        if (part < share) {
            share = part;
            ends = i;
            lower = down;
        }
    }
    for (int i = 0; i < NV; i++) s->x[i] += share * s->p[i];
    if (ends < 0) return -1;
    if (s->active[ends]) s->active[ends] = 0;
    else s->active[ends] = ACTIVE | (lower ? LOWER : 0);
    if (ends < NV) s->x[ends] = active_bound(t, s, ends);
    return ends;
}

/* Release what pushes away from its bound most; multipliers to the report. 0 where nothing does. */
static int release(wbc_tick *t, wbc_primal *s) {
    double *lambda = t->report.lambda, worst = 0.0, largest = 0.0;
    wide force[NV];
    int which = -1;
    for (int i = 0; i < M_ALL; i++) lambda[i] = 0.0;
    wide_gradient(t, s);
    memcpy(force, s->G, sizeof force);
    for (int b = 0; b < s->rows; b++) {
        const int k = s->row[b];
        lambda[NV + k] = (double)s->mu[b];
        for (int e = a_start[k]; e < a_end[k]; e++) {
            force[a_col[e]] += s->mu[b] * t->at[e];
            s->size[a_col[e]] += fabsl(s->mu[b] * t->at[e]);
        }
    }
    for (int i = 0; i < NV; i++) {
        if (s->active[i]) lambda[i] = (double)-force[i];
        largest = larger(largest, (double)s->size[i] * dof_scale[i]);
        s->G[i] = s->active[i] ? 0.0L : force[i];
    }
    for (int i = 0; i < M_ALL; i++) {
        if (!s->active[i] || t->low[i] == t->high[i]) continue;
        const double push = lambda[i] * (s->active[i] & LOWER ? 1.0 : -1.0) * (i < NV ? dof_scale[i] : row_scale[i - NV]);
        if (push > worst) {
            worst = push;
            which = i;
        }
    }
    for (int k = 0; k < MC; k++)
        if (is_soft(t, NV + k) && s->active[NV + k])
            lambda[NV + k] = (double)((wide_row(t, k, s->x) - active_bound(t, s, NV + k)) / softness(t, k));
    if (which < 0 || worst <= 64.0 * NV * (double)WIDE_EPS * largest) return 0;
    s->active[which] = 0;
    return 1;
}

/* |v - v*| <= |L^-1| |L^-1 r|, r the residual with the rounding of its terms */
static double primal_bound(wbc_primal *s) {
    wide square = 0.0L, seen = 0.0L;
    for (int c = 0; c < s->count; c++) {
        wide unit[NV] = {0};
        unit[c] = 1.0L;
        forward(s, unit);
        square += wide_inner(unit, unit, s->count);
        for (int a = c; a < s->count; a++) s->Q[a * NV + c] = fabsl(unit[a]);
    }
    for (int a = 0; a < s->count; a++) {
        wide sum = 0.0L;
        for (int c = 0; c <= a; c++)
            sum += s->Q[a * NV + c] * (fabsl(s->G[s->free[c]]) + (NV + MC + 4) * WIDE_EPS * s->size[s->free[c]]);
        seen += sum * sum;
    }
    return (double)sqrtl(square * seen);
}

/* Replace the command by the optimum over the bounds as they stand, with its certificate; 0, and the report is as it was
 * but for its multipliers, where there is none */
static int primal(wbc_tick *t) {
    wbc_primal s;
    int same = 0, found = 0;
    wbc_report *out = &t->report;
    memset(&s, 0, sizeof s);
#if SOFT_ROWS > 0
    s.H = t->own_H;
    s.g = t->own_g;
#else
    s.H = t->H;
    s.g = t->g;
#endif
    for (int k = 0; ELASTIC && k < MC; k++) s.apart |= t->elastic[k] > 0.0;
    if (!begin_primal(t, &s)) return 0;
    for (int step = 0; step < PRIMAL_STEPS && !found; step++) {
        if (!primal_step(t, &s)) return 0;
        wide longest = 0.0L, most = 1.0L;
        for (int i = 0; i < NV; i++) {
            longest = fmaxl(longest, fabsl(s.p[i]));
            most = fmaxl(most, fabsl(s.x[i]));
        }
        if (!(longest < (wide)DBL_MAX)) return 0;
        if (walk(t, &s) >= 0) {
            same = 0;
            continue;
        }
        let_slip(t, &s);
        if (longest > STILL * most && ++same < REPEATS) continue;
        same = 0;
        found = !release(t, &s);
    }
    if (!found) return 0;
    const double bound = primal_bound(&s);
    double rounding = 0.0;
    t->daqp.n_active = 0;
    for (int i = 0; i < NV; i++) {
        t->x[i] = out->v[i] = clamp((double)s.x[i], t->low[i], t->high[i]);
        if (i < DOFS) rounding = larger(rounding, (double)fabsl(s.x[i] - out->v[i]));
    }
    out->stationarity = out->complementarity = out->violation = t->firm_missed = 0.0;
    for (int i = 0; i < NV; i++) out->stationarity = larger(out->stationarity, fabs((double)s.G[i]));
    for (int k = 0; k < MC; k++) {
        if (!is_soft(t, NV + k)) count_violation(t, k, row_at(t, k, out->v));
    }
    out->error_bound = bound + rounding;
    for (int i = 0; i < M_ALL; i++) t->keep[i] = is_soft(t, i) ? 0 : s.active[i];
#if SOFT_ROWS > 0
    for (int k = 0; k < MC; k++) t->held[k] = SOFTENED(t, k) ? s.active[NV + k] : 0;
    memset(t->melted, 0, sizeof t->melted);
#endif
    t->warm = 1;
    return 1;
}

#endif
