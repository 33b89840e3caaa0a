/* The error bound in wide arithmetic, for answers whose bound double precision leaves loose: docs/solvers.md. */
#ifndef WBC_WIDE_H
#define WBC_WIDE_H

#include "solve.h"

/* Fits of the multipliers to the point */
#define FITS 2
/* Roundings of an entry in a projection */
#define TILT 12.0

/* M_i y, where M are the rows as the solver sees them: through R, and of length one */
static double seen_through(const wbc_tick *t, int i, const double *y) {
    if (MC == 0 || i < NV) return t->scaling[i] * dot(t->inverse + i * WIDE, y, i);
    double sum = 0.0;
    for (int j = 0; j < NV; j++) sum += t->M[(i - NV) * NV + j] * y[j];
    return sum;
}

/* y += f M_i' */
static void push_back(const wbc_tick *t, int i, double f, double *y) {
    if (i < NV) axpy(y, t->inverse + i * WIDE, f * t->scaling[i], i);
    for (int j = 0; MC > 0 && i >= NV && j < NV; j++) y[j] += f * t->M[(i - NV) * NV + j];
}

static void solve_gram(const wbc_tick *t, int count, double *r) { solve_factors(t->L, t->D, count, r); }

/* By how much the command misses the bound of active row `a`, moved by what a soft row gives way, as the solver scales it */
static double side_gap(const wbc_tick *t, int a) {
    const int i = t->daqp.WS[a];
    wide gap = t->sense[i] & LOWER ? -(wide)t->low[i] : -(wide)t->high[i];
    if (i < NV) gap += t->report.v[i];
    for (int e = i < NV ? 0 : a_start[i - NV]; i >= NV && e < a_end[i - NV]; e++)
        gap += (wide)t->at[e] * t->report.v[a_col[e]];
    if (i >= NV && SOFTENED(t, i - NV)) gap -= (wide)looseness(t, i - NV) * t->daqp.lam_star[a];
    return (double)gap * t->scaling[i];
}

/* residual = H v + g + A' lambda of the general rows, and a bound on its rounding */
static void wide_forces(const wbc_tick *t, const wide *lambda, wide *residual, double *rounding) {
    const double *v = t->report.v;
    for (int i = 0; i < NV; i++) {
        double row[WIDE], bulk = fabs(t->g[i]);
        wide part[4] = {t->g[i], 0.0L, 0.0L, 0.0L};
        for (int j = 0; j < i; j++) row[j] = t->H[j * WIDE + i];
        for (int j = i; j < WIDE; j++) row[j] = t->H[i * WIDE + j];
        for (int j = 0; j < NV; j++) part[j & 3] += (wide)row[j] * v[j];
        for (int j = 0; j < NV; j++) bulk += fabs(row[j] * v[j]);
        residual[i] = (part[0] + part[2]) + (part[1] + part[3]);
        rounding[i] = bulk;
    }
    for (int a = 0; a < t->daqp.n_active; a++) {
        const int k = t->daqp.WS[a] - NV;
        for (int e = k < 0 ? 0 : a_start[k]; k >= 0 && e < a_end[k]; e++) {
            const wide part = lambda[k] * t->at[e];
            residual[a_col[e]] += part;
            rounding[a_col[e]] += fabs((double)part);
        }
    }
    for (int i = 0; i < NV; i++) rounding[i] *= (NV + t->daqp.n_active + 4) * WIDE_EPS;
}

/* The multipliers of general rows that fit the command best, as far as their signs allow */
static void fit_multipliers(wbc_tick *t, wide *lambda) {
    DAQPWorkspace *work = &t->daqp;
    wide residual[NV];
    double rounding[NV], y[WIDE], mu[ACTIVE_MAX];
    int general = 0;
    for (int a = 0; a < work->n_active; a++) general |= work->WS[a] >= NV;
    if (!general) return;
    for (int fit = 0; fit < FITS && work->n_active > 0; fit++) {
        wide_forces(t, lambda, residual, rounding);
        for (int i = 0; i < WIDE; i++) y[i] = 0.0;
        /* Active bounds take what is left in their component */
        for (int a = 0; a < work->n_active; a++)
            if (work->WS[a] < NV) residual[work->WS[a]] = 0.0;
        for (int i = 0; i < NV; i++) axpy(y, t->inverse + i * WIDE, (double)residual[i], i);
        for (int a = 0; a < work->n_active; a++) mu[a] = seen_through(t, work->WS[a], y);
        solve_gram(t, work->n_active, mu);
        for (int a = 0; a < work->n_active; a++) {
            const int i = work->WS[a], k = i - NV;
            if (i < NV || MC == 0) continue;
            const wide fitted = lambda[k] - (wide)(mu[a] * t->scaling[i]);
            if (!stays(t, i) && !(t->sense[i] & LOWER ? fitted < 0.0 : fitted > 0.0)) continue;
            work->lam_star[a] += (double)(fitted - lambda[k]);
            lambda[k] = fitted;
        }
    }
}

