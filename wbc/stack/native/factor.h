/* The Cholesky factor of the Hessian, its inverse, and the rows seen through it. */
#ifndef WBC_FACTOR_H
#define WBC_FACTOR_H

#include "settings.h"

/* Rows of matrices are padded to WIDE, a multiple of 8, and loops run over whole groups of 8, so that they
 * become vector code with a fixed order of summation. Entries left of the diagonal in its group are 0. */
INLINE void axpy(double *out, const double *in, double f, int from) {
    for (int b = from / 8; b < WIDE / 8; b++)
        for (int k = 0; k < 8; k++) out[8 * b + k] += f * in[8 * b + k];
}

INLINE double dot(const double *x, const double *y, int from) {
    double part[8] = {0};
    for (int b = from / 8; b < WIDE / 8; b++)
        for (int k = 0; k < 8; k++) part[k] += x[8 * b + k] * y[8 * b + k];
    return ((part[0] + part[4]) + (part[1] + part[5])) + ((part[2] + part[6]) + (part[3] + part[7]));
}

/* Equality rows a'v = b, fixed variables among them, enter the Hessian as well, H + rho a a' / |a|^2 and
 * g - rho b a / |a|^2 with v counted in its own units: a constant where they hold, so the optimum is the same, but seen through R they are then as
 * independent as they are in v. */
INLINE double met_side(const wbc_tick *t, int k) {
#if SOFT_ROWS > 0
    if (t->held[k] & LOWER) return t->low[NV + k];
    if (t->held[k]) return t->high[NV + k];
#endif
    return t->low[NV + k];
}

/* Rows that the factor has: equalities, and soft rows that are held */
INLINE int strengthens(const wbc_tick *t, int k) {
#if SOFT_ROWS > 0
    if (t->settled && t->give[k] > 0.0) return t->held[k] && !t->melted[k];
#endif
#if KEPT && LEVELS > 0
    /* A level minimises what keeps its task's direction: only the search for curvature has it */
    if (t->firm && kept_of[k] >= 0) return t->free_low[k] == t->free_high[k];
#endif
    return t->low[NV + k] == t->high[NV + k];
}

static void strengthen(wbc_tick *t) {
    t->stiffness = 0.0;
    for (int i = 0; i < NV; i++) t->stiffness = larger(t->stiffness, t->H[i * WIDE + i] * dof_scale[i] * dof_scale[i]);
    for (int i = 0; i < NV; i++)
        if (t->low[i] == t->high[i]) t->R[i * WIDE + i] += t->stiffness / (dof_scale[i] * dof_scale[i]);
    for (int k = 0; k < MC; k++) {
        t->strength[k] = 0.0;
        if (!strengthens(t, k)) continue;
        double square = 0.0;
        for (int e = a_start[k]; e < a_end[k]; e++) {
            const double a = t->at[e] * dof_scale[a_col[e]];
            square += a * a;
        }
        if (square <= DEAD) continue;
        t->strength[k] = t->stiffness / square * (t->firm && kept_of[k] >= 0 ? FIRM : 1.0);
#if SOFT_ROWS > 0
        if (t->settled && t->give[k] > 0.0) {
            t->strength[k] = smaller(larger(MODEST * t->strength[k], SHARE / t->give[k]), 0.5 / t->give[k]);
            t->loose[k] = 1.0 / (1.0 / t->give[k] - t->strength[k]);
        }
#endif
        for (int e = a_start[k]; e < a_end[k]; e++) {
            const double f = t->strength[k] * t->at[e];
            for (int c = e; c < a_end[k]; c++) t->R[a_col[e] * WIDE + a_col[c]] += f * t->at[c];
        }
    }
}

