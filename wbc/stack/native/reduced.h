/* The equality rows E v = b of a robot with loops are taken out of its QP: v = s + Z z with as many z as motions are left.
 *
 * In v / dof_scale each row gives one variable, and none of the others (Gauss and Jordan). The columns of the variables that were given
 * then hold the inverse P of what they were; its transpose gives multipliers. Rows that nearly depend on each other are left to the
 * factor that has all variables. docs/solvers.md#loops */
#ifndef WBC_REDUCED_H
#define WBC_REDUCED_H

#include "mirrored.h"

/* Pivots of a number that the compiler knows, up to this many, become code of their own each: with more it would not fit into the
 * cache of instructions */
#define FEW 8

INLINE double thin_dot(const double *x, const double *y) {
    four sum = {0};
    for (int at = 0; at < THIN; at += 4) sum = MADD(GIVEN_FOUR(x + at), GIVEN_FOUR(y + at), sum);
    return SUM_OF_FOUR(sum);
}

INLINE void thin_add(double *out, const double *in, double f) {
    const four each = EACH(f);
    for (int at = 0; at < THIN; at += 4) FOUR(out + at) = MADD(each, GIVEN_FOUR(in + at), GIVEN_FOUR(out + at));
}

INLINE int gives(wbc_tick *t, int j, int count, double least, double *open) {
    return t->is_given[j] = give(t->equal, NV, j, count, least, open, t->given);
}

/* Variables for all of `count` rows; 0 where the rows depend on each other. Rows without forces give motions, first those that no
 * motor drives and few rows have; then rows with forces give forces. Joints of one loop alone then have no entries in rows of others. */
INLINE int give_all(wbc_tick *t, int count) {
    double open[WIDE];
    int step = 0, late[WIDE] = {0};
    if (!unit_rows(t, count)) return 0;
    for (int i = 0; i < WIDE; i++) open[i] = 0.0;
    for (int i = 0; i < count; i++) open[i] = !(late[i] = late_row[t->equal_row[i]]);
    for (int j = 0; j < NV; j++) t->is_given[j] = 0;
    for (int n = 0; n < DOFS && step < count; n++) step += gives(t, give_order[n], count, CLEAR_PIVOT, open);
    for (int i = 0; i < count; i++)
        if (late[i]) open[i] = 1.0;
    for (double least = CLEAR_PIVOT; least >= PIVOT && step < count; least *= PIVOT / CLEAR_PIVOT)
        for (int n = 0; n < NV && step < count; n++) {
            const int j = n < NV - DOFS ? DOFS + n : give_order[n - (NV - DOFS)];
            if (!t->is_given[j]) step += gives(t, j, count, least, open);
        }
    return step == count;
}

/* Z and P of the rows at hand; 0 where they depend on each other, or are none */
static int eliminate(wbc_tick *t) {
    const int count = t->reduced = find_equalities(t);
    int left = 0;
    t->mirrored = FORCES > 0 && give_mirrored(t, count);
    if (t->mirrored) return count;
    /* The usual number is known to the compiler */
    const int ok = count > 0 && (count == REDUCED ? give_all(t, REDUCED) : give_all(t, count));
    for (int j = 0; ok && j < NV; j++)
        if (!t->is_given[j]) t->left[left++] = j;
    t->width = left;
    if (!ok || left > THIN) return t->reduced = 0;
    for (int c = left; c < THIN; c++) t->left[c] = 0;
    for (int at = 0; at < THIN; at += 4) {
        const double *columns[4];
        for (int r = 0; r < 4; r++) columns[r] = t->equal + t->left[at + r] * WIDE;
        const four_bits known = PLACES(at) < (four_bits){left, left, left, left};
        for (int i = 0; i < count; i++) {
            const four row = EACH(-dof_scale[t->given[i]]) * (four){columns[0][i], columns[1][i], columns[2][i], columns[3][i]};
            FOUR(t->basis + t->given[i] * WIDE + at) = (four)((four_bits)row & known);
        }
        for (int c = 0; c < left; c++) {
            const int i = t->left[c];
            FOUR(t->basis + i * WIDE + at) = (four)((four_bits)EACH(dof_scale[i]) & (PLACES(at) == (four_bits){c, c, c, c}));
        }
    }
    return count;
}

