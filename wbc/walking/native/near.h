/* Whether two arms are too near to each other: capsules about O N, S E, E W and W H, as planner/grips/conflicts.py. */
#ifndef WBC_WALKING_NEAR_H
#define WBC_WALKING_NEAR_H

#include "arm.h"

enum { LINKS = 4 };
static const int BEGINS[LINKS] = { 0, 2, 3, 4 }, ENDS[LINKS] = { 1, 3, 4, 5 };

static double clipped(double x)
{
    return x < 0.0 ? 0.0 : x > 1.0 ? 1.0 : x;
}

/* Square of the distance between segments a-b and c-d: clamped parameters of the nearest points. */
static double squared_distance(const double *a, const double *b, const double *c, const double *d)
{
    double u[3], v[3], w[3], gap[3], s = 0.0, t = 0.0;
    for (int i = 0; i < 3; ++i) {
        u[i] = b[i] - a[i];
        v[i] = d[i] - c[i];
        w[i] = a[i] - c[i];
    }
    const double uu = dot(u, u), vv = dot(v, v), uv = dot(u, v), uw = dot(u, w), vw = dot(v, w);
    const double det = uu * vv - uv * uv;
    if (det > 1e-12 * uu * vv)
        s = clipped((uv * vw - vv * uw) / det);
    if (vv > 0.0)
        t = (uv * s + vw) / vv;
    const double on = clipped(t);
    if (on != t || vv <= 0.0)
        s = uu > 0.0 ? clipped((uv * on - uw) / uu) : 0.0;
    for (int i = 0; i < 3; ++i)
        gap[i] = w[i] + s * u[i] - on * v[i];
    return dot(gap, gap);
}

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
        if (sqrt(squared_distance(one[BEGINS[i]], one[ENDS[i]], other[BEGINS[j]], other[ENDS[j]])) < least[k - 1] + more)
            return 1;
    }
    return 0;
}

#endif
