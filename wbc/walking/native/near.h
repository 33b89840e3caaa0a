/* Whether two arms are too near to each other: capsules about O N, S E, E W and W H, as planner/grips/conflicts.py. */
#ifndef WBC_WALKING_NEAR_H
#define WBC_WALKING_NEAR_H

#include "arm.h"
#include "segments.h"

enum { LINKS = 4 };
static const int BEGINS[LINKS] = { 0, 2, 3, 4 }, ENDS[LINKS] = { 1, 3, 4, 5 };

/* `least`, and `more`: of every pair of links but that of the two necks, row by row. */
static int near(const double (*one)[3], const double (*other)[3], const double *least, double more)
{
    double middle[2][LINKS][3], half[2][LINKS];
    for (int side = 0; side < 2; ++side)
        for (int k = 0; k < LINKS; ++k) {
            const double *a = (side ? other : one)[BEGINS[k]], *b = (side ? other : one)[ENDS[k]];
            double span[3];
            for (int i = 0; i < 3; ++i) {
                middle[side][k][i] = 0.5 * (a[i] + b[i]);
                span[i] = b[i] - a[i];
            }
            half[side][k] = 0.5 * sqrt(dot(span, span));
        }
    for (int k = 1; k < LINKS * LINKS; ++k) {
        const int i = k / LINKS, j = k % LINKS;
        const double reach = half[0][i] + half[1][j] + least[k - 1] + more;
        double gap[3];
        for (int x = 0; x < 3; ++x)
            gap[x] = middle[0][i][x] - middle[1][j][x];
        /* Capsules whose middles are far apart need no closer look */
        if (dot(gap, gap) >= reach * reach)
            continue;
        if (segment_distance(one[BEGINS[i]], one[ENDS[i]], other[BEGINS[j]], other[ENDS[j]]) < least[k - 1] + more)
            return 1;
    }
    return 0;
}

#endif
