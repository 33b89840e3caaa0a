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

/* The largest entry on the diagonal of H, in units of dof_scale */
static void find_stiffness(wbc_tick *t) {
    t->stiffness = 0.0;
    for (int i = 0; i < NV; i++) t->stiffness = larger(t->stiffness, t->H[i * WIDE + i] * dof_scale[i] * dof_scale[i]);
}

static void strengthen(wbc_tick *t) {
    find_stiffness(t);
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
        t->strength[k] = t->stiffness / square * (t->firm && (kept_of[k] >= 0 || bent[k]) ? FIRM : 1.0);
#if SOFT_ROWS > 0
        if (t->settled && t->give[k] > 0.0) {
            t->strength[k] = smaller(larger(MODEST * t->strength[k], SHARE / t->give[k]), 0.5 / t->give[k]);
            t->loose[k] = 1.0 / (1.0 / t->give[k] - t->strength[k]);
        }
#endif
        /* What this adds left of the diagonal in its group of 8 is not read */
        double row[WIDE] = {0};
        for (int e = a_start[k]; e < a_end[k]; e++) row[a_col[e]] = t->at[e];
        for (int e = a_start[k]; e < a_end[k]; e++) axpy(t->R + a_col[e] * WIDE, row, t->strength[k] * t->at[e], a_col[e]);
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
 * code: unrolled they would not fit into the cache of instructions. Rows from NV to TALL are zeros.
 *
 * Four rows of R, columns from `at` on: those of `from` without what the first `count` rows of R have of them */
INLINE void reduce_rows(wbc_tick *t, const double *from, int k, int count, int at) {
    double *r0 = t->R + k * WIDE + at, *r1 = r0 + WIDE, *r2 = r1 + WIDE, *r3 = r2 + WIDE;
    const double *s0 = from + k * WIDE + at;
    const double *s1 = k + 1 < NV ? s0 + WIDE : r1, *s2 = k + 2 < NV ? s0 + 2 * WIDE : r2, *s3 = k + 3 < NV ? s0 + 3 * WIDE : r3;
    four p0 = GIVEN_FOUR(s0), p1 = GIVEN_FOUR(s1), p2 = GIVEN_FOUR(s2), p3 = GIVEN_FOUR(s3);
    four q0 = GIVEN_FOUR(s0 + 4), q1 = GIVEN_FOUR(s1 + 4), q2 = GIVEN_FOUR(s2 + 4), q3 = GIVEN_FOUR(s3 + 4);
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

/* How the modified factorisation of Gill and Murray chooses pivots of v / dof_scale: none is less than `least`, and each is
 * such that no entry of the factor is larger than those of a definite matrix may be */
typedef struct {
    double least, bound, *scale, *more; /* `scale`: dof_scale, padded; `more`: what is added to the diagonal */
} wbc_pivots;

/* The pivot of row k, whose entries right of the diagonal stand in `row` */
static double chosen_pivot(wbc_pivots *chosen, const double *row, int k) {
    const int from = k & ~7;
    const double unit = chosen->scale[k] * chosen->scale[k], given = row[k] * unit;
    const four_bits here = {k - from, k - from, k - from, k - from};
    /* Entries right of the diagonal in its group of 8, then those of the others */
    four most = (four)((four_bits)SIZE_OF_FOUR(GIVEN_FOUR(row + from) * GIVEN_FOUR(chosen->scale + from)) & ((four_bits){0, 1, 2, 3} > here));
    RAISE_FOUR(most, (four)((four_bits)SIZE_OF_FOUR(GIVEN_FOUR(row + from + 4) * GIVEN_FOUR(chosen->scale + from + 4)) & ((four_bits){4, 5, 6, 7} > here)));
    for (int at = from + 8; at < WIDE; at += 8) {
        RAISE_FOUR(most, SIZE_OF_FOUR(GIVEN_FOUR(row + at) * GIVEN_FOUR(chosen->scale + at)));
        RAISE_FOUR(most, SIZE_OF_FOUR(GIVEN_FOUR(row + at + 4) * GIVEN_FOUR(chosen->scale + at + 4)));
    }
    const double aside = larger(larger(most[0], most[2]), larger(most[1], most[3]));
    chosen->more[k] = 0.0;
    /* A branch, so that the next rows need not wait for what decides it */
    if (given >= chosen->least && given * chosen->bound >= aside * aside * unit) return row[k];
    const double pivot = larger(larger(fabs(given), aside * aside * unit / chosen->bound), chosen->least);
    chosen->more[k] = (pivot - given) / unit;
    return pivot / unit;
}

/* 0 in the first of eight places */
INLINE void upper_part(double *place, int first) {
    const four_bits at = {first, first, first, first};
    FOUR(place) = (four)((four_bits)GIVEN_FOUR(place) & ((four_bits){0, 1, 2, 3} >= at));
    FOUR(place + 4) = (four)((four_bits)GIVEN_FOUR(place + 4) & ((four_bits){4, 5, 6, 7} >= at));
}

/* Row k + n of the four that begin with k: without what those before it have of it, and its pivot's root taken out. Rows
 * wait for reciprocals of pivots only, not for their roots. */
INLINE int finish_row(wbc_tick *t, int k, int n, double *plain, double *shares, wbc_pivots *chosen) {
    const int from = k & ~7, here = k - from + n;
    double *out = t->R + (k + n) * WIDE, *row = plain + n * WIDE;
    const double *f = shares + n;
    for (int at = from; at < WIDE; at += 8) {
        four p = GIVEN_FOUR(out + at), q = GIVEN_FOUR(out + at + 4);
        for (int r = 0; r < n; r++) {
            p = MADD(EACH(f[4 * r]), GIVEN_FOUR(plain + r * WIDE + at), p);
            q = MADD(EACH(f[4 * r]), GIVEN_FOUR(plain + r * WIDE + at + 4), q);
        }
        FOUR(row + at) = p, FOUR(row + at + 4) = q;
    }
    const double pivot = chosen ? chosen_pivot(chosen, row, k + n) : row[k + n];
    /* Not where it is the same: what reads the row next would have to wait for it */
    if (chosen && chosen->more[k + n] != 0.0) row[k + n] = pivot;
    const double reciprocal = 1.0 / pivot, scale = t->inverse_diagonal[k + n] = 1.0 / sqrt(pivot);
    for (int c = n + 1; c < 4; c++) shares[4 * n + c] = -row[k + c] * reciprocal;
    for (int at = from; at < WIDE; at += 8) {
        FOUR(out + at) = GIVEN_FOUR(row + at) * EACH(scale);
        FOUR(out + at + 4) = GIVEN_FOUR(row + at + 4) * EACH(scale);
    }
    upper_part(out + from, here);
    return pivot > 0.0;
}

/* Of a block of four rows: what each takes from those before it in the block, per entry of them, and its pivot */
typedef struct {
    double f01, f02, f03, f12, f13, f23, pivot[4], scale[4];
    four most[4]; /* largest entries right of the diagonal, where pivots are chosen */
} wbc_block;

/* From columns k to k + 3 of the rows; the arithmetic is that of finish_row */
INLINE void begin_block(wbc_block *b, four p0, four p1, four p2, four p3) {
    const double first = 1.0 / p0[0];
    b->f01 = -p0[1] * first, b->f02 = -p0[2] * first, b->f03 = -p0[3] * first;
    const double d1 = MADD(b->f01, p0[1], p1[1]), e2 = MADD(b->f01, p0[2], p1[2]), e3 = MADD(b->f01, p0[3], p1[3]), second = 1.0 / d1;
    b->f12 = -e2 * second, b->f13 = -e3 * second;
    const double d2 = MADD(b->f12, e2, MADD(b->f02, p0[2], p2[2])), g3 = MADD(b->f12, e3, MADD(b->f02, p0[3], p2[3]));
    b->f23 = -g3 * (1.0 / d2);
    b->pivot[0] = p0[0], b->pivot[1] = d1, b->pivot[2] = d2;
    b->pivot[3] = MADD(b->f23, g3, MADD(b->f13, e3, MADD(b->f03, p0[3], p3[3])));
    for (int n = 0; n < 4; n++) b->scale[n] = 1.0 / sqrt(b->pivot[n]);
}

/* Rows k to k + 3 of R at once while they are in registers, columns from `at` on, eight or, with `half`, four; `first`: columns
 * from k on, which say what the rows of the block take from each other */
INLINE void finish_block(wbc_tick *t, const double *from, int k, int at, int half, int first, const double *scale, wbc_block *b) {
    const double *s = from + k * WIDE + at;
    double *r = t->R + k * WIDE + at;
    four p0 = GIVEN_FOUR(s), p1 = GIVEN_FOUR(s + WIDE), p2 = GIVEN_FOUR(s + 2 * WIDE), p3 = GIVEN_FOUR(s + 3 * WIDE);
    four q0 = {0}, q1 = {0}, q2 = {0}, q3 = {0};
    if (!half) q0 = GIVEN_FOUR(s + 4), q1 = GIVEN_FOUR(s + WIDE + 4), q2 = GIVEN_FOUR(s + 2 * WIDE + 4), q3 = GIVEN_FOUR(s + 3 * WIDE + 4);
    const double *row = t->R + at, *end = row + k * WIDE;
    for (const double *f = t->R + k; row < end; row += WIDE, f += WIDE) {
        const four f0 = EACH(f[0]), f1 = EACH(f[1]), f2 = EACH(f[2]), f3 = EACH(f[3]), p = GIVEN_FOUR(row);
        p0 -= f0 * p, p1 -= f1 * p, p2 -= f2 * p, p3 -= f3 * p;
        if (half) continue;
        const four q = GIVEN_FOUR(row + 4);
        q0 -= f0 * q, q1 -= f1 * q, q2 -= f2 * q, q3 -= f3 * q;
    }
    if (first) begin_block(b, p0, p1, p2, p3);
    const four f01 = EACH(b->f01), f02 = EACH(b->f02), f03 = EACH(b->f03), f12 = EACH(b->f12), f13 = EACH(b->f13), f23 = EACH(b->f23);
    p1 = MADD(f01, p0, p1), q1 = MADD(f01, q0, q1);
    p2 = MADD(f12, p1, MADD(f02, p0, p2)), q2 = MADD(f12, q1, MADD(f02, q0, q2));
    p3 = MADD(f23, p2, MADD(f13, p1, MADD(f03, p0, p3))), q3 = MADD(f23, q2, MADD(f13, q1, MADD(f03, q0, q3)));
    if (first) {
        /* Nothing left of the diagonal */
        p1 = (four)((four_bits)p1 & (four_bits){0, -1, -1, -1}), p2 = (four)((four_bits)p2 & (four_bits){0, 0, -1, -1});
        p3 = (four)((four_bits)p3 & (four_bits){0, 0, 0, -1});
    }
    if (scale) {
        const four here = GIVEN_FOUR(scale + at), there = half ? here : GIVEN_FOUR(scale + at + 4);
        const four_bits right = {first ? 0 : -1, -1, -1, -1}, later = {first ? 0 : -1, first ? 0 : -1, -1, -1};
        const four_bits last = {first ? 0 : -1, first ? 0 : -1, first ? 0 : -1, -1}, none = {first ? 0 : -1, first ? 0 : -1, first ? 0 : -1, first ? 0 : -1};
        RAISE_FOUR(b->most[0], (four)((four_bits)SIZE_OF_FOUR(p0 * here) & right));
        RAISE_FOUR(b->most[1], (four)((four_bits)SIZE_OF_FOUR(p1 * here) & later));
        RAISE_FOUR(b->most[2], (four)((four_bits)SIZE_OF_FOUR(p2 * here) & last));
        RAISE_FOUR(b->most[3], (four)((four_bits)SIZE_OF_FOUR(p3 * here) & none));
        if (!half) {
            RAISE_FOUR(b->most[0], SIZE_OF_FOUR(q0 * there));
            RAISE_FOUR(b->most[1], SIZE_OF_FOUR(q1 * there));
            RAISE_FOUR(b->most[2], SIZE_OF_FOUR(q2 * there));
            RAISE_FOUR(b->most[3], SIZE_OF_FOUR(q3 * there));
        }
    }
    const four s0 = EACH(b->scale[0]), s1 = EACH(b->scale[1]), s2 = EACH(b->scale[2]), s3 = EACH(b->scale[3]);
    FOUR(r) = p0 * s0, FOUR(r + WIDE) = p1 * s1, FOUR(r + 2 * WIDE) = p2 * s2, FOUR(r + 3 * WIDE) = p3 * s3;
    if (!half) FOUR(r + 4) = q0 * s0, FOUR(r + WIDE + 4) = q1 * s1, FOUR(r + 2 * WIDE + 4) = q2 * s2, FOUR(r + 3 * WIDE + 4) = q3 * s3;
}

/* Whether the pivot of row k is what it would be without a choice */
INLINE int is_chosen(const wbc_pivots *chosen, double pivot, four most, int k) {
    const double unit = chosen->scale[k] * chosen->scale[k], given = pivot * unit;
    const double aside = larger(larger(most[0], most[2]), larger(most[1], most[3]));
    return given >= chosen->least && given * chosen->bound >= aside * aside * unit;
}

/* Rows k to k + 3 of R, behind which there are at least eight columns; 0 where a pivot is not positive, or not what is chosen */
INLINE int four_rows(wbc_tick *t, const double *from, int k, wbc_pivots *chosen) {
    const double *scale = chosen ? chosen->scale : NULL;
    wbc_block b = {.most = {{0}}};
    int at = k + 8, ok = 1;
    if (k & 4)
        for (int n = 0; n < 4; n++) FOUR(t->R + (k + n) * WIDE + k - 4) = (four){0};
    finish_block(t, from, k, k, 0, 1, scale, &b);
    for (; at + 8 <= WIDE; at += 8) finish_block(t, from, k, at, 0, 0, scale, &b);
    if (at < WIDE) finish_block(t, from, k, at, 1, 0, scale, &b);
    for (int n = 0; n < 4; n++) {
        ok &= chosen ? is_chosen(chosen, b.pivot[n], b.most[n], k + n) : b.pivot[n] > 0.0;
        t->inverse_diagonal[k + n] = b.scale[n];
        if (chosen) chosen->more[k + n] = 0.0;
    }
    return ok;
}

/* R = the Cholesky factor of the matrix `from`, R or H, with the inverse of its diagonal; 0 where it is not positive definite.
 * `chosen`: NULL, or how pivots are chosen so that there always is one; `from` is H then. */
INLINE int factor_rows(wbc_tick *t, const double *from, wbc_pivots *chosen) {
    int ok = 1;
    for (int k = 0; k < NV; k += 4) {
        if (k + 8 < NV) {
            const int fine = four_rows(t, from, k, chosen);
            if (!chosen) ok &= fine;
            if (!chosen || fine) continue;
        }
        /* The last rows, and those whose pivots are chosen: one after the other */
        double plain[4 * WIDE], shares[16];
        for (int at = k & ~7; at < WIDE; at += 8) reduce_rows(t, from, k, k, at);
        ok &= finish_row(t, k, 0, plain, shares, chosen);
        if (k + 1 < NV) ok &= finish_row(t, k, 1, plain, shares, chosen);
        if (k + 2 < NV) ok &= finish_row(t, k, 2, plain, shares, chosen);
        if (k + 3 < NV) ok &= finish_row(t, k, 3, plain, shares, chosen);
    }
    return ok;
}

/* R = H with the equality rows in it, not yet factored */
static void load(wbc_tick *t) {
    for (int i = 0; i < NV; i++)
        for (int at = i * WIDE + (i & ~7); at < i * WIDE + WIDE; at += 8) {
            FOUR(t->R + at) = GIVEN_FOUR(t->H + at);
            FOUR(t->R + at + 4) = GIVEN_FOUR(t->H + at + 4);
        }
    strengthen(t);
}

/* Where it fails roots of negative numbers are about; those in rows behind the last would be in all factors from then on */
static int decompose(wbc_tick *t) {
    const int ok = factor_rows(t, t->R, NULL);
    for (int i = NV * WIDE; !ok && i < TALL * WIDE; i++) t->R[i] = 0.0;
    return ok;
}

/* The same pivots of H, one row after the other, and no factor: of rows that have nothing of a pivot's nothing is taken */
static void choose_pivots(wbc_tick *t, const wbc_pivots *chosen) {
    const double inverse_bound = 1.0 / chosen->bound;
    for (int i = 0; i < NV; i++)
        for (int at = i & ~3; at < WIDE; at += 4)
            FOUR(t->R + i * WIDE + at) = GIVEN_FOUR(t->H + i * WIDE + at) * EACH(chosen->scale[i]) * GIVEN_FOUR(chosen->scale + at);
    for (int k = 0; k < NV; k++) {
        const double *own = t->R + k * WIDE, given = own[k], unit = chosen->scale[k];
        four most = SIZE_OF_FOUR(BEHIND(GIVEN_FOUR(own + (k & ~3)), k & 3));
        for (int at = (k & ~3) + 4; at < WIDE; at += 4) RAISE_FOUR(most, SIZE_OF_FOUR(GIVEN_FOUR(own + at)));
        const double aside = larger(larger(most[0], most[2]), larger(most[1], most[3])), needed = aside * aside * inverse_bound;
        const double pivot = given >= chosen->least && given >= needed ? given : larger(larger(fabs(given), needed), chosen->least);
        chosen->more[k] = (pivot - given) / (unit * unit);
        const double reciprocal = 1.0 / pivot;
        for (int i = k + 1; i < NV; i++) {
            if (is_zero(own + i)) continue;
            const four share = EACH(-own[i] * reciprocal);
            double *row = t->R + i * WIDE;
            for (int at = i & ~3; at < WIDE; at += 4) FOUR(row + at) = MADD(share, GIVEN_FOUR(own + at), GIVEN_FOUR(row + at));
        }
    }
}

/* H += a diagonal that makes it positive definite, with pivots of v / dof_scale of `least` or more, where it is not (Gill and
 * Murray); where it is, its plain factor. H = R'R afterwards, equality rows left out. H without entries as large as `added` is
 * positive semidefinite. 1 where anything was added. Of a reduced problem R is not the factor. */
static int decompose_amended(wbc_tick *t, double least, double added) {
    const double share = 1.0 / sqrt(larger((double)NV * NV - 1.0, 1.0));
    double diagonal = 0.0, other = 0.0, scale[WIDE] = {0}, more[WIDE];
    wbc_pivots chosen = {.least = least, .scale = scale, .more = more};
    memcpy(scale, dof_scale, NV * sizeof(double));
    for (int i = 0; i < NV; i++) diagonal = larger(diagonal, fabs(t->H[i * WIDE + i]) * dof_scale[i] * dof_scale[i]);
    /* No entry of a semidefinite matrix is larger than the largest on its diagonal */
    for (int i = 0; (diagonal + 2.0 * added) * share > diagonal && i < NV; i++)
        for (int j = i + 1; j < NV; j++) other = larger(other, fabs(t->H[i * WIDE + j]) * dof_scale[i] * dof_scale[j]);
    chosen.bound = larger(diagonal, other * share);
    if (REDUCES && t->reduced) choose_pivots(t, &chosen);
    else factor_rows(t, t->H, &chosen);
    int amended = 0;
    for (int i = 0; i < NV; i++) {
        t->H[i * WIDE + i] += more[i];
        amended |= more[i] > 0.0;
    }
    return amended;
}

/* H = R'R, upper triangle of H only; leaves -g in y */
static int factor(wbc_tick *t) {
    load(t);
    right_side(t);
    return decompose(t);
}

/* y = R^-T y, in place; four entries at a time, so that few operations wait for each other */
static void solve_transposed(const wbc_tick *t, double *y) {
    for (int i = 0; i < TALL; i += 4) {
        const double *s0 = t->R + i * WIDE, *s1 = s0 + WIDE, *s2 = s1 + WIDE, *s3 = s2 + WIDE, *d = t->inverse_diagonal + i;
        const double y0 = y[i] * d[0], y1 = MADD(-y0, s0[i + 1], y[i + 1]) * d[1];
        const double y2 = MADD(-y1, s1[i + 2], MADD(-y0, s0[i + 2], y[i + 2])) * d[2];
        const double y3 = MADD(-y2, s2[i + 3], MADD(-y1, s1[i + 3], MADD(-y0, s0[i + 3], y[i + 3]))) * d[3];
        y[i] = y0, y[i + 1] = y1, y[i + 2] = y2, y[i + 3] = y3;
        const four f0 = EACH(-y0), f1 = EACH(-y1), f2 = EACH(-y2), f3 = EACH(-y3);
        for (int at = i + 4; at < WIDE; at += 4) {
            const four first = MADD(f1, GIVEN_FOUR(s1 + at), MADD(f0, GIVEN_FOUR(s0 + at), GIVEN_FOUR(y + at)));
            FOUR(y + at) = MADD(f3, GIVEN_FOUR(s3 + at), MADD(f2, GIVEN_FOUR(s2 + at), first));
        }
    }
    for (int i = TALL; i < WIDE; i++) y[i] = 0.0;
}

/* x = R^-1 y, as above; entries that have just been found are waited for last */
static void solve_upper(const wbc_tick *t, const double *y, double *x) {
    for (int i = TALL; i < WIDE; i++) x[i] = 0.0;
    for (int i = TALL - 4; i >= 0; i -= 4) {
        const double *s0 = t->R + i * WIDE, *s1 = s0 + WIDE, *s2 = s1 + WIDE, *s3 = s2 + WIDE, *d = t->inverse_diagonal + i;
        four p0 = {0}, p1 = {0}, p2 = {0}, p3 = {0};
        for (int at = WIDE - 4; at > i; at -= 4) {
            const four known = GIVEN_FOUR(x + at);
            p0 = MADD(GIVEN_FOUR(s0 + at), known, p0), p1 = MADD(GIVEN_FOUR(s1 + at), known, p1);
            p2 = MADD(GIVEN_FOUR(s2 + at), known, p2), p3 = MADD(GIVEN_FOUR(s3 + at), known, p3);
        }
        const double x3 = (y[i + 3] - SUM_OF_FOUR(p3)) * d[3];
        const double x2 = MADD(-x3, s2[i + 3], y[i + 2] - SUM_OF_FOUR(p2)) * d[2];
        const double x1 = MADD(-x2, s1[i + 2], MADD(-x3, s1[i + 3], y[i + 1] - SUM_OF_FOUR(p1))) * d[1];
        const double x0 = MADD(-x1, s0[i + 1], MADD(-x2, s0[i + 2], MADD(-x3, s0[i + 3], y[i] - SUM_OF_FOUR(p0)))) * d[0];
        FOUR(x + i) = (four){x0, x1, x2, x3};
    }
}

/* Rows i to i + 3 of R^-1, eight columns from `at` on: R_r^-1 (e_r - the sum of R_rk times row k over later rows k) */
INLINE void invert_rows(wbc_tick *t, int i, int at) {
    const double *s0 = t->R + i * WIDE, *s1 = s0 + WIDE, *s2 = s1 + WIDE, *s3 = s2 + WIDE, *d = t->inverse_diagonal + i;
    const double here = at == (i & ~7) && i == at ? -1.0 : 0.0, there = at == (i & ~7) && i > at ? -1.0 : 0.0;
    double *out = t->inverse + i * WIDE + at;
    four p0 = {here, 0.0, 0.0, 0.0}, p1 = {0.0, here, 0.0, 0.0}, p2 = {0.0, 0.0, here, 0.0}, p3 = {0.0, 0.0, 0.0, here};
    four q0 = {there, 0.0, 0.0, 0.0}, q1 = {0.0, there, 0.0, 0.0}, q2 = {0.0, 0.0, there, 0.0}, q3 = {0.0, 0.0, 0.0, there};
    const int to = at + 8 < NV ? at + 8 : NV;
    for (int k = i + 4; k < to; k++) {
        const double *below = t->inverse + k * WIDE + at;
        const four p = GIVEN_FOUR(below), q = GIVEN_FOUR(below + 4);
        const four f0 = EACH(s0[k]), f1 = EACH(s1[k]), f2 = EACH(s2[k]), f3 = EACH(s3[k]);
        p0 = MADD(f0, p, p0), q0 = MADD(f0, q, q0);
        p1 = MADD(f1, p, p1), q1 = MADD(f1, q, q1);
        p2 = MADD(f2, p, p2), q2 = MADD(f2, q, q2);
        p3 = MADD(f3, p, p3), q3 = MADD(f3, q, q3);
    }
    p3 *= EACH(-d[3]), q3 *= EACH(-d[3]);
    p2 = MADD(EACH(s2[i + 3]), p3, p2) * EACH(-d[2]), q2 = MADD(EACH(s2[i + 3]), q3, q2) * EACH(-d[2]);
    p1 = MADD(EACH(s1[i + 2]), p2, p1), q1 = MADD(EACH(s1[i + 2]), q2, q1);
    p1 = MADD(EACH(s1[i + 3]), p3, p1) * EACH(-d[1]), q1 = MADD(EACH(s1[i + 3]), q3, q1) * EACH(-d[1]);
    p0 = MADD(EACH(s0[i + 1]), p1, p0), q0 = MADD(EACH(s0[i + 1]), q1, q0);
    p0 = MADD(EACH(s0[i + 2]), p2, p0), q0 = MADD(EACH(s0[i + 2]), q2, q0);
    p0 = MADD(EACH(s0[i + 3]), p3, p0) * EACH(-d[0]), q0 = MADD(EACH(s0[i + 3]), q3, q0) * EACH(-d[0]);
    FOUR(out) = p0, FOUR(out + 4) = q0, FOUR(out + WIDE) = p1, FOUR(out + WIDE + 4) = q1;
    FOUR(out + 2 * WIDE) = p2, FOUR(out + 2 * WIDE + 4) = q2, FOUR(out + 3 * WIDE) = p3, FOUR(out + 3 * WIDE + 4) = q3;
}

/* R^-1 by rows, which are full */
static void invert_factor(wbc_tick *t) {
    for (int i = TALL - 4; i >= 0; i -= 4)
        for (int at = i & ~7; at < WIDE; at += 8) invert_rows(t, i, at);
}

/* 1 / length of each row of R^-1 */
static void find_scaling(wbc_tick *t) {
    for (int i = 0; i < NV; i++) {
        const double *row = t->inverse + i * WIDE;
        t->scaling[i] = dot(row, row, i);
    }
    for (int i = 0; i < NV; i++) t->scaling[i] = 1.0 / sqrt(t->scaling[i]);
}

#define PACK(i) ((2 * NV - (i) - 1) * (i) / 2)

/* What DAQP reads of R^-1: rows of length one, packed */
static void pack(wbc_tick *t) {
    for (int i = 0; i < NV; i++) {
        const double *row = t->inverse + i * WIDE, scale = t->scaling[i];
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
            /* Rows of sensed pairs have places for all joints */
            if (t->at[e] != 0.0) axpy(row, t->inverse + a_col[e] * WIDE, t->at[e], a_col[e]);
        const double square = dot(row, row, 0);
        const double scale = square > DEAD ? 1.0 / sqrt(square) : 0.0;
        t->scaling[NV + k] = scale;
        for (int j = 0; j < NV; j++) t->M[k * NV + j] = row[j] * scale;
    }
}

#endif
