/* The equality rows E v = b of a robot with loops are taken out of its QP: v = s + Z z with as many z as motions are left.
 *
 * In v / dof_scale each row gives one variable, and none of the others (Gauss and Jordan). The steps are kept: they are the inverse P
 * of the columns that were given, and its transpose, which multipliers come from. Rows that nearly depend on each other are left to
 * the factor that has all variables. docs/solvers.md#loops */
#ifndef WBC_REDUCED_H
#define WBC_REDUCED_H

#include "factor.h"

/* Room for the variables that are left, in groups of four */
#define THIN ((NV - (REDUCED < NV ? REDUCED : NV) + 3) / 4 * 4)

INLINE double thin_dot(const double *x, const double *y) {
    four sum = {0};
    for (int at = 0; at < THIN; at += 4) sum = MADD(GIVEN_FOUR(x + at), GIVEN_FOUR(y + at), sum);
    return SUM_OF_FOUR(sum);
}

INLINE void thin_add(double *out, const double *in, double f) {
    const four each = EACH(f);
    for (int at = 0; at < THIN; at += 4) FOUR(out + at) = MADD(each, GIVEN_FOUR(in + at), GIVEN_FOUR(out + at));
}

/* The equality rows, of length one, as columns of WIDE numbers; 0 where there are none, or variables are fixed besides */
static int equality_rows(wbc_tick *t) {
    int count = 0;
    for (int i = 0; i < NV; i++)
        if (t->low[i] == t->high[i]) return 0;
    for (int i = 0; i < NV * WIDE; i += 4) FOUR(t->equal + i) = (four){0};
    for (int k = 0; k < MC; k++) {
        double square = 0.0;
        t->strength[k] = 0.0;
        if (t->low[NV + k] != t->high[NV + k]) continue;
        if (count == NV) return 0;
        for (int e = a_start[k]; e < a_end[k]; e++) {
            const double a = t->equal[a_col[e] * WIDE + count] = t->at[e] * dof_scale[a_col[e]];
            square += a * a;
        }
        if (!(square > DEAD)) return 0;
        const double scale = 1.0 / sqrt(square);
        for (int e = a_start[k]; e < a_end[k]; e++) t->equal[a_col[e] * WIDE + count] *= scale;
        t->equal_scale[count] = scale;
        t->equal_row[count++] = k;
    }
    return count;
}

/* Variable j is given by the row, of those that give none yet (1 in `open`), whose entry is the largest; 0 where that is below
 * `least`. Columns of the variables that are not given lose their entry there; its own becomes the step of P, which takes from e
 * its multiple by the entry of that row. */
INLINE int give(wbc_tick *t, int j, int count, int step, double least, double *open) {
    double *own = t->equal + j * WIDE;
    four most = {0};
    int which = 0;
    for (int i = 0; i < count; i += 4) RAISE_FOUR(most, SIZE_OF_FOUR(GIVEN_FOUR(own + i)) * GIVEN_FOUR(open + i));
    const double largest = larger(larger(most[0], most[2]), larger(most[1], most[3]));
    if (!(largest >= least)) return 0;
    while (fabs(own[which]) * open[which] != largest) which++;
    const double inverse = 1.0 / own[which];
    t->is_given[j] = 1;
    own[which] -= 1.0;
    for (int i = 0; i < count; i += 4) FOUR(own + i) *= EACH(inverse);
    for (int c = 0; c < NV; c++) {
        double *column = t->equal + c * WIDE;
        const double f = column[which];
        if (t->is_given[c] || f == 0.0) continue;
        for (int i = 0; i < count; i += 4) FOUR(column + i) = MADD(EACH(-f), GIVEN_FOUR(own + i), GIVEN_FOUR(column + i));
    }
    open[which] = 0.0;
    t->given[which] = j;
    t->giver[step] = which;
    return 1;
}

/* Variables for all of `count` rows; 0 where the rows depend on each other */
INLINE int give_all(wbc_tick *t, int count) {
    double open[WIDE];
    int step = 0;
    for (int i = 0; i < WIDE; i++) open[i] = i < count;
    for (int j = 0; j < NV; j++) t->is_given[j] = 0;
    for (double least = CLEAR_PIVOT; least >= PIVOT && step < count; least *= PIVOT / CLEAR_PIVOT)
        for (int j = 0; j < NV && step < count; j++)
            if (!t->is_given[j]) step += give(t, j, count, step, least, open);
    return step == count;
}

/* Z and P of the rows at hand; 0 where they depend on each other, or are none. Variables are left to be free as late as they can be:
 * pivots of Z'HZ are those of H with firm rows, see find_pivots. */
