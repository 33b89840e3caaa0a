/* Whether the command lets a pair without a row close faster than its row would: see wbc/proximity/missing.py. */
#ifndef WBC_MISSING_H
#define WBC_MISSING_H

#include "corners.h"

/* How much of what its row allows a pair closes by: wbc/proximity/missing.py */
#define WHOLE 0.999
enum { LITTLE, HALF, ALL, TOO_MUCH, INWARD };

/* d(distance)/dt of a row by what moves from outside */
static double drift_of(const scene_t *s, const double *twist, int pair, const double *line) {
    return s->outward[pair] * (dot3(line, twist) + dot3(line + 3, twist + 3));
}

/* The twist of what moves from outside, at the world's origin; 0 where it rests */
static int outside_twist(const scene_t *s, double *twist) {
    memset(twist, 0, 6 * sizeof(double));
    if (!s->has_velocity) return 0;
    const double *v = s->velocity, *p = s->pose + 9;
    double moment[3];
    cross3(p, v + 3, moment);
    for (int k = 0; k < 3; k++) twist[k] = v[k] + moment[k], twist[3 + k] = v[3 + k];
    for (int k = 0; k < 6; k++)
        if (v[k] != 0.0) return 1;
    return 0;
}

/* No point of a body moves faster than this by a twist */
static double fastest(const scene_t *s, int body, const double *twist) {
    const double *center = s->body_pose + 12 * body + 9;
    double velocity[3];
    if (s->shape[body].kind == PLANE) return INFINITY;
    cross3(twist + 3, center, velocity);
    for (int k = 0; k < 3; k++) velocity[k] += twist[k];
    return sqrt(dot3(velocity, velocity)) + sqrt(dot3(twist + 3, twist + 3)) * s->shape[body].size[5];
}

/* Twists of the joints that carry bodies, at the world's origin; the longest time that a joint takes to stop */
static double place_twists(const scene_t *s) {
    double longest = 0.0;
    for (int j = 1; j < s->joints; j++) {
        if (s->joint_parent[j] < 0) continue;
        double *twist = s->joint_twist + 6 * j;
        memcpy(twist, s->joint_twist + 6 * s->joint_parent[j], 6 * sizeof(double));
        const int first = s->joint_v[2 * j];
        for (int i = first; i < first + s->joint_v[2 * j + 1]; i++)
            for (int k = 0; k < 6; k++) twist[k] += s->screws[6 * i + k] * s->v[i];
    }
    for (int b = 0; b < s->bodies; b++) s->speed[b] = fastest(s, b, s->joint_twist + 6 * s->body_joint[b]);
    for (int i = 0; i < s->nv; i++) longest = fmax(longest, fabs(s->v[i]) / s->braking[i]);
    return longest;
}

/* Whether no row of a pair can matter, by bounds: as in stack/native/balls.h. The speeds of both bodies first, then that of
 * one as seen from the other. */
static int far_away(const scene_t *s, int k, double share, double stop, const double *outside, int moves) {
    const int a = s->first[k], b = s->second[k];
    const double h = s->least[k] - s->margin[0], both = s->speed[a] + s->speed[b];
    double own = 0.0;
    if (moves && s->outward[k] != 0.0) own = fmin(fastest(s, a, outside), fastest(s, b, outside));
    const double most = fmin((h - own * stop) * share, s->rate[0] * h - own);
    if (!(most > 0.0)) return 0;
    if (both < most) return 1;
    const double *A = s->joint_twist + 6 * s->body_joint[a], *B = s->joint_twist + 6 * s->body_joint[b];
    double twist[6];
    for (int i = 0; i < 6; i++) twist[i] = B[i] - A[i];
    return fastest(s, a, twist) < most || fastest(s, b, twist) < most;
}

/* How much of what it allows a row closes by. See stack/native/margins.h for `stopping` */
static int used(const scene_t *s, int pair, double gap, const double *line, double drift, double dt) {
    const double *side = s->pair_side + (size_t)s->nv * pair, h = gap - s->margin[0];
    double closing = 0.0, a = 0.0, allowed = s->rate[0] * h + drift;
    for (int i = 0; i < s->nv; i++) {
        if (side[i] == 0.0) continue;
        const double *screw = s->screws + 6 * i, entry = side[i] * (dot3(line, screw) + dot3(line + 3, screw + 3));
        closing -= entry * s->v[i];
        if (entry != 0.0) a += fabs(entry) * s->braking[i];
    }
    if (h > 0.0 && a > 0.0 && a < INFINITY) {
        const double lag = dt + fmax(-drift, 0.0) / a, speed = 2.0 * h / (lag + sqrt(lag * lag + 2.0 * h / a));
        allowed = fmin(allowed, speed + fmax(drift, 0.0));
    }
    if (closing > allowed + s->how.tie) return closing > fmax(allowed, 0.0) + s->how.tie ? INWARD : TOO_MUCH;
    if (closing > allowed - (1.0 - WHOLE) * fabs(allowed) - s->how.tie) return ALL;
    return closing > 0.5 * allowed || !(h > 0.0) ? HALF : LITTLE;
}

static int larger_of(int a, int b) { return a > b ? a : b; }

/* The most that a pair without a row uses, of its nearest points and of its corners */
static int used_by(scene_t *s, int k, const double *outside, int moves, double dt) {
    corner_t corner[2 * MOST_CORNERS + 1];
    int most = LITTLE;
    measure(s, k);
    const double *found = s->answer + 7 * k, gap = gap_of(s, k);
    const int more = s->corners && gap < s->margin[0] + s->near ? corners_of(s, k, corner) : 0;
    corner[more].gap = gap;
    line_through(found + 4, found + 1, corner[more].line);
    for (int c = 0; c <= more; c++) {
        const double *line = corner[c].line, drift = moves ? drift_of(s, outside, k, line) : 0.0;
        most = larger_of(most, used(s, k, corner[c].gap, line, drift, dt));
    }
    return most;
}

static int missing(scene_t *s, double dt) {
    double outside[6];
    const int moves = outside_twist(s, outside);
    const double stop = place_twists(s), share = 1.0 / (dt + 0.5 * stop);
    int worst = LITTLE;
    if (s->row_pair[0] < 0) return LITTLE; /* nothing was measured yet */
    for (int r = 0; r < s->rows; r++) {
        const int pair = s->row_pair[r], more = s->rows + r * s->corners;
        int most = used(s, pair, s->distance[r], s->line + 6 * r, s->drift[r], dt);
        for (int at = more; s->row_near[r] && at < more + s->corners; at++)
            if (s->distance[at] < 0.5 * s->far)
                most = larger_of(most, used(s, pair, s->distance[at], s->line + 6 * at, s->drift[at], dt));
        s->urgent[pair] = (signed char)(most > ALL ? ALL : most);
    }
    for (int k = 0; k < s->pairs; k++) {
        if (s->has_row[k]) continue;
        const int most = far_away(s, k, share, stop, outside, moves) ? LITTLE : used_by(s, k, outside, moves, dt);
        s->urgent[k] = (signed char)(most >= TOO_MUCH ? ALL : most > LITTLE ? HALF : LITTLE);
        worst = larger_of(worst, most);
    }
    return worst;
}

#endif
