/* Rows of linkages that depend on each other wherever loops are closed, and nearly where they are not: of each linkage as many take
 * part in a tick as are independent at closed configurations, those that are most so here. The others then hold, too. */
#ifndef WBC_SPARE_H
#define WBC_SPARE_H

#include "settings.h"

/* The row, of `count` of a linkage, and the variable whose entry is the largest; 0 where all are 0 */
INLINE int largest_entry(const double *rows, const int *taken, int count, int *row, int *column) {
    double most = 0.0;
    for (int r = 0; r < count; r++)
        for (int j = 0; !taken[r] && j < NV; j++) {
            if (fabs(rows[r * NV + j]) <= most) continue;
            most = fabs(rows[r * NV + j]);
            *row = r;
            *column = j;
        }
    return most > 0.0;
}

/* Gauss' elimination with the largest entries as pivots, in units of rows and variables, says which rows those are */
static void choose_rows(wbc_tick *t, int first, int count, int held) {
    double rows[count * NV];
    int taken[count], row, column;
    memset(rows, 0, sizeof rows);
    for (int r = 0; r < count; r++) {
        const int k = spare_row[first + r];
        taken[r] = 0;
        t->left_out[k] = 1;
        for (int e = a_start[k]; e < a_end[k]; e++) rows[r * NV + a_col[e]] = t->at[e] * dof_scale[a_col[e]] / row_scale[k];
    }
    /* Rows that are no numbers stay, and the tick brakes */
    if (!all_finite(rows, count * NV))
        for (int r = 0; r < count; r++) t->left_out[spare_row[first + r]] = 0;
    for (int n = 0; n < held && largest_entry(rows, taken, count, &row, &column); n++) {
        const double *pivot = rows + row * NV;
        taken[row] = 1;
        t->left_out[spare_row[first + row]] = 0;
        for (int r = 0; r < count; r++) {
            const double share = rows[r * NV + column] / pivot[column];
            for (int j = 0; !taken[r] && j < NV; j++) rows[r * NV + j] -= share * pivot[j];
        }
    }
}

#endif