static int eliminate(wbc_tick *t) {
    const int count = t->reduced = equality_rows(t);
    int left = 0;
    /* The usual number is known to the compiler */
    const int ok = count == REDUCED ? give_all(t, REDUCED) : give_all(t, count);
    for (int j = 0; ok && j < NV; j++)
        if (!t->is_given[j]) t->left[left++] = j;
    t->width = left;
    if (!ok || left > THIN) return t->reduced = 0;
    for (int i = 0; i < NV * WIDE; i += WIDE)
        for (int at = 0; at < THIN; at += 4) FOUR(t->basis + i + at) = (four){0};
    for (int c = 0; c < left; c++) {
        const double *column = t->equal + t->left[c] * WIDE;
        t->basis[t->left[c] * WIDE + c] = dof_scale[t->left[c]];
        for (int i = 0; i < count; i++) t->basis[t->given[i] * WIDE + c] = -dof_scale[t->given[i]] * column[i];
    }
    return count;
}

/* Step k of P: a column, and in it the row whose variable it gives */
#define STEP(t, which) ((t)->equal + (t)->given[which] * WIDE)

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

/* e of rows per row of length one, 0 behind the last */
static void scale_rows(const wbc_tick *t, double *e) {
    for (int k = 0; k < t->reduced; k++) e[k] *= t->equal_scale[k];
    for (int k = t->reduced; k < WIDE; k++) e[k] = 0.0;
}

static void spread_given(const wbc_tick *t, const double *e, double *x) {
    for (int i = 0; i < WIDE; i++) x[i] = 0.0;
    for (int k = 0; k < t->reduced; k++) x[t->given[k]] = e[k] * dof_scale[t->given[k]];
}

/* x = P e: the variables that were given, for rows that are e, the others 0; `e`, of WIDE numbers, is changed */
static void by_rows(const wbc_tick *t, double *e, double *x) {
    scale_rows(t, e);
    for (int k = 0; k < t->reduced; k++) {
        const double *step = STEP(t, t->giver[k]);
        const four each = EACH(-e[t->giver[k]]);
        EACH_ROW_GROUP(t, i) FOUR(e + i) = MADD(each, GIVEN_FOUR(step + i), GIVEN_FOUR(e + i));
    }
    spread_given(t, e, x);
}

/* The same of sizes: no |P e| is larger where |e| are at most these */
static void size_by_rows(const wbc_tick *t, double *e, double *x) {
    scale_rows(t, e);
    for (int k = 0; k < t->reduced; k++) {
        const double *step = STEP(t, t->giver[k]);
        const four each = EACH(e[t->giver[k]]);
        EACH_ROW_GROUP(t, i) FOUR(e + i) = MADD(each, SIZE_OF_FOUR(GIVEN_FOUR(step + i)), GIVEN_FOUR(e + i));
    }
    spread_given(t, e, x);
}

/* Multipliers, of WIDE numbers, of the rows that leave nothing of a force `r` on the variables that were given: r + E' lambda = 0
 * there */
static void multipliers_of(const wbc_tick *t, const double *r, double *lambda) {
    for (int k = 0; k < WIDE; k++) lambda[k] = k < t->reduced ? -r[t->given[k]] * dof_scale[t->given[k]] : 0.0;
    for (int k = t->reduced - 1; k >= 0; k--) {
        const int which = t->giver[k], at = which & 3;
        const double *step = STEP(t, which);
        double *place = lambda + (which & ~3);
        four sum = {0};
        EACH_ROW_GROUP(t, i) sum = MADD(GIVEN_FOUR(step + i), GIVEN_FOUR(lambda + i), sum);
        /* Four at once: what is read next is not waited for */
        FOUR(place) -= (four)((four_bits)EACH(SUM_OF_FOUR(sum)) & ((four_bits){0, 1, 2, 3} == (four_bits){at, at, at, at}));
    }
    for (int k = 0; k < t->reduced; k++) lambda[k] *= t->equal_scale[k];
}

/* out = H x, of whose symmetric matrix the upper triangle is stored, with zeros left of the diagonal in its group of 8 */
static void times_hessian(const wbc_tick *t, const double *x, double *out) {
    for (int i = 0; i < WIDE; i += 4) FOUR(out + i) = (four){0};
    for (int i = 0; i < NV; i++) {
        const double *row = t->H + i * WIDE, own = x[i] * row[i];
        four sum = {0};
        for (int at = i & ~3; at < WIDE; at += 4) {
            const four h = GIVEN_FOUR(row + at);
            sum = MADD(h, GIVEN_FOUR(x + at), sum);
            FOUR(out + at) = MADD(h, EACH(x[i]), GIVEN_FOUR(out + at));
        }
        out[i] += SUM_OF_FOUR(sum) - own;
    }
}