/* Whether the rows that were taken out are those that are equalities now */
static int same_equalities(const wbc_tick *t) {
    int count = 0, same = 1;
    for (int i = 0; i < NV; i++) same &= t->low[i] != t->high[i];
    for (int k = 0; k < MC; k++) {
        if (t->low[NV + k] != t->high[NV + k]) continue;
        same &= count < t->reduced && t->equal_row[count] == k;
        count++;
    }
    return same && count == t->reduced;
}

/* Loops over the rows that were taken out, in groups of four */
#define EACH_ROW_GROUP(t, i) for (int i = 0; i < (t)->reduced; i += 4)

/* out = the first `count` columns of P times e, or their sizes */
INLINE void sum_columns(const wbc_tick *t, int count, const double *e, int sizes, double *out) {
    for (int k = 0; k < count; k++) {
        const double *column = COLUMN(t, k);
        const four each = EACH(e[k]);
        for (int i = 0; i < count; i += 4) {
            const four part = sizes ? SIZE_OF_FOUR(GIVEN_FOUR(column + i)) : GIVEN_FOUR(column + i);
            FOUR(out + i) = MADD(each, part, FOUR(out + i));
        }
    }
}

/* x = P e: the variables that were given, for rows that are e, the others 0; of `sizes` no |P e| is larger where |e| are at most these */
static void by_rows(const wbc_tick *t, const double *e, double *x, int sizes) {
    double moved[WIDE] = {0}, unit[WIDE];
    if (FORCES > 0 && t->mirrored) {
        by_rows_mirrored(t, e, x, sizes);
        return;
    }
    for (int k = 0; k < t->reduced; k++) unit[k] = e[k] * t->equal_scale[k];
    if (t->reduced == REDUCED) sum_columns(t, REDUCED, unit, sizes, moved);
    else sum_columns(t, t->reduced, unit, sizes, moved);
    for (int i = 0; i < WIDE; i++) x[i] = 0.0;
    for (int k = 0; k < t->reduced; k++) x[t->given[k]] = moved[k] * dof_scale[t->given[k]];
}

/* Multipliers, of WIDE numbers, of the rows that leave nothing of a force `r` on the variables that were given: r + E' lambda = 0
 * there */
static void multipliers_of(const wbc_tick *t, const double *r, double *lambda) {
    double push[WIDE] = {0};
    if (FORCES > 0 && t->mirrored) {
        multipliers_mirrored(t, r, lambda);
        return;
    }
    for (int k = 0; k < t->reduced; k++) push[k] = -r[t->given[k]] * dof_scale[t->given[k]];
    for (int k = 0; k < t->reduced; k++) {
        four sum = {0};
        EACH_ROW_GROUP(t, i) sum = MADD(GIVEN_FOUR(COLUMN(t, k) + i), GIVEN_FOUR(push + i), sum);
        lambda[k] = SUM_OF_FOUR(sum) * t->equal_scale[k];
    }
    for (int k = t->reduced; k < WIDE; k++) lambda[k] = 0.0;
}

/* Whether any of four entries, or of those below them in the four rows of H, is not 0: limbs share none that no task or loop joins */
INLINE int any_entries(const double *entry, int rows) {
    four_bits any = {0};
    for (int r = 0; r < rows; r++) any |= (four_bits)GIVEN_FOUR(entry + r * WIDE);
    return (any[0] | any[1] | any[2] | any[3]) != 0;
}

/* p, q += f times eight columns of a row, or, not `both`, four */
INLINE void add_columns(four *p, four *q, const double *row, double f, int both) {
    const four each = EACH(f);
    *p = MADD(each, GIVEN_FOUR(row), *p);
    if (both) *q = MADD(each, GIVEN_FOUR(row + 4), *q);
}

