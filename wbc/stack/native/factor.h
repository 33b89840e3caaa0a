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

/* Matrices are worked on in blocks of four rows and eight columns, which stay in registers, in loops that are short as
 * code: unrolled they would not fit into the cache of instructions.
 *
 * Four rows of R, columns from `at` on, without what the first `count` rows have of them */
INLINE void reduce_rows(wbc_tick *t, int k, int count, int at) {
    double *r0 = t->R + k * WIDE + at, *r1 = r0 + WIDE, *r2 = r1 + WIDE, *r3 = r2 + WIDE;
    four p0 = FOUR(r0), p1 = FOUR(r1), p2 = FOUR(r2), p3 = FOUR(r3);
    four q0 = FOUR(r0 + 4), q1 = FOUR(r1 + 4), q2 = FOUR(r2 + 4), q3 = FOUR(r3 + 4);
    for (int i = 0; i < count; i++) {
        const double *f = t->R + i * WIDE + k, *above = t->R + i * WIDE + at;
        const four p = -GIVEN_FOUR(above), q = -GIVEN_FOUR(above + 4);
        const four f0 = EACH(f[0]), f1 = EACH(f[1]), f2 = EACH(f[2]), f3 = EACH(f[3]);
        p0 = MADD(f0, p, p0), q0 = MADD(f0, q, q0);
        p1 = MADD(f1, p, p1), q1 = MADD(f1, q, q1);
        p2 = MADD(f2, p, p2), q2 = MADD(f2, q, q2);
        p3 = MADD(f3, p, p3), q3 = MADD(f3, q, q3);
    }
    FOUR(r0) = p0, FOUR(r0 + 4) = q0, FOUR(r1) = p1, FOUR(r1 + 4) = q1;
    FOUR(r2) = p2, FOUR(r2 + 4) = q2, FOUR(r3) = p3, FOUR(r3 + 4) = q3;
}

/* out[0..7] += f[0] rows[0..7] + f[1] rows[WIDE .. WIDE + 7] + ..., `count` of them */
INLINE void add_rows(double *out, const double *f, const double *rows, int count) {
    four p = FOUR(out), q = FOUR(out + 4);
    for (int i = 0; i < count; i++) {
        const four each = EACH(f[i]);
        p = MADD(each, GIVEN_FOUR(rows + i * WIDE), p);
        q = MADD(each, GIVEN_FOUR(rows + i * WIDE + 4), q);
    }
    FOUR(out) = p, FOUR(out + 4) = q;
}

/* Largest size of the entries of row k from `from`, the first column of its group, that are right of the diagonal */
INLINE double largest_aside(const double *row, int k, int from) {
    double part[8];
    for (int c = 0; c < 8; c++) part[c] = from + c > k ? fabs(row[from + c]) : 0.0;
    for (int at = from + 8; at < WIDE; at += 8)
        for (int c = 0; c < 8; c++) part[c] = larger(fabs(row[at + c]), part[c]);
    return larger(larger(larger(part[0], part[4]), larger(part[1], part[5])),
                  larger(larger(part[2], part[6]), larger(part[3], part[7])));
}

/* The matrix in R into its Cholesky factor, with the inverse of its diagonal; 0 where it is not positive definite. With
 * `more`, what is added to the diagonal, the modified factorisation of Gill and Murray: no pivot is less than `least`, and
 * each is such that no entry of the factor is larger than those of a definite matrix may be. */
INLINE int factor_rows(wbc_tick *t, double least, double bound, double *more) {
    int ok = 1;
    for (int from = 0; from < WIDE; from += 8) {
        const int to = from + 8 < NV ? from + 8 : NV;
        double plain[8 * WIDE], reciprocal[8];
        int k = from;
        for (; from > 0 && k + 4 <= to; k += 4)
            for (int at = from; at < WIDE; at += 8) reduce_rows(t, k, from, at);
        for (; from > 0 && k < to; k++) {
            double f[WIDE];
            for (int i = 0; i < from; i++) f[i] = -t->R[i * WIDE + k];
            for (int at = from; at < WIDE; at += 8) add_rows(t->R + k * WIDE + at, f, t->R + at, from);
        }
        for (k = from; k < to; k++) {
            double *out = t->R + k * WIDE, *row = plain + (k - from) * WIDE, f[8];
            /* Rows of the group wait for reciprocals of pivots only, not for their roots */
            for (int i = from; i < k; i++) f[i - from] = -plain[(i - from) * WIDE + k] * reciprocal[i - from];
            for (int at = from; at < WIDE; at += 8) {
                for (int c = 0; c < 8; c++) row[at + c] = out[at + c];
                add_rows(row + at, f, plain + at, k - from);
            }
            double pivot = row[k];
            if (more != NULL) {
                const double aside = largest_aside(row, k, from);
                pivot = larger(larger(fabs(pivot), aside * aside / bound), least);
                more[k] = pivot - row[k];
                row[k] = pivot;
            } else {
                ok &= pivot > 0.0;
            }
            reciprocal[k - from] = 1.0 / pivot;
            const double scale = t->inverse_diagonal[k] = 1.0 / sqrt(pivot);
            for (int at = from; at < WIDE; at += 8)
                for (int c = 0; c < 8; c++) out[at + c] = row[at + c] * scale;
            for (int j = from; j < k; j++) out[j] = 0.0;
        }
    }
    return ok;
}

/* R = H with the equality rows in it, not yet factored */
static void load(wbc_tick *t) {
    memcpy(t->R, t->H, sizeof t->R);
    strengthen(t);
}