/* The factor of Z'(H + more / dof_scale^2) Z = R'R; 0 where it is not positive definite */
static int factor_reduced(wbc_tick *t, double more) {
    double *G = t->reduced_R;
    t->stiffness = 0.0;
    for (int i = 0; i < NV; i++) t->stiffness = larger(t->stiffness, t->H[i * WIDE + i] * dof_scale[i] * dof_scale[i]);
    for (int at = 0; at < THIN; at += 4) {
        const double *basis = t->basis + at;
        for (int i = 0; i < NV; i++) {
            four sum = EACH(more / (dof_scale[i] * dof_scale[i])) * GIVEN_FOUR(basis + i * WIDE), other = {0};
            for (int j = 0; j < i; j++) other = MADD(EACH(t->H[j * WIDE + i]), GIVEN_FOUR(basis + j * WIDE), other);
            for (int j = i; j < NV; j++) sum = MADD(EACH(t->H[i * WIDE + j]), GIVEN_FOUR(basis + j * WIDE), sum);
            FOUR(t->product_of_basis + i * WIDE + at) = sum + other;
        }
    }
    for (int a = 0; a < t->width; a++)
        for (int at = a & ~3; at < THIN; at += 4) {
            /* The variable that is left is itself */
            four sum = EACH(dof_scale[t->left[a]]) * GIVEN_FOUR(t->product_of_basis + t->left[a] * WIDE + at), other = {0};
            for (int n = 0; n < t->reduced; n++) {
                const int i = t->given[n] * WIDE;
                other = MADD(EACH(t->basis[i + a]), GIVEN_FOUR(t->product_of_basis + i + at), other);
            }
            FOUR(G + a * WIDE + at) = sum + other;
        }
    for (int a = 0; a < t->width; a++) {
        double *row = G + a * WIDE;
        if (!(row[a] > 0.0)) return 0;
        const double inverse = 1.0 / sqrt(row[a]);
        t->reduced_inverse[a] = inverse;
        for (int c = 0; c < THIN; c++) row[c] = c < a ? 0.0 : row[c] * inverse;
        for (int b = a + 1; b < t->width; b++)
            if (row[b] != 0.0) thin_add(G + b * WIDE, row, -row[b]);
    }
    return 1;
}

/* y = R^-T y */
static void reduced_transposed(const wbc_tick *t, double *y) {
    for (int a = 0; a < t->width; a++) {
        const double own = y[a] * t->reduced_inverse[a];
        thin_add(y, t->reduced_R + a * WIDE, -own);
        y[a] = own;
    }
}

/* y = R^-T Z'(H x + b), where x is 0 but for the variables that were given */
static void reduced_forces(const wbc_tick *t, const double *x, const double *b, double *y) {
    for (int at = 0; at < THIN; at += 4) FOUR(y + at) = (four){0};
    for (int k = 0; k < t->reduced; k++) thin_add(y, t->product_of_basis + t->given[k] * WIDE, x[t->given[k]]);
    for (int i = 0; i < NV; i++) thin_add(y, t->basis + i * WIDE, b[i]);
    reduced_transposed(t, y);
}

/* x = Z (Z'HZ)^-1 Z'b */
static void solve_reduced(const wbc_tick *t, const double *b, double *x) {
    double z[WIDE];
    for (int at = 0; at < THIN; at += 4) FOUR(z + at) = (four){0};
    for (int i = 0; i < NV; i++) thin_add(z, t->basis + i * WIDE, b[i]);
    reduced_transposed(t, z);
    for (int a = t->width - 1; a >= 0; a--) {
        double sum = z[a];
        for (int c = a + 1; c < t->width; c++) sum -= t->reduced_R[a * WIDE + c] * z[c];
        z[a] = sum * t->reduced_inverse[a];
    }
    for (int i = 0; i < WIDE; i++) x[i] = i < NV ? thin_dot(t->basis + i * WIDE, z) : 0.0;
}

/* T = Z R^-1, through which bounds and rows are seen: v = s + T y */
static void see_basis(wbc_tick *t) {
    for (int i = 0; i < NV; i++) {
        double *row = t->through + i * WIDE;
        for (int at = 0; at < THIN; at += 4) FOUR(row + at) = GIVEN_FOUR(t->basis + i * WIDE + at);
        for (int a = 0; a < t->width; a++) {
            if (row[a] == 0.0) continue;
            const double own = row[a] * t->reduced_inverse[a];
            thin_add(row, t->reduced_R + a * WIDE, -own);
            row[a] = own;
        }
    }
}

#endif