/* y = -g and what the equality rows add to it */
static void right_side(wbc_tick *t) {
    for (int i = 0; i < WIDE; i++) t->y[i] = -t->g[i];
    for (int i = 0; i < NV; i++)
        if (t->low[i] == t->high[i]) t->y[i] += t->stiffness / (dof_scale[i] * dof_scale[i]) * t->low[i];
    for (int k = 0; k < MC; k++)
        for (int e = a_start[k]; t->strength[k] != 0.0 && e < a_end[k]; e++)
            t->y[a_col[e]] += t->strength[k] * t->at[e] * met_side(t, k);
}

/* A pivot of the modified factorisation of Gill and Murray: no less than `least`, and such that no entry of the factor
 * is larger than those of a definite matrix may be; `row`: the row from its pivot on */
INLINE double amended(const double *row, int k, int from, double least, double bound) {
    double part[8] = {0}, aside = 0.0;
    for (int j = from; j < WIDE; j++) part[j & 7] = larger(part[j & 7], j > k ? fabs(row[j]) : 0.0);
    for (int j = 0; j < 8; j++) aside = larger(aside, part[j]);
    return larger(larger(fabs(row[k]), aside * aside / bound), least);
}

/* Eight rows of R from the rows above them. `from` is a constant after unrolling: the row stays in registers. `more`:
 * what is added to the diagonal by the modified factorisation, or NULL for the plain one. */
INLINE int factor_group(wbc_tick *t, const int from, double least, double bound, double *more) {
    const int to = from + 8 < NV ? from + 8 : NV;
    int ok = 1;
    for (int k = from; k < to; k++) {
        double row[WIDE];
        for (int j = from; j < WIDE; j++) row[j] = t->R[k * WIDE + j];
        for (int i = 0; i < k; i++) {
            const double *above = t->R + i * WIDE, f = above[k];
            for (int j = from; j < WIDE; j++) row[j] -= f * above[j];
        }
        double pivot = row[k];
        if (more != NULL) {
            pivot = amended(row, k, from, least, bound);
            more[k] = pivot - row[k];
            row[k] = pivot;
        }
        ok &= pivot > 0.0;
        const double scale = t->inverse_diagonal[k] = 1.0 / sqrt(pivot);
        for (int j = from; j < WIDE; j++) t->R[k * WIDE + j] = row[j] * scale;
        for (int j = from; j < k; j++) t->R[k * WIDE + j] = 0.0;
    }
    return ok;
}

/* Eight rows of R^-1 from the rows below them */
INLINE void invert_group(wbc_tick *t, const int from) {
    const int to = from + 8 < NV ? from + 8 : NV;
    for (int i = to - 1; i >= from; i--) {
        const double *source = t->R + i * WIDE;
        const double first = t->inverse_diagonal[i];
        double row[WIDE] = {0};
        for (int k = i + 1; k < to; k++) {
            const double *below = t->inverse + k * WIDE;
            for (int j = from; j < WIDE; j++) row[j] += source[k] * below[j];
        }
#pragma GCC unroll 64
        for (int later = from + 8; later < NV; later += 8)
            for (int k = later; k < (later + 8 < NV ? later + 8 : NV); k++) {
                const double *below = t->inverse + k * WIDE;
                for (int j = later; j < WIDE; j++) row[j] += source[k] * below[j];
            }
        double *out = t->inverse + i * WIDE;
        for (int j = 0; j < from; j++) out[j] = 0.0;
        for (int j = from; j < WIDE; j++) out[j] = -first * row[j];
        out[i] = first;
    }
}

/* R = H with the equality rows in it, not yet factored */
static void load(wbc_tick *t) {
    memcpy(t->R, t->H, sizeof t->R);
    strengthen(t);
}

/* The matrix in R into its Cholesky factor, with the inverse of its diagonal; 0 where it is not positive definite */
static int decompose(wbc_tick *t) {
    int ok = 1;
#pragma GCC unroll 64
    for (int group = 0; group < WIDE / 8; group++) ok &= factor_group(t, 8 * group, 0.0, 0.0, NULL);
    return ok;
}

/* H += a diagonal that makes it positive definite, with pivots of v / dof_scale of `least` or more, where it is not (Gill and
 * Murray); where it is, its plain factor. H = R'R afterwards, equality rows left out. */
