/* Bases that roll: x, y and angle of the middle of their axle are the first three coordinates. They turn, or they drive straight. */
#pragma once

#include "plan.h"

/* A motion may lead sideways by so much of it: the rows hold within 1e-6 */
#define SIDEWAYS 1e-7
/* Pieces of the way of a base: a turn, a drive and a turn */
#define WAY 3

/* How far x and y of a base are apart */
static double rolled_by(const double *x, const double *y) { return hypot(y[0] - x[0], y[1] - x[1]); }

/* Whether straight from x to y is one of these */
static int rolls(const plan_t *p, const double *x, const double *y) {
    if (!p->rolls) return 1;
    const double dx = y[0] - x[0], dy = y[1] - x[1], turn = fabs(y[2] - x[2]), way = hypot(dx, dy), most = SIDEWAYS * (way + turn);
    if (p->rolls > 1) return fmin(way, turn) <= most;
    const double one = p->heading + x[2], other = p->heading + y[2];
    return fmax(fabs(cos(one) * dy - sin(one) * dx), fabs(cos(other) * dy - sin(other) * dx)) <= most;
}

/* Ends of the straight pieces of the way from x to y: how many. The base turns to where it drives to, forwards or backwards, and there
 * to where it shall look to; other coordinates go evenly meanwhile */
static int steer(const plan_t *p, const double *x, const double *y, double *ends) {
    copy_x(p, y, ends);
    if (rolls(p, x, y)) return 1;
    const double way = atan2(y[1] - x[1], y[0] - x[0]) - p->heading, middle = 0.5 * (x[2] + y[2]);
    const double along = p->rolls > 1 ? x[2] : way + M_PI * round((middle - way) / M_PI);
    const double parts[WAY] = {sqrt(p->weight[2]) * fabs(along - x[2]), sqrt(p->weight[0]) * hypot(y[1] - x[1], y[0] - x[0]),
                               sqrt(p->weight[2]) * fabs(y[2] - along)};
    const double whole = parts[0] + parts[1] + parts[2];
    double gone = 0.0;
    int count = 0;
    for (int k = 0; k < WAY; k++) {
        if (parts[k] <= SIDEWAYS * SIDEWAYS) continue;
        gone += parts[k];
        double *end = ends + p->n * count++;
        along_x(p, x, y, gone / whole, end);
        memcpy(end, k ? y : x, 2 * sizeof *end);
        end[2] = k < 2 ? along : y[2];
    }
    copy_x(p, y, ends + p->n * (count - 1));
    return count;
}

/* y near x becomes one that is reached from it by a turn, or by a drive */
static void roll_near(const plan_t *p, const double *x, double *y, int turns) {
    if (!p->rolls) return;
    const double c = cos(p->heading + x[2]), s = sin(p->heading + x[2]), way = turns ? 0.0 : c * (y[0] - x[0]) + s * (y[1] - x[1]);
    y[0] = x[0] + way * c, y[1] = x[1] + way * s;
    if (!turns) y[2] = x[2];
}