/* `count` rows of H Z from i on, at most four, columns from `at` on, eight of them at most */
INLINE void some_products(wbc_tick *t, int i, int count, int at) {
    const int both = at + 4 < THIN;
    const double *basis = t->basis + at, *own = t->H + i * WIDE;
    four p[4] = {{0}}, q[4] = {{0}};
    for (int j = 0; j < i; j++) {
        const double *h = t->H + j * WIDE + i;
        if (!any_entries(h, 1)) continue;
        for (int r = 0; r < count; r++) add_columns(p + r, q + r, basis + j * WIDE, h[r], both);
    }
    for (int j = i; j < i + count; j++)
        for (int r = 0; r < count; r++) add_columns(p + r, q + r, basis + j * WIDE, j < i + r ? own[(j - i) * WIDE + i + r] : own[r * WIDE + j], both);
    for (int group = i + count; group < NV; group += 4) {
        if (!any_entries(own + group, count)) continue;
        for (int j = group; j < NV && j < group + 4; j++)
            for (int r = 0; r < count; r++) add_columns(p + r, q + r, basis + j * WIDE, own[r * WIDE + j], both);
    }
    for (int r = 0; r < count; r++) {
        FOUR(t->product_of_basis + (i + r) * WIDE + at) = p[r];
        if (both) FOUR(t->product_of_basis + (i + r) * WIDE + at + 4) = q[r];
    }
}

/* The upper triangle of Z'X, of X = H Z or another symmetric matrix times Z, by groups of four */
INLINE void form_gram(const wbc_tick *t, const double *product, double *gram) {
    for (int a = 0; a < t->width; a += 4)
        for (int at = a; at < THIN; at += 8) {
            const int both = at + 4 < THIN;
            four p[4] = {{0}}, q[4] = {{0}};
            for (int n = 0; n < t->reduced; n++) {
                const double *own = t->basis + t->given[n] * WIDE + a, *there = product + t->given[n] * WIDE + at;
                for (int r = 0; r < 4; r++) add_columns(p + r, q + r, there, own[r], both);
            }
            /* The variable that is left is itself */
            for (int r = 0; r < 4 && a + r < t->width; r++) {
                const int b = a + r;
                add_columns(p + r, q + r, product + t->left[b] * WIDE + at, dof_scale[t->left[b]], both);
                FOUR(gram + b * WIDE + at) = p[r];
                if (both) FOUR(gram + b * WIDE + at + 4) = q[r];
            }
        }
}

/* Pivot a of `gram`: what it takes from later rows, and what of `inverse` goes with them; 0 where it is not positive */
INLINE int take_pivot(double *gram, int a, int width, double *row, double *roots, double *inverse) {
    const double *own = gram + a * WIDE, pivot = own[a], reciprocal = -1.0 / pivot;
    if (!(pivot > 0.0)) return 0;
    roots[a] = 1.0 / sqrt(pivot);
    inverse[a * WIDE + a] = 1.0;
    /* Groups that have entries right of the pivot */
    for (int at = (a + 1) & ~3; at < THIN; at += 4) {
        const four part = GIVEN_FOUR(own + at) * EACH(reciprocal);
        FOUR(row + at) = at > a ? part : BEHIND(part, a & 3);
    }
    for (int b = a + 1; b < width; b++)
        for (int at = b & ~3; at < THIN; at += 4) {
            double *other = gram + b * WIDE + at;
            FOUR(other) = MADD(EACH(own[b]), GIVEN_FOUR(row + at), GIVEN_FOUR(other));
        }
    for (int c = 0; c <= a && a + 1 < width; c++)
        for (int at = (a + 1) & ~3; at < THIN; at += 4) {
            double *other = inverse + c * WIDE + at;
            FOUR(other) = MADD(EACH(inverse[c * WIDE + a]), GIVEN_FOUR(row + at), GIVEN_FOUR(other));
        }
    return 1;
}