static int decompose(wbc_tick *t) { return factor_rows(t, 0.0, 0.0, NULL); }

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
    factor_rows(t, least, bound, more);
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

/* y = R^-T y, in place; eight entries at a time, so that few operations wait for each other */
static void solve_transposed(const wbc_tick *t, double *y) {
    for (int from = 0; from < WIDE; from += 8) {
        const int count = NV - from < 8 ? NV - from : 8;
        const double *rows_of = t->R + from * WIDE;
        double part[8];
        for (int c = 0; c < 8; c++) part[c] = y[from + c];
#pragma GCC unroll 8
        for (int r = 0; r < count; r++) {
            part[r] *= t->inverse_diagonal[from + r];
#pragma GCC unroll 8
            for (int c = r + 1; c < 8; c++) part[c] = MADD(-part[r], rows_of[r * WIDE + from + c], part[c]);
        }
        for (int c = 0; c < 8; c++) y[from + c] = part[c];
        for (int at = from + 8; at < WIDE; at += 8) {
            double sum[8];
            for (int c = 0; c < 8; c++) sum[c] = y[at + c];
            for (int r = 0; r < count; r++)
                for (int c = 0; c < 8; c++) sum[c] = MADD(-part[r], rows_of[r * WIDE + at + c], sum[c]);
            for (int c = 0; c < 8; c++) y[at + c] = sum[c];
        }
    }
}

/* x = R^-1 y, as above */
static void solve_upper(const wbc_tick *t, const double *y, double *x) {
    for (int i = NV; i < WIDE; i++) x[i] = 0.0;
    for (int from = WIDE - 8; from >= 0; from -= 8) {
        const int count = NV - from < 8 ? NV - from : 8;
        const double *rows_of = t->R + from * WIDE;
        double part[8];
        for (int r = 0; r < count; r++) {
            const double *row = rows_of + r * WIDE;
            double sum[8] = {0};
            for (int at = from + 8; at < WIDE; at += 8)
                for (int c = 0; c < 8; c++) sum[c] = MADD(row[at + c], x[at + c], sum[c]);
            part[r] = y[from + r] - (((sum[0] + sum[4]) + (sum[1] + sum[5])) + ((sum[2] + sum[6]) + (sum[3] + sum[7])));
        }
#pragma GCC unroll 8
        for (int r = count - 1; r >= 0; r--) {
            x[from + r] = part[r] *= t->inverse_diagonal[from + r];
#pragma GCC unroll 8
            for (int above = 0; above < r; above++)
                part[above] = MADD(-part[r], rows_of[above * WIDE + from + r], part[above]);
        }
    }
}

#define PACK(i) ((2 * NV - (i) - 1) * (i) / 2)

/* Four rows of R^-1, columns from `at` on: what rows of R from `from` on add, before the division by their pivots */
INLINE void gather_rows(wbc_tick *t, int i, int from, int at) {
    const double *s0 = t->R + i * WIDE, *s1 = s0 + WIDE, *s2 = s1 + WIDE, *s3 = s2 + WIDE;
    double *out = t->inverse + i * WIDE + at;
    four p0 = {0}, p1 = {0}, p2 = {0}, p3 = {0}, q0 = {0}, q1 = {0}, q2 = {0}, q3 = {0};
    const int to = at + 8 < NV ? at + 8 : NV;
    for (int k = from; k < to; k++) {
        const double *below = t->inverse + k * WIDE + at;
        const four p = GIVEN_FOUR(below), q = GIVEN_FOUR(below + 4);
        const four f0 = EACH(s0[k]), f1 = EACH(s1[k]), f2 = EACH(s2[k]), f3 = EACH(s3[k]);
        p0 = MADD(f0, p, p0), q0 = MADD(f0, q, q0);
        p1 = MADD(f1, p, p1), q1 = MADD(f1, q, q1);
        p2 = MADD(f2, p, p2), q2 = MADD(f2, q, q2);
        p3 = MADD(f3, p, p3), q3 = MADD(f3, q, q3);
    }
    FOUR(out) = p0, FOUR(out + 4) = q0, FOUR(out + WIDE) = p1, FOUR(out + WIDE + 4) = q1;
    FOUR(out + 2 * WIDE) = p2, FOUR(out + 2 * WIDE + 4) = q2, FOUR(out + 3 * WIDE) = p3, FOUR(out + 3 * WIDE + 4) = q3;
}

/* R^-1 by rows: full rows in `inverse`; packed for DAQP and divided by their lengths, which go to `scaling` as
 * 1/length, in Rinv */
static void invert(wbc_tick *t) {
    memset(t->inverse, 0, sizeof t->inverse);
    for (int from = WIDE - 8; from >= 0; from -= 8) {
        const int to = from + 8 < NV ? from + 8 : NV;
        for (int at = from + 8; at < WIDE; at += 8)
            for (int i = from; i + 4 <= to; i += 4) gather_rows(t, i, from + 8, at);
        for (int i = to - 1; i >= from; i--) {
            double *out = t->inverse + i * WIDE;
            const double *source = t->R + i * WIDE, first = t->inverse_diagonal[i];
            for (int at = from; at < WIDE; at += 8) {
                add_rows(out + at, source + i + 1, t->inverse + (i + 1) * WIDE + at, to - i - 1);
                for (int c = 0; c < 8; c++) out[at + c] *= -first;
            }
            out[i] = first;
        }
    }
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
