/* Angles that put a contact frame where it is wanted: damped Newton within limits, from seeds of a table of samples. */
#ifndef WBC_REACH_H
#define WBC_REACH_H

#include "limb.h"

/* Iterations of Newton; each roughly doubles the digits once it is near */
#define ITERATIONS 30
/* Share of a limb's length within which a contact is where it is wanted */
#define EXACT 1e-9
/* Greatest turn or shift of an iteration [rad, m] */
#define LONGEST_STEP 0.8
/* Seeds of the table that are tried at most */
#define TRIES 80
/* Postures nearer to each other than this are one [rad, m] */
#define DISTINCT 0.05

/* From `angle` on, in place; whether it is reached. The damping is a share of the error's square, which keeps the order of
 * Newton; angles at a limit that a step would cross take no part in it */
static int reach_from(const limb_t *l, const double *base, const double *wanted, double *angle) {
    const int n = l->angles, m = l->rows;
    placed_t placed;
    double E[6][6], r[6], A[6][MOST_ANGLES], step[MOST_ANGLES], before = INFINITY;
    char out[MOST_ANGLES];
    for (int k = 0; k < n; k++) angle[k] = fmin(fmax(angle[k], l->lower[k]), l->upper[k]);
    for (int iteration = 0; iteration < ITERATIONS; iteration++) {
        place_steps(l, base, angle, &placed);
        contact_rows(l, &placed, wanted, r, E, A);
        double size = 0.0;
        for (int i = 0; i < m; i++) size += r[i] * r[i], r[i] = -r[i];
        if (size <= EXACT * EXACT * l->length * l->length) return 1;
        if (iteration > 12 && size > 0.25 * before) return 0;
        if (iteration % 6 == 0) before = size;
        const double longest = damped_step(l, m, A, r, 0.05 * size + 1e-14 * l->length * l->length, 0, angle, 4, step, out);
        if (longest < 0.0) return 0;
        const double by = longest > LONGEST_STEP ? LONGEST_STEP / longest : 1.0;
        double moved = 0.0;
        for (int k = 0; k < n; k++) {
            const double next = out[k] ? angle[k] : fmin(fmax(angle[k] + by * step[k], l->lower[k]), l->upper[k]);
            moved = fmax(moved, fabs(next - angle[k])), angle[k] = next;
        }
        if (moved < 1e-13) return 0;
    }
    return 0;
}

/* Brings a contact to each of n wanted poses in the body's frame, from the angles of each or else from those that the one before
 * came to, in place; `rows`: of the pose that count at most. How many were reached, the first ones */
long wbc_reach_each(const limb_t *l, long n, const double *wanted, int rows, double *angle) {
    const size_t size = (size_t)l->angles * sizeof *angle;
    limb_t part = *l;
    double now[MOST_ANGLES];
    if (rows < part.rows) part.rows = rows;
    for (long k = 0; k < n; k++) {
        double *at = angle + k * l->angles;
        memcpy(now, at, size);
        if (!reach_from(&part, AT_BODY, wanted + 12 * k, now)) {
            if (!k) return 0;
            memcpy(now, at - l->angles, size);
            if (!reach_from(&part, AT_BODY, wanted + 12 * k, now)) return k;
        }
        memcpy(at, now, size);
    }
    return n;
}

/* Numbers of the samples, at most TRIES, nearest to a wanted pose in the body's frame, nearest first; how many */
static int nearest_samples(const limb_t *l, const double *wanted, int most, int *out) {
    double score[TRIES];
    int count = 0;
    for (int k = 0; k < l->samples; k++) {
        const double *at = l->touch + 12 * k;
        double by[3], far = 0.0, turned = 0.0;
        minus3(at + 9, wanted + 9, by);
        far = dot3(by, by);
        if (count == most && far >= score[most - 1]) continue;
        if (l->rows > 3) turned += 1.0 - at[2] * wanted[2] - at[5] * wanted[5] - at[8] * wanted[8];
        if (l->rows > 5) turned += 1.0 - at[0] * wanted[0] - at[3] * wanted[3] - at[6] * wanted[6];
        far += 0.1 * l->length * l->length * turned;
        if (count == most && far >= score[most - 1]) continue;
        int place = count < most ? count++ : most - 1;
        for (; place > 0 && score[place - 1] > far; place--) score[place] = score[place - 1], out[place] = out[place - 1];
        score[place] = far, out[place] = k;
    }
    return count;
}

/* Whether a posture is apart from `count` known ones, `by` numbers from one to the next */
static int is_new(const limb_t *l, int count, const double *known, long by, const double *angle) {
    for (int j = 0; j < count; j++) {
        double apart = 0.0;
        for (int i = 0; i < l->angles; i++) apart = fmax(apart, fabs(known[j * by + i] - angle[i]));
        if (!(apart > DISTINCT)) return 0;
    }
    return 1;
}

/* Postures at a wanted pose in the body's frame, `most` of them, apart from each other; how many. A seed comes first */
static int postures(const limb_t *l, const double *wanted, const double *seed, int most, double *out) {
    int nearest[TRIES], count = 0, first = seed ? -1 : 0, last = -1;
    double angle[MOST_ANGLES], by[3];
    const double at[3] = {l->step[0].place[9], l->step[0].place[10], l->step[0].place[11]};
    minus3(wanted + 9, at, by);
    if (dot3(by, by) > l->length * l->length) return 0;
    for (int k = first; count < most; k++) {
        if (k == 0) last = nearest_samples(l, wanted, TRIES, nearest);
        if (k >= 0 && k >= last) break;
        memcpy(angle, k < 0 ? seed : l->sample + (size_t)nearest[k] * l->angles, (size_t)l->angles * sizeof *angle);
        if (!reach_from(l, AT_BODY, wanted, angle)) continue;
        if (is_new(l, count, out, l->angles, angle)) memcpy(out + (size_t)count++ * l->angles, angle, (size_t)l->angles * sizeof *angle);
    }
    return count;
}

#endif
