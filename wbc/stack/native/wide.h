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

/* What rounding takes from x y, exactly: with one rounding, where the processor can (the loop becomes one instruction), else
 * from halves of both that have exact products (Dekker 1971). The bits are the same. */
#if defined(__FMA__) || defined(__aarch64__)
#define LOST_OF_PRODUCT(x, y, xy, lost) \
    do { \
        for (int n_ = 0; n_ < 4; n_++) (lost)[n_] = __builtin_fma((x)[n_], (y)[n_], -(xy)[n_]); \
    } while (0)
#else
#define SPLIT EACH(sizeof(double) == 4 ? 0x1p12 + 1.0 : 0x1p27 + 1.0)
#define LOST_OF_PRODUCT(x, y, xy, lost) \
    do { \
        const four x_ = SPLIT * (x), y_ = SPLIT * (y), high_ = x_ - (x_ - (x)), top_ = y_ - (y_ - (y)); \
        const four small_ = (x) - high_, rest_ = (y) - top_; \
        (lost) = small_ * rest_ - ((((xy) - high_ * top_) - small_ * top_) - high_ * rest_); \
    } while (0)
#endif
/* sum += x y, and what rounding takes from both to `lost` */
#define ADD_PRODUCT(x, y, sum, lost, bulk) \
    do { \
        const four xy_ = (x) * (y), new_ = (sum) + xy_, part_ = new_ - (sum); \
        four left_; \
        LOST_OF_PRODUCT(x, y, xy_, left_); \
        (lost) += (((sum) - (new_ - part_)) + (xy_ - part_)) + left_; \
        (bulk) += SIZE_OF_FOUR(xy_); \
        (sum) = new_; \
    } while (0)

/* H v + g as a sum, what its rounding lost, and the size of its terms: as if with twice the digits, but for
 * ((NV + 8) EPS)^2 of that size (Ogita, Rump and Oishi 2005, Dot2) */
static void wide_product(const wbc_tick *t, wide *out, double *bulk) {
    double v[WIDE] = {0}, sum[WIDE], lost[WIDE] = {0};
    memcpy(v, t->report.v, sizeof t->report.v);
    for (int i = 0; i < WIDE; i++) {
        sum[i] = i < NV ? t->g[i] : 0.0;
        bulk[i] = fabs(sum[i]);
    }
    for (int i = 0; i < NV; i++) {
        const int from = i & ~3;
        const four here = EACH(v[i]);
        four across = {0}, across_lost = {0}, across_bulk = {0};
        for (int at = from; at < WIDE; at += 4) {
            const four there = GIVEN_FOUR(v + at);
            four h = GIVEN_FOUR(t->H + i * WIDE + at), s = GIVEN_FOUR(sum + at), l = GIVEN_FOUR(lost + at), b = GIVEN_FOUR(bulk + at);
            ADD_PRODUCT(h, there, across, across_lost, across_bulk);
            if (at == from) h[i - from] = 0.0;
            ADD_PRODUCT(h, here, s, l, b);
            FOUR(sum + at) = s, FOUR(lost + at) = l, FOUR(bulk + at) = b;
        }
        out[i] = ((wide)across[0] + across[1]) + ((wide)across[2] + across[3]) + SUM_OF_FOUR(across_lost);
        bulk[i] += SUM_OF_FOUR(across_bulk);
    }
    for (int i = 0; i < NV; i++) out[i] += (wide)sum[i] + lost[i];
}

/* residual = H v + g + A' lambda of the general rows, and a bound on its rounding */
static void wide_forces(const wbc_tick *t, const wide *lambda, wide *residual, double *rounding) {
    const double doubled = (NV + 8) * EPS;
    wide_product(t, residual, rounding);
    for (int a = 0; a < t->daqp.n_active; a++) {
        const int k = t->daqp.WS[a] - NV;
        for (int e = k < 0 ? 0 : a_start[k]; k >= 0 && e < a_end[k]; e++) {
            const wide part = lambda[k] * t->at[e];
            residual[a_col[e]] += part;
            rounding[a_col[e]] += fabs((double)part);
        }
    }
    for (int i = 0; i < NV; i++) rounding[i] *= (t->daqp.n_active + 8) * WIDE_EPS + doubled * doubled;
}

/* The multipliers of general rows that fit the command best, as far as their signs allow */
static void fit_multipliers(wbc_tick *t, wide *lambda) {
    DAQPWorkspace *work = &t->daqp;
    wide residual[NV];
    double rounding[WIDE], y[WIDE], mu[ACTIVE_MAX];
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

/* Row i of R^-1 without its part along the first `count` active rows, in `own` where there is such a part */
static const double *row_beside(const wbc_tick *t, int i, int count, double *own) {
    const double *row = t->inverse + i * WIDE;
    double mu[ACTIVE_MAX];
    if (count == 0) return row;
    memcpy(own, row, WIDE * sizeof(double));
    for (int twice = 0; twice < 2; twice++) {
        for (int a = 0; a < count; a++) mu[a] = seen_through(t, t->daqp.WS[a], own);
        solve_gram(t, count, mu);
        for (int a = 0; a < count; a++) push_back(t, t->daqp.WS[a], -mu[a], own);
    }
    return own;
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
    double rounding[WIDE], own[WIDE], step[WIDE] = {0}, noise[WIDE] = {0}, whole[WIDE] = {0}, reach = 0.0, longest = 0.0;
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
        /* Without equalities the row ends at the diagonal, and nothing is turned */
        const double *row = row_beside(t, i, equal, own);
        const int from = equal > 0 ? 0 : i & ~3;
        const four push = EACH(force), blur = EACH(rounding[i]);
        for (int at = from; at < WIDE; at += 4) {
            const four here = GIVEN_FOUR(row + at);
            FOUR(step + at) = MADD(push, here, GIVEN_FOUR(step + at));
            FOUR(noise + at) = MADD(blur, SIZE_OF_FOUR(here), GIVEN_FOUR(noise + at));
        }
        for (int j = 0; equal > 0 && j < NV; j++) whole[j] += (fabs(force) + rounding[i]) * fabs(t->inverse[i * WIDE + j]);
        if (i >= DOFS) continue;
        reach = larger(sqrt(dot(row, row, from)), reach);
        longest = larger(1.0 / t->scaling[i], longest);
    }
    const double turned = tilt(t, equal), rest = active_residual(t);
    const double length = sqrt(dot(step, step, 0)) + sqrt(dot(noise, noise, 0)) + turned * sqrt(dot(whole, whole, 0)) + rest;
    return (reach + turned * longest) * length + longest * rest;
}

#endif
