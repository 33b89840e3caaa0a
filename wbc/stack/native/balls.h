/* Rows that are distances between a ball and the segment of a link: thousands of expressions as one loop.
 *
 * With the ball's centre c, and the segment's point nearest to it m + s u (|s| <= half), let d be the offset from c to
 * that point and n = d / |d|. The margin is h = |d| - reach - margin, and its row n . linear + (c x n) . angular for the
 * screws (linear at the origin of the world, angular) of the joints that move the link.
 *
 * A row whose margin is so wide that no velocity within the bounds could use it up is left out of the tick: it has no
 * entries and no bounds. */
#ifndef WBC_BALLS_H
#define WBC_BALLS_H

#include "margins.h"

#if BALLS > 0 || SENSED > 0
static void leave_out(wbc_tick *t, int k) {
    if (!t->far[k]) {
        memset(t->at + a_start[k], 0, (a_end[k] - a_start[k]) * sizeof(double));
        memset(t->A + k * NV, 0, NV * sizeof(double));
    }
    t->far[k] = 1;
    t->free_low[k] = -WBC_INF;
}
#endif

#if BALLS > 0

/* |d| of every segment, and where the nearest point is on it; coordinates stand together, so that the loop runs on
 * several segments at a time */
static void to_segments(const double *segment, const double *center, double *length, double *along) {
    const double *x = segment, *u = segment + 3 * SEGMENTS;
    for (int c = 0; c < SEGMENTS; c++) {
        const double a = x[c] - center[0], b = x[c + SEGMENTS] - center[1], w = x[c + 2 * SEGMENTS] - center[2];
        const double s = u[c] * a + u[c + SEGMENTS] * b + u[c + 2 * SEGMENTS] * w;
        along[c] = -0.5 * (fabs(s + segment_half[c]) - fabs(s - segment_half[c]));
        const double d0 = a + along[c] * u[c], d1 = b + along[c] * u[c + SEGMENTS], d2 = w + along[c] * u[c + 2 * SEGMENTS];
        length[c] = sqrt(d0 * d0 + d1 * d1 + d2 * d2 + 1e-40);
    }
}

/* What bounds the speed of every point of a segment, from the bounds of the joints that move it */
static double fastest(const wbc_tick *t, int c) {
    const double *x = t->segment + c, *u = x + 3 * SEGMENTS;
    double total = 0.0;
    for (int e = a_start[segment_row[c]]; e < a_end[segment_row[c]]; e++) {
        const double *linear = t->screw + 6 * a_col[e], *angular = linear + 3;
        double largest = 0.0;
        for (int side = -1; side <= 1; side += 2) {
            double end[3];
            for (int i = 0; i < 3; i++) end[i] = x[i * SEGMENTS] + side * segment_half[c] * u[i * SEGMENTS];
            const double a = linear[0] + angular[1] * end[2] - angular[2] * end[1];
            const double b = linear[1] + angular[2] * end[0] - angular[0] * end[2];
            const double w = linear[2] + angular[0] * end[1] - angular[1] * end[0];
            largest = larger(largest, a * a + b * b + w * w);
        }
        total += larger(fabs(t->low[a_col[e]]), fabs(t->high[a_col[e]])) * sqrt(largest);
    }
    return total;
}

/* The longest time that a joint within its bounds takes to stop as :func:`brake_for_margins` wants it */
static double slowest_stop(const wbc_tick *t) {
    double longest = 0.0;
    for (int i = 0; CALM && i < NV; i++) {
        if (brake_at[i] < 0 || t->bound_enabled[brake_at[i]] == 0.0) continue;
        const double speed = larger(fabs(t->low[i]), fabs(t->high[i]));
        longest = larger(longest, speed / (BRAKING_MARGIN * brake_limit[i]));
    }
    return longest;
}

/* Entries of the row of general row k: n is the direction from the ball's centre to the nearest point */
static void ball_row_entries(wbc_tick *t, int k, const double *center, const double *n) {
    const double moment[3] = {center[1] * n[2] - center[2] * n[1], center[2] * n[0] - center[0] * n[2],
                              center[0] * n[1] - center[1] * n[0]};
    for (int e = a_start[k]; e < a_end[k]; e++) {
        const double *screw = t->screw + 6 * a_col[e];
        t->at[e] = n[0] * screw[0] + n[1] * screw[1] + n[2] * screw[2] + moment[0] * screw[3] + moment[1] * screw[4] +
                   moment[2] * screw[5];
    }
}

/* Margins and rows; `screen`: without those that are far away. Needs the bounds. */
static void ball_rows(wbc_tick *t, int screen) {
    const double stop = slowest_stop(t);
    double speed[SEGMENTS + 1], length[SEGMENTS + 1], along[SEGMENTS + 1];
    for (int c = 0; screen && c < SEGMENTS; c++) speed[c] = fastest(t, c);
    for (int b = 0; b < BALLS; b++) {
        const double *center = t->p + ball_pose[b] + 9, *velocity = t->p + ball_velocity[b];
        const double margin = t->p[ball_margin[b]], rate = t->p[ball_rate[b]];
        /* No margin falls by itself faster than the ball moves */
        const double own = sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1] + velocity[2] * velocity[2]);
        to_segments(t->segment, center, length, along);
        for (int r = ball_first[b]; r < ball_first[b + 1]; r++) {
            const int k = ball_row[b] + r - ball_first[b], c = row_segment[r];
            const double h = t->report.margin[margin_at[k]] = length[c] - row_reach[r] - margin;
            if (screen && speed[c] * (t->dt + 0.5 * stop) + own * stop < h &&
                speed[c] + own + TOLERANCE * row_scale[k] < rate * h) {
                leave_out(t, k);
                continue;
            }
            double n[3];
            for (int i = 0; i < 3; i++) {
                const double *x = t->segment + c + i * SEGMENTS;
                n[i] = (x[0] - center[i] + along[c] * x[3 * SEGMENTS]) * (1.0 / length[c]);
            }
            t->far[k] = 0;
            t->free_low[k] = n[0] * velocity[0] + n[1] * velocity[1] + n[2] * velocity[2] - rate * h;
            ball_row_entries(t, k, center, n);
        }
    }
}

/* The same margins one step later, with the segments as they will be */
static void balls_ahead(wbc_tick *t) {
    double length[SEGMENTS + 1], along[SEGMENTS + 1];
    for (int b = 0; b < BALLS; b++) {
        const double *velocity = t->p + ball_velocity[b];
        double center[3];
        for (int i = 0; i < 3; i++) center[i] = t->p[ball_pose[b] + 9 + i] + velocity[i] * t->dt;
        to_segments(t->segment_ahead, center, length, along);
        for (int r = ball_first[b]; r < ball_first[b + 1]; r++)
            t->report.ahead[margin_at[ball_row[b] + r - ball_first[b]]] =
                length[row_segment[r]] - row_reach[r] - t->p[ball_margin[b]];
    }
}

#endif

#endif
