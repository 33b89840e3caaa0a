/* The nearest configuration that keeps rows, by Newton steps on those that do not hold. */
#pragma once

#include "plan.h"

/* Steps at most; a step moves no coordinate farther [rad, m] */
#define NEWTON_STEPS 40
#define NEWTON_STRIDE 0.5
/* What a margin that does not hold is brought to */
#define NEWTON_ROOM 1e-3
/* Added to the diagonal, in parts of its mean: rows that depend on others share what is left */
#define NEWTON_DAMPING 1e-10

static void evaluate(plan_t *p, kept_rows_t *rows, const double *x, int slopes) {
    const double *in[2] = {x, rows->p};
    double *out[2] = {rows->value, slopes ? rows->slope : 0};
    rows->function(in, out, rows->iw, rows->w, 0);
}

/* How far equalities of the path are from 0 at x at most; margins below 0 count too */
double wbc_plan_broken(plan_t *p, const double *x) {
    kept_rows_t *rows = &p->path;
    double most = 0.0;
    evaluate(p, rows, x, 0);
    for (int k = 0; k < rows->equalities + rows->margins; k++) {
        const double off = k < rows->equalities ? fabs(rows->value[k]) : -rows->value[k];
        if (!(off <= most)) most = off;
    }
    return most;
}

static int keeps(plan_t *p, kept_rows_t *rows, const double *x) {
    evaluate(p, rows, x, 0);
    for (int k = 0; k < rows->equalities + rows->margins; k++)
        if (!(k < rows->equalities ? fabs(rows->value[k]) <= p->tolerance : rows->value[k] >= 0.0)) return 0;
    return 1;
}

/* dx, the least in the metric, with A dx = -r for m rows; `movable` says which coordinates may move. A: m x n, G: (m + 1) x m, of which
 * the last row y becomes what G G' x = -r has half way */
static int least_step(const plan_t *p, int m, const double *A, const double *r, const char *movable, double *G, double *dx) {
    double trace = 0.0, *y = G + m * m;
    for (int i = 0; i < m; i++) {
        y[i] = -r[i];
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int k = 0; k < p->n; k++)
                if (movable[k]) sum += A[i * p->n + k] * A[j * p->n + k] / p->weight[k];
            G[i * m + j] = sum;
            if (i == j) trace += sum;
        }
    }
    if (!(trace > 0.0)) return 0;
    for (int i = 0; i < m; i++) G[i * m + i] += NEWTON_DAMPING * trace / m;
    for (int i = 0; i <= m; i++)
        for (int j = 0; j <= i && j < m; j++) {
            double sum = G[i * m + j];
            for (int k = 0; k < j; k++) sum -= G[i * m + k] * G[j * m + k];
            if (i == j && !(sum > 0.0)) return 0;
            G[i * m + j] = i == j ? sqrt(sum) : sum / G[j * m + j];
        }
    for (int i = m - 1; i >= 0; i--) {
        for (int k = i + 1; k < m; k++) y[i] -= G[k * m + i] * y[k];
        y[i] /= G[i * m + i];
    }
    for (int k = 0; k < p->n; k++) {
        dx[k] = 0.0;
        if (!movable[k]) continue;
        for (int i = 0; i < m; i++) dx[k] += A[i * p->n + k] * y[i];
        dx[k] /= p->weight[k];
    }
    return 1;
}

/* x is moved until the rows hold, within limits; 0 where that fails */
static int project(plan_t *p, kept_rows_t *rows, double *x) {
    const int n = p->n, all = rows->equalities + rows->margins;
    double *A = p->work, *G = A + all * n, *r = G + (all + 1) * all, *dx = r + all;
    char *movable = (char *)(dx + n);
    for (int step = 0; step < NEWTON_STEPS; step++) {
        int m = 0, holds = 1;
        evaluate(p, rows, x, 1);
        for (int i = 0; i < all; i++) {
            const double value = rows->value[i];
            if (!isfinite(value)) return 0;
            if (i >= rows->equalities && value >= (step ? 0.5 * NEWTON_ROOM : 0.0)) continue;
            holds &= i >= rows->equalities ? value >= 0.0 : fabs(value) <= p->tolerance;
            r[m] = i >= rows->equalities ? value - NEWTON_ROOM : value;
            for (int k = 0; k < n; k++) A[m * n + k] = rows->slope[k * all + i];
            m++;
        }
        if (holds) return 1;
        /* On its way a base that rolls goes nowhere else, and its wheels follow it */
        for (int k = 0; k < n; k++) movable[k] = p->weight[k] > 0.0 && !(p->rolls && rows == &p->path && k < 3);
        for (int again = 0; again < n; again++) {
            int pushed = 0;
            if (!least_step(p, m, A, r, movable, G, dx)) return 0;
            for (int k = 0; k < n; k++)
                if (movable[k] && ((x[k] <= p->low[k] && dx[k] < 0.0) || (x[k] >= p->high[k] && dx[k] > 0.0))) movable[k] = 0, pushed = 1;
            if (!pushed) break;
        }
        double most = 0.0;
        for (int k = 0; k < n; k++) most = fmax(most, fabs(dx[k]));
        if (!isfinite(most)) return 0;
        const double share = most > NEWTON_STRIDE ? NEWTON_STRIDE / most : 1.0;
        for (int k = 0; k < n; k++) x[k] = fmin(fmax(x[k] + share * dx[k], p->low[k]), p->high[k]);
    }
    return 0;
}
