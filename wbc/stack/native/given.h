/* Equality rows as columns of numbers, and the variables that they give: see reduced.h. */
#ifndef WBC_GIVEN_H
#define WBC_GIVEN_H

#include "factor.h"

/* Room for the variables that are left, in groups of four */
#define THIN ((NV - (REDUCED < NV ? REDUCED : NV) + 3) / 4 * 4)

/* Which rows are equalities, and how many; 0 where variables are fixed besides */
static int find_equalities(wbc_tick *t) {
    int count = 0;
    for (int i = 0; i < NV; i++)
        if (t->low[i] == t->high[i]) return 0;
    for (int k = 0; k < MC; k++) {
        t->strength[k] = 0.0;
        if (t->low[NV + k] != t->high[NV + k]) continue;
        if (count == NV) return 0;
        t->equal_row[count++] = k;
    }
    return count;
}

/* The first `count` of them, of length one, as columns of WIDE numbers; 0 where one has no length */
INLINE int unit_rows(wbc_tick *t, int count) {
    double scale[WIDE] = {0};
    for (int j = 0; j < NV; j++)
        for (int i = 0; i < count; i += 4) FOUR(t->equal + j * WIDE + i) = (four){0};
    for (int n = 0; n < count; n++) {
        const int k = t->equal_row[n];
        double square = 0.0;
        for (int e = a_start[k]; e < a_end[k]; e++) {
            const double entry = t->equal[a_col[e] * WIDE + n] = t->at[e] * dof_scale[a_col[e]];
            square += entry * entry;
        }
        if (!(square > DEAD)) return 0;
        t->equal_scale[n] = scale[n] = 1.0 / sqrt(square);
    }
    for (int j = 0; j < NV; j++)
        for (int i = 0; i < count; i += 4) FOUR(t->equal + j * WIDE + i) *= GIVEN_FOUR(scale + i);
    return 1;
}

/* Variable j of `total` is given by the row, of those in `open`, whose entry is the largest; 0 where that is below `least`. Columns of
 * the other variables lose their entry there: those that are given are columns of P, and its own becomes one. */
INLINE int give(double *columns, int total, int j, int count, double least, double *open, int *given) {
    double *own = columns + j * WIDE, share[WIDE];
    four most = {0};
    four_bits where = {0};
    for (int i = 0; i < count; i += 4) {
        const four size = SIZE_OF_FOUR(GIVEN_FOUR(own + i)) * GIVEN_FOUR(open + i);
        const four_bits more = size > most;
        where = (PLACES(i) & more) | (where & ~more);
        RAISE_FOUR(most, size);
    }
    const double largest = larger(larger(most[0], most[2]), larger(most[1], most[3]));
    if (!(largest >= least)) return 0;
    int which = count;
    for (int r = 0; r < 4; r++) which = most[r] == largest && where[r] < which ? (int)where[r] : which;
    const double inverse = 1.0 / own[which];
    /* Groups of four are written whole: to read four numbers after one of them was written takes long */
    for (int i = 0; i < count; i += 4) {
        const four_bits here = PLACES(i) == (four_bits){which, which, which, which};
        const four one = (four)((four_bits)EACH(1.0) & here), part = (GIVEN_FOUR(own + i) - one) * EACH(-inverse);
        FOUR(share + i) = part;
        FOUR(own + i) = part + one;
        FOUR(open + i) = (four)((four_bits)GIVEN_FOUR(open + i) & ~here);
    }
    for (double *column = columns, *end = columns + total * WIDE; column < end; column += WIDE) {
        if (is_zero(column + which) || column == own) continue;
        const double f = column[which];
        for (int i = 0; i < count; i += 4) FOUR(column + i) = MADD(EACH(f), GIVEN_FOUR(share + i), GIVEN_FOUR(column + i));
    }
    given[which] = j;
    return 1;
}

/* Column k of P: by how much each variable that was given moves with row k, in the order of the rows that give them */
#define COLUMN(t, k) ((t)->equal + (t)->given[k] * WIDE)

#endif