static void decompose_amended(wbc_tick *t, double least) {
    double more[NV], scale[WIDE] = {0}, unit[WIDE] = {0}, part[8] = {0}, diagonal = 0.0, other = 0.0;
    for (int i = 0; i < NV; i++) {
        scale[i] = dof_scale[i];
        unit[i] = 1.0 / dof_scale[i];
    }
    for (int i = 0; i < NV; i++) {
        double *row = t->R + i * WIDE;
        const double *from = t->H + i * WIDE, f = scale[i];
        for (int j = 0; j < WIDE; j++) row[j] = from[j] * f * scale[j];
        diagonal = larger(diagonal, fabs(row[i]));
        for (int b = i / 8; b < WIDE / 8; b++)
            for (int k = 0; k < 8; k++) part[k] = larger(part[k], 8 * b + k > i ? fabs(row[8 * b + k]) : 0.0);
    }
    for (int k = 0; k < 8; k++) other = larger(other, part[k]);
    const double bound = larger(diagonal, other / sqrt(larger((double)NV * NV - 1.0, 1.0)));
#pragma GCC unroll 64
    for (int group = 0; group < WIDE / 8; group++) factor_group(t, 8 * group, least, bound, more);
    for (int i = 0; i < NV; i++) {
        double *row = t->R + i * WIDE;
        for (int b = i / 8; b < WIDE / 8; b++)
            for (int j = 8 * b; j < 8 * b + 8; j++) row[j] *= unit[j];
        t->inverse_diagonal[i] *= dof_scale[i];
        t->H[i * WIDE + i] += more[i] / (dof_scale[i] * dof_scale[i]);
    }
}

/* H = R'R, upper triangle of H only; leaves -g in y */
static int factor(wbc_tick *t) {
    load(t);
    right_side(t);
    return decompose(t);
}

/* y = R^-T y, in place */
static void solve_transposed(const wbc_tick *t, double *y) {
    for (int i = 0; i < NV; i++) {
        const double f = y[i] * t->inverse_diagonal[i];
        axpy(y, t->R + i * WIDE, -f, i);
        y[i] = f;
    }
}

/* x = R^-1 y */
static void solve_upper(const wbc_tick *t, const double *y, double *x) {
    for (int i = 0; i < WIDE; i++) x[i] = 0.0;
    for (int i = NV - 1; i >= 0; i--) x[i] = (y[i] - dot(t->R + i * WIDE, x, i)) * t->inverse_diagonal[i];
}

#define PACK(i) ((2 * NV - (i) - 1) * (i) / 2)

/* R^-1 by rows: full rows in `inverse`; packed for DAQP and divided by their lengths, which go to `scaling` as
 * 1/length, in Rinv */
static void invert(wbc_tick *t) {
#pragma GCC unroll 64
    for (int group = WIDE / 8 - 1; group >= 0; group--) invert_group(t, 8 * group);
    for (int i = 0; i < NV; i++) {
        const double *row = t->inverse + i * WIDE;
        const double scale = t->scaling[i] = 1.0 / sqrt(dot(row, row, i));
        double *packed = t->Rinv + PACK(i);
        for (int j = i; j < NV; j++) packed[j] = row[j] * scale;
    }
}

/* M = A R^-1, rows of length one */
static void image(wbc_tick *t) {
    for (int k = 0; k < MC; k++) {
        if (t->idle[k]) {
            t->scaling[NV + k] = 0.0;
            continue;
        }
        double row[WIDE] = {0};
        for (int e = a_start[k]; e < a_end[k]; e++)
            axpy(row, t->inverse + a_col[e] * WIDE, t->at[e], a_col[e]);
        const double square = dot(row, row, 0);
        const double scale = square > DEAD ? 1.0 / sqrt(square) : 0.0;
        t->scaling[NV + k] = scale;
        for (int j = 0; j < NV; j++) t->M[k * NV + j] = row[j] * scale;
    }
}

#endif
