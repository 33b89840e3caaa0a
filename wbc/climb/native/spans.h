/* Limbs that hold while the body goes its way: postures that continue each other from instant to instant. */
#ifndef WBC_SPANS_H
#define WBC_SPANS_H

#include "reach.h"

/* Steps of a posture towards rest */
#define EASED 4
/* After so many samples from which a pose is not reached, as it is not from rest, it is taken to be out of reach */
#define HOPELESS 3

/* Follows a contact from one wanted pose to the next, `count` of them `by` apart in memory, from the posture in `angle`, which
 * is at the first one; writes a row of angles each. No joint may move by more than `step` between two. How many were reached */
static int follow_contact(const limb_t *l, int count, const double *wanted, int by, const double *step, double *angle) {
    const int n = l->angles, way = by > 0 ? 1 : -1;
    for (int k = 1; k < count; k++) {
        double *last = angle + (long)way * (k - 1) * n, *next = angle + (long)way * k * n, now[MOST_ANGLES];
        for (int i = 0; i < n; i++) now[i] = k > 1 ? 2.0 * last[i] - (last - way * n)[i] : last[i];
        if (!reach_from(l, AT_BODY, wanted + (long)by * k, now)) return k;
        for (int i = 0; i < n; i++)
            if (fabs(now[i] - last[i]) > step[i]) return k;
        memcpy(next, now, (size_t)n * sizeof *next);
    }
    return count;
}

/* Moves a posture that is at a wanted pose towards rest as far as the pose lets it, where a limb has more joints than rows */
static void ease_to_rest(const limb_t *l, const double *base, const double *wanted, double *angle) {
    const int n = l->angles, m = l->rows;
    placed_t placed;
    const double none[6] = {0};
    double E[6][6], r[6], A[6][MOST_ANGLES], next[MOST_ANGLES];
    char out[MOST_ANGLES];
    for (int round = 0; round < EASED && n > m; round++) {
        place_steps(l, base, angle, &placed);
        contact_rows(l, &placed, wanted, r, E, A);
        const double longest = damped_step(l, m, A, none, 1e-9 * l->length * l->length, l->rest, angle, 1, next, out);
        if (longest < 0.0) return;
        if (longest < 1e-3) return;
        for (int k = 0; k < n; k++) next[k] = angle[k] + fmin(1.0, LONGEST_STEP / longest) * next[k];
        if (!reach_from(l, base, wanted, next)) return;
        memcpy(angle, next, (size_t)n * sizeof *angle);
    }
}

/* Postures at instant `at` of `count` wanted poses, each followed both ways: rows of angles of all instants, and the first and
 * last that were reached. `start`: a posture to begin with, or 0 for rest and `tries` of the table. How many, `most` at most */
static int hold_spans(const limb_t *l, int count, const double *wanted, int at, const double *start, int tries, int most,
                      const double *step, double *angles, int *first, int *last) {
    const int n = l->angles;
    int nearest[TRIES], known = 0, spans = 0, reached = 0;
    double angle[MOST_ANGLES];
    for (int k = start ? -2 : -1; spans < most && k < (start ? -1 : tries); k++) {
        if (k == 0) known = nearest_samples(l, wanted + 12 * at, tries, nearest);
        if (k >= 0 && k >= known) break;
        memcpy(angle, k == -2 ? start : k < 0 ? l->rest : l->sample + (size_t)nearest[k] * n, (size_t)n * sizeof *angle);
        if (k >= HOPELESS && !reached) break;
        if (!reach_from(l, AT_BODY, wanted + 12 * at, angle)) continue;
        reached = 1;
        if (k > -2) ease_to_rest(l, AT_BODY, wanted + 12 * at, angle);
        if (!is_new(l, spans, angles + (long)at * n, (long)count * n, angle)) continue;
        double *row = angles + ((long)spans * count + at) * n;
        memcpy(row, angle, (size_t)n * sizeof *angle);
        last[spans] = at + follow_contact(l, count - at, wanted + 12 * at, 12, step, row) - 1;
        first[spans] = at - follow_contact(l, at + 1, wanted + 12 * at, -12, step, row) + 1;
        spans++;
    }
    return spans;
}

#endif
