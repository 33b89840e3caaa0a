/* Limbs that go from one foothold to another while the body goes its way: the contact's place on a curve, joints as near as that
 * lets them be to angles that go evenly from one posture to the other. */
#ifndef WBC_SWINGS_H
#define WBC_SWINGS_H

#include "limb.h"

/* Iterations for each instant; those before begin from the correction of the instant before */
#define SWING_ITERATIONS 12
/* Shares of a limb's length and angles within which an instant is found */
#define SWING_NEAR 1e-4
#define SWING_SETTLED 1e-3
/* How far a contact may be off its curve where joints do not let it there, as a share of its height */
#define LOOSE 0.3
/* Damping, as a share of the limb's squared length */
#define SWING_DAMPED 1e-5
/* Part of a swing in which a contact comes to its height, and comes down from it */
#define COMING_UP 0.4

/* From 0 to 1 with even accelerations */
static double risen(double x) {
    x = fmin(fmax(x, 0.0), 1.0);
    return x < 0.5 ? 2.0 * x * x : 1.0 - 2.0 * (1.0 - x) * (1.0 - x);
}

/* Angles nearest to some that put a contact within `off` of a place in the body's frame, along `rows` directions there, from those in
 * `angle` on; whether there are any */
static int reach_place(const limb_t *l, const double *wanted, int rows, const double (*along)[3], double off, const double *near,
                       double *angle) {
    const int n = l->angles;
    const double size = l->length * l->length;
    placed_t placed;
    double J[MOST_ANGLES][6], A[3][MOST_ANGLES];
    for (int k = 0; k < n; k++) angle[k] = fmin(fmax(angle[k], l->lower[k]), l->upper[k]);
    for (int round = 0; round < SWING_ITERATIONS; round++) {
        double by[3], r[3], away = 0.0, step[MOST_ANGLES];
        char out[MOST_ANGLES];
        place_steps(l, AT_BODY, angle, &placed);
        minus3(wanted, placed.tip + 9, by);
        limb_jacobian(l, &placed, J);
        for (int i = 0; i < rows; i++) {
            r[i] = dot3(along[i], by);
            away += r[i] * r[i];
            for (int k = 0; k < n; k++) A[i][k] = dot3(along[i], J[k]);
        }
        const double longest = damped_step(l, rows, A, r, SWING_DAMPED * size, near, angle, -1, step, out);
        if (longest < 0.0) return 0;
        away = sqrt(away);
        if (away < SWING_NEAR * l->length && longest < SWING_SETTLED) return 1;
        if (round == SWING_ITERATIONS - 1) return away < off;
        const double scale = longest > 0.5 ? 0.5 / longest : 1.0;
        for (int k = 0; k < n; k++) angle[k] = fmin(fmax(angle[k] + scale * step[k], l->lower[k]), l->upper[k]);
    }
    return 0;
}

/* A swing over `count` intervals of instants, looked at in `parts` of them: angles there, and which instants they are. `body`: poses at
 * the instants; `from`, `onto`: poses of footholds; `ends`: angles and rates at lift, then at landing; `most`: rates, then their changes,
 * all by instants; `straight`: whether the contact goes straight over, or keeps its height alone. How many times longer it should be; INFINITY where there is none */
static double swing(const limb_t *l, int count, int parts, const double *body, const double *from, const double *onto,
                    const double *ends, double over, int straight, const double *most, double *angle, int *at) {
    const int n = l->angles;
    const double *a = ends, *first = ends + n, *b = ends + 2 * n, *last = ends + 3 * n;
    double before[MOST_ANGLES] = {0}, used = 0.0, rate[MOST_ANGLES], gap = 1.0;
    memcpy(rate, first, (size_t)n * sizeof *rate);
    for (int j = 0; j <= parts; j++) {
        /* Of few parts those near the footholds are shorter */
        const double part = (double)j / parts, even_part = parts < count ? 0.5 * part + 0.25 * (1.0 - cos(M_PI * part)) : part;
        const int k = (int)lround(count * even_part);
        const double x = (double)k / count, even = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x);
        const double early = x - x * x * x * (6.0 - 8.0 * x + 3.0 * x * x), late = x * x * x * (-4.0 + 7.0 * x - 3.0 * x * x);
        const double up = over * fmin(risen(x / COMING_UP), risen((1.0 - x) / COMING_UP)), *at_body = body + 12 * k;
        double near[MOST_ANGLES], normal[3], place[3], wanted[3], *now = angle + (long)j * n;
        for (int i = 0; i < n; i++) near[i] = a[i] + (b[i] - a[i]) * even + count * (first[i] * early + last[i] * late);
        for (int i = 0; i < 3; i++) normal[i] = (1.0 - even) * from[3 * i + 2] + even * onto[3 * i + 2];
        const double size = sqrt(dot3(normal, normal));
        for (int i = 0; i < 3; i++) {
            normal[i] = size > 0.1 ? normal[i] / size : from[3 * i + 2];
            place[i] = (1.0 - even) * from[9 + i] + even * onto[9 + i] + up * normal[i] - at_body[9 + i];
        }
        double along[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
        turn_back(at_body, place, wanted);
        if (!straight) turn_back(at_body, normal, along[0]);
        at[j] = k;
        if (j == 0 || j == parts) {
            memcpy(now, j ? b : a, (size_t)n * sizeof *now);
        } else {
            for (int i = 0; i < n; i++) now[i] = near[i] + before[i];
            if (!reach_place(l, wanted, straight ? 3 : 1, (const double (*)[3])along, SWING_NEAR * l->length + LOOSE * up, near, now)) return INFINITY;
            for (int i = 0; i < n; i++) before[i] = now[i] - near[i];
        }
        if (j == 0) continue;
        const double took = k - at[j - 1];
        for (int i = 0; i < n; i++) {
            const double mean = (now[i] - (now - n)[i]) / took;
            used = fmax(used, fabs(mean) / most[i]);
            used = fmax(used, sqrt(fabs(mean - rate[i]) / (0.5 * (took + (j > 1 ? gap : 0.0)) * most[n + i])));
            if (j == parts) used = fmax(used, sqrt(fabs(last[i] - mean) / (0.5 * took * most[n + i])));
            rate[i] = mean;
        }
        gap = took;
    }
    return used;
}

#endif
