/* The fastest law of time along a path, see fastest() of wbc/climb/time_law.py. */
#ifndef WBC_CLIMB_TIME_LAW_H
#define WBC_CLIMB_TIME_LAW_H
#include <math.h>
#include <stdlib.h>

/* Rows of one interval: -below <= u + lean x <= above; those without inertia: felt x <= 1 */
typedef struct { double lean, above, below; } law_row_t;

/* x of n points of the grid s; a and b: n x rows, of which the last `sided` bind above alone. 0: no memory */
int wbc_fastest(long n, int rows, int sided, const double *s, const double *a, const double *b, const double *squared,
                       double *x) {
    const int both = rows - sided, all = 2 * rows;
    law_row_t *row = malloc(((size_t)(n - 1) * all + 1) * sizeof *row);
    double *high = malloc((size_t)n * sizeof *high), largest = 0.0;
    if (!row || !high) return free(row), free(high), 0;
    for (long k = 0; k + 1 < n; k++)
        for (int j = 0; j < rows; j++) {
            const long next = (k + 1) * rows + j;
            largest = fmax(largest, fmax(fabs(a[k * rows + j]), fabs(a[next] + 2.0 * (s[k + 1] - s[k]) * b[next])));
        }
    high[n - 1] = 0.0;
    for (long k = n - 2; k >= 0; k--) {
        law_row_t *r = row + k * all;
        const double span = s[k + 1] - s[k], next = 0.5 / span;
        double most = squared[k];
        for (int j = 0; j < all; j++) {
            const int of = j % rows;
            const long at = (j < rows ? k : k + 1) * rows + of;
            /* At the end of an interval the square of the speed is x + 2 u span */
            const double inertia = j < rows ? a[at] : a[at] + 2.0 * span * b[at];
            if (fabs(inertia) <= 1e-9 * largest) {
                r[j] = (law_row_t){0.0, INFINITY, INFINITY};
                most = fmin(most, 1.0 / fmax(of < both ? fabs(b[at]) : b[at], 1e-300));
                continue;
            }
            const double width = 1.0 / fabs(inertia);
            r[j].lean = b[at] / inertia;
            r[j].above = of < both || inertia > 0.0 ? width : INFINITY;
            r[j].below = of < both || inertia < 0.0 ? width : INFINITY;
        }
        /* Two rows leave a u while the one is not below where the other is above */
        for (int i = 0; i < all; i++)
            for (int j = 0; j < all; j++) {
                const double over = r[i].lean - r[j].lean;
                if (over > 0.0 && r[i].above + r[j].below < most * over) most = (r[i].above + r[j].below) / over;
            }
        for (int j = 0; j < all; j++) {
            const double stop = r[j].lean - next;
            if (stop > 0.0) most = fmin(most, r[j].above / stop);
            if (stop < 0.0) most = fmin(most, (high[k + 1] * next + r[j].below) / -stop);
        }
        high[k] = most;
    }
    x[0] = 0.0;
    for (long k = 0; k + 1 < n; k++) {
        double up = INFINITY;
        for (int j = 0; j < all; j++) up = fmin(up, row[k * all + j].above - row[k * all + j].lean * x[k]);
        x[k + 1] = fmin(fmax(x[k] + 2.0 * (s[k + 1] - s[k]) * up, 0.0), high[k + 1]);
    }
    x[n - 1] = 0.0;
    free(row), free(high);
    return 1;
}
#endif