/* R^-1 of R'R = `gram`, whose upper triangle becomes R without the roots of its pivots, on its diagonal; 0 where it is not positive
 * definite. Rows wait for reciprocals of pivots only, not for their roots. `few`: `width` is at most FEW, and known. */
INLINE int invert(double *gram, int width, double *inverse, int few) {
    double row[WIDE] = {0}, roots[WIDE] = {0};
    for (int a = 0; a < width; a++)
        for (int at = 0; at < THIN; at += 4) FOUR(inverse + a * WIDE + at) = (four){0};
    for (int a = 0; !few && a < width; a++)
        if (!take_pivot(gram, a, width, row, roots, inverse)) return 0;
#define TAKE(a) \
    if (few && a < width && !take_pivot(gram, a, width, row, roots, inverse)) return 0;
    TAKE(0) TAKE(1) TAKE(2) TAKE(3) TAKE(4) TAKE(5) TAKE(6) TAKE(7)
#undef TAKE
    for (int a = 0; a < width; a++)
        for (int at = a & ~3; at < THIN; at += 4) FOUR(inverse + a * WIDE + at) *= GIVEN_FOUR(roots + at);
    return 1;
}

/* The factor of `gram` as its inverse. The usual number of variables is known to the compiler. */
static int factor_gram(const wbc_tick *t, double *gram, double *inverse) {
    if (t->width != NV - REDUCED) return invert(gram, t->width, inverse, 0);
    return NV - REDUCED <= FEW ? invert(gram, NV - REDUCED, inverse, 1) : invert(gram, NV - REDUCED, inverse, 0);
}

INLINE void copy_columns(const wbc_tick *t, const double *from, double *to) {
    for (int a = 0; a < t->width; a++)
        for (int at = a & ~3; at < THIN; at += 4) FOUR(to + a * WIDE + at) = GIVEN_FOUR(from + a * WIDE + at);
}

/* The factor of Z'HZ = R'R, as its inverse; 0 where it is not positive definite */
static int factor_reduced(wbc_tick *t) {
    for (int at = 0; at < THIN; at += 8) {
        for (int i = 0; i + 4 <= NV; i += 4) some_products(t, i, 4, at);
        if (NV % 4) some_products(t, NV / 4 * 4, NV % 4, at);
    }
    form_gram(t, t->product_of_basis, t->gram);
    copy_columns(t, t->gram, t->reduced_R);
    return factor_gram(t, t->reduced_R, t->reduced_inverse);
}

/* `stiff` = more D^-2 Z and `gram` = Z'HZ + Z' stiff, D the units of the variables */
INLINE void stiffened(const wbc_tick *t, double more, double *stiff, double *gram) {
    for (int i = 0; i < NV; i++) {
        const four each = EACH(more / (dof_scale[i] * dof_scale[i]));
        for (int at = 0; at < THIN; at += 4) FOUR(stiff + i * WIDE + at) = each * GIVEN_FOUR(t->basis + i * WIDE + at);
    }
    form_gram(t, stiff, gram);
    for (int a = 0; a < t->width; a++)
        for (int at = a & ~3; at < THIN; at += 4) FOUR(gram + a * WIDE + at) += GIVEN_FOUR(t->gram + a * WIDE + at);
}

/* The factor of H + more / D^2, from that of H; H Z follows */
static int stiffen_reduced(wbc_tick *t, double more) {
    double stiff[REDUCED_NV * WIDE + 1], gram[REDUCED_NV * WIDE + 1];
    stiffened(t, more, stiff, gram);
    for (int i = 0; i < NV; i++)
        for (int at = 0; at < THIN; at += 4) FOUR(t->product_of_basis + i * WIDE + at) += GIVEN_FOUR(stiff + i * WIDE + at);
    copy_columns(t, gram, t->gram);
    copy_columns(t, gram, t->reduced_R);
    return factor_gram(t, t->reduced_R, t->reduced_inverse);
}