/* Row i of R^-1 without its part along the first `count` active rows */
static void row_beside(const wbc_tick *t, int i, int count, double *row) {
    double mu[ACTIVE_MAX];
    memcpy(row, t->inverse + i * WIDE, WIDE * sizeof(double));
    for (int twice = 0; count > 0 && twice < 2; twice++) {
        for (int a = 0; a < count; a++) mu[a] = seen_through(t, t->daqp.WS[a], row);
        solve_gram(t, count, mu);
        for (int a = 0; a < count; a++) push_back(t, t->daqp.WS[a], -mu[a], row);
    }
}

/* By how much rounding may turn the plane beside the first `count` active rows */
static double tilt(const wbc_tick *t, int count) {
    double trace = 0.0, unit[ACTIVE_MAX];
    for (int a = 0; a < count; a++) {
        for (int b = 0; b < count; b++) unit[b] = a == b;
        solve_gram(t, count, unit);
        trace += unit[a];
    }
    return TILT * NV * EPS * sqrt(larger(trace, 0.0));
}

/* Length of the correction, in the metric of H, that the residual of the active rows asks for */
static double active_residual(const wbc_tick *t) {
    double total = 0.0, z[ACTIVE_MAX];
    for (int a = 0, at = 0; a < t->daqp.n_active; a++) {
        double r = side_gap(t, a);
        for (int b = 0; b < a; b++) r -= t->L[at++] * z[b];
        at++;
        z[a] = r;
        total += r * r / t->D[a];
    }
    return sqrt(total);
}

/* The bound; leaves the residual of the stationarity in `scratch` */
static double wide_bound(wbc_tick *t) {
    const DAQPWorkspace *work = &t->daqp;
    wide lambda[MC + 1], residual[NV];
    double rounding[NV], row[WIDE], step[WIDE] = {0}, noise[WIDE] = {0}, whole[WIDE] = {0}, reach = 0.0, longest = 0.0;
    int equal = 0;
    for (int k = 0; k < MC; k++) lambda[k] = t->report.lambda[NV + k];
    fit_multipliers(t, lambda);
    wide_forces(t, lambda, residual, rounding);
    for (int a = 0; a < work->n_active; a++) {
        const int i = work->WS[a];
        if (i >= NV) continue;
        /* Any multiplier of the right sign certifies */
        const double own = -(double)residual[i];
        if (t->low[i] != t->high[i] && (t->sense[i] & LOWER ? -own : own) <= rounding[i]) continue;
        residual[i] = rounding[i] = 0.0;
    }
    while (equal < work->n_active && is_equality(t, work->WS[equal])) equal++;
    for (int i = 0; i < NV; i++) {
        const double force = t->scratch[i] = (double)residual[i];
        if (i >= DOFS && force == 0.0 && rounding[i] == 0.0) continue;
        row_beside(t, i, equal, row);
        axpy(step, row, force, 0);
        for (int j = 0; j < NV; j++) {
            noise[j] += rounding[i] * fabs(row[j]);
            whole[j] += (fabs(force) + rounding[i]) * fabs(t->inverse[i * WIDE + j]);
        }
        if (i >= DOFS) continue;
        reach = larger(sqrt(dot(row, row, 0)), reach);
        longest = larger(1.0 / t->scaling[i], longest);
    }
    const double turned = tilt(t, equal), rest = active_residual(t);
    const double length = sqrt(dot(step, step, 0)) + sqrt(dot(noise, noise, 0)) + turned * sqrt(dot(whole, whole, 0)) + rest;
    return (reach + turned * longest) * length + longest * rest;
}

#endif