/* out += rows' f, of NV rows */
INLINE void add_rows(const double *rows, const double *f, double *out) {
    for (int at = 0; at < THIN; at += 4) {
        four even = GIVEN_FOUR(out + at), odd = {0};
        int i = 0;
        for (; i + 1 < NV; i += 2) {
            even = MADD(EACH(f[i]), GIVEN_FOUR(rows + i * WIDE + at), even);
            odd = MADD(EACH(f[i + 1]), GIVEN_FOUR(rows + (i + 1) * WIDE + at), odd);
        }
        if (i < NV) even = MADD(EACH(f[i]), GIVEN_FOUR(rows + i * WIDE + at), even);
        FOUR(out + at) = even + odd;
    }
}

/* out = R^-T z */
INLINE void reduced_transposed(const wbc_tick *t, const double *inverse, const double *z, double *out) {
    for (int at = 0; at < THIN; at += 4) {
        four sum = {0};
        for (int a = 0; a < t->width && a < at + 4; a++) sum = MADD(EACH(z[a]), GIVEN_FOUR(inverse + a * WIDE + at), sum);
        FOUR(out + at) = sum;
    }
}

/* y = R^-T Z'(H x + b), where x is 0 but for the variables that were given, and b may be none */
static void reduced_forces(const wbc_tick *t, const double *x, const double *b, double *y) {
    double z[WIDE] = {0};
    for (int k = 0; k < t->reduced; k++) thin_add(z, t->product_of_basis + t->given[k] * WIDE, x[t->given[k]]);
    if (b) add_rows(t->basis, b, z);
    reduced_transposed(t, t->reduced_inverse, z, y);
}

/* x = Z (Z'HZ)^-1 Z'b */
static void solve_reduced(const wbc_tick *t, const double *inverse, const double *b, double *x) {
    double y[WIDE], z[WIDE] = {0};
    add_rows(t->basis, b, z);
    reduced_transposed(t, inverse, z, y);
    for (int a = 0; a < t->width; a++) z[a] = thin_dot(inverse + a * WIDE, y);
    for (int i = 0; i < WIDE; i++) x[i] = i < NV ? thin_dot(t->basis + i * WIDE, z) : 0.0;
}

/* The same of H + more / D^2, whose factor is not kept; 0 where it has none */
static int solve_stiffened(wbc_tick *t, double more, const double *b, double *x) {
    double stiff[REDUCED_NV * WIDE + 1], gram[REDUCED_NV * WIDE + 1], inverse[REDUCED_NV * WIDE + 1];
    stiffened(t, more, stiff, gram);
    const int ok = factor_gram(t, gram, inverse);
    if (ok) solve_reduced(t, inverse, b, x);
    return ok;
}

/* `count` rows of T from the n-th variable that was given on, at most four, columns from `at` on */
INLINE void some_seen(wbc_tick *t, int n, int count, int at) {
    const double *own[4];
    four sum[4] = {{0}};
    for (int r = 0; r < count; r++) own[r] = t->basis + t->given[n + r] * WIDE;
    for (int a = 0; a < t->width && a < at + 4; a++) {
        const four inverse = GIVEN_FOUR(t->reduced_inverse + a * WIDE + at);
        for (int r = 0; r < count; r++) sum[r] = MADD(EACH(own[r][a]), inverse, sum[r]);
    }
    for (int r = 0; r < count; r++) FOUR(t->through + t->given[n + r] * WIDE + at) = sum[r];
}

/* T = Z R^-1, through which bounds and rows are seen: v = s + T y */
static void see_basis(wbc_tick *t) {
    for (int at = 0; at < THIN; at += 4) {
        for (int a = 0; a < t->width; a++)
            FOUR(t->through + t->left[a] * WIDE + at) = EACH(dof_scale[t->left[a]]) * GIVEN_FOUR(t->reduced_inverse + a * WIDE + at);
        int n = 0;
        for (; n + 4 <= t->reduced; n += 4) some_seen(t, n, 4, at);
        for (; n < t->reduced; n++) some_seen(t, n, 1, at);
    }
}

#endif
