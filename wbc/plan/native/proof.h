/* Whether all pairs of bodies are far enough apart while every coordinate goes evenly from one end to the other: proven.
 *
 * In the middle of a piece of the motion a direction n parts both bodies of a pair: no point of A is above a, none of B below b.
 * With v the motion of a point x until the ends of the piece as far as it is linear, |n v(x)| is how much that may change, and
 *
 *     |x(t) - x - v(x)| <= 1/2 sum_j o_j r_j (o_j + 2 sum_i o_i),     i: the turning joints that carry joint j
 *
 * for joints that go by o_j, with x at most r_j away from the axis (1 of joints that shift). Bodies that slide along each other
 * are so proven in few pieces. Where it is not enough, both halves are looked at. */
#ifndef WBC_PROOF_H
#define WBC_PROOF_H

#include "places.h"

/* Edges are looked at, before they are proven, at places no farther apart than this [rad, or characteristic lengths] */
#define PROBED 0.5
/* Pieces are not halved more often */
#define PIECES 40
/* Beyond so large a turn the linear part says nothing [rad] */
#define TURNED 1.5

/* No point of a body is farther along n, at any instant of the piece; the first `stop` joints of its chain move it */
static double top(plan_t *p, int b, int stop, const double *n) {
    const sweep_t *s = p->sweep;
    const shape_t *shape = s->shape + b;
    const double *pose = s->body_pose + 12 * b, *ends = s->world_line + 6 * b, *line = s->line + 8 * b;
    double local[3], rate[2] = {0.0, 0.0}, bend = 0.0, side = 0.0;
    if (stop && p->half > 0.0) {
        const drift_t *d = p->drifts + (s->depth + 1) * b + stop;
        double across[3];
        if (d->turned > TURNED) return INFINITY;
        cross3(n, d->angular, across);
        for (int e = 0; e < 2; e++) rate[e] = fabs(dot3(n, d->linear) + dot3(across, ends + 3 * e));
        bend = 0.5 * d->bent + d->turned * d->reached;
        side = line[7] * sqrt(dot3(across, across));
    }
    if (is_round(shape)) return fmax(dot3(n, ends) + rate[0], dot3(n, ends + 3) + rate[1]) + line[6] + bend;
    turn_back(pose, n, local);
    return dot3(n, pose + 9) + reach(shape, local) + shape->size[4] + fmax(rate[0], rate[1]) + side + bend;
}

/* How far a pair is apart along n at least */
static double parted(plan_t *p, int k, const double *n) {
    const sweep_t *s = p->sweep;
    const double back[3] = {-n[0], -n[1], -n[2]};
    return -top(p, s->first[k], s->stop_first[k], n) - top(p, s->second[k], s->stop_second[k], back);
}

/* The same where one of the two is a half-space, whose normal counts; -INFINITY where a shape has no support */
static double parted_any(plan_t *p, int k) {
    const sweep_t *s = p->sweep;
    const int i = s->first[k], j = s->second[k], other = s->shape[j].kind == PLANE ? i : j, wall = other == i ? j : i;
    if (convex(s->shape + i) && convex(s->shape + j)) return parted(p, k, p->normals + 3 * k);
    if (s->shape[wall].kind != PLANE || !convex(s->shape + other)) return -INFINITY;
    const double *W = s->body_pose + 12 * wall, down[3] = {-W[2], -W[5], -W[8]};
    return dot3(down, W + 9) - top(p, other, other == i ? s->stop_first[k] : s->stop_second[k], down);
}

/* A bound from below of the distance of body j from the ball about body i */
static double from_ball(const plan_t *p, int i, int j) {
    const sweep_t *s = p->sweep;
    const double *ball = p->balls + 4 * i, *other = p->balls + 4 * j, *pose = s->body_pose + 12 * j;
    double d[3], x[3], off[3];
    if (is_round(s->shape + j) || !is_box(s->shape + j)) {
        minus3(ball, other, d);
        return sqrt(dot3(d, d)) - other[3] - ball[3];
    }
    minus3(ball, pose + 9, d);
    turn_back(pose, d, x);
    beyond_box(x, s->shape[j].size, off);
    return sqrt(dot3(off, off)) - s->shape[j].size[4] - ball[3];
}

/* One pair over one piece: 1 where both halves must be looked at; `near`: the balls say nothing */
static int examine(plan_t *p, int k, int last, int near) {
    sweep_t *s = p->sweep;
    const int i = s->first[k], j = s->second[k];
    stand(p, i);
    stand(p, j);
    const double off = off_of(p, i, s->stop_first[k]) + off_of(p, j, s->stop_second[k]), required = s->required[k];
    const int bounded = p->radius[i] < INFINITY && p->radius[j] < INFINITY;
    double *n = p->normals + 3 * k;
    if (!near && bounded && (is_round(s->shape + j) ? from_ball(p, j, i) : from_ball(p, i, j)) - off >= required) return 0;
    if (!bounded && bound_of(s, i, j) - off >= required) return 0;
    if (dot3(n, n) > 0.0 && parted_any(p, k) >= required) return 0;
    answer_t found;
    distance_of(s, i, j, &found);
    p->measured++;
    copy3(found.normal, n);
    if (found.gap < required) {
        s->stopped = k;
        return 0;
    }
    return !(last || off <= p->open || found.gap - off >= required - p->open || parted_any(p, k) >= required - p->open);
}

/* One piece, and both halves of it where that is not enough; `count` pairs, or -1: all of them */
static void halve(plan_t *p, double low, double high, const int *pairs, int count, int depth, int *room) {
    sweep_t *s = p->sweep;
    const int whole = count < 0;
    int left = 0;
    place_joints(p, 0.5 * (low + high), 0.5 * (high - low));
    /* What was too near before is first */
    for (int k = 0; whole && low == high && k < RECENT && s->stopped < 0; k++)
        if (p->recent[k] >= 0) examine(p, p->recent[k], 1, 0);
    if (whole && s->stopped < 0) count = near_pairs(p, room), pairs = room;
    for (int k = 0; k < count && s->stopped < 0; k++)
        if (examine(p, pairs[k], depth >= PIECES, whole)) room[left++] = pairs[k];
    if (!left || s->stopped >= 0) return;
    halve(p, low, 0.5 * (low + high), room, left, depth + 1, room + left);
    if (s->stopped < 0) halve(p, 0.5 * (low + high), high, room, left, depth + 1, room + left);
}

/* A pair that was too near is looked at first the next time */
static int remembered(plan_t *p) {
    const int stopped = p->sweep->stopped;
    if (stopped < 0) return 1;
    int k = 0;
    while (k < RECENT - 1 && p->recent[k] != stopped) k++;
    memmove(p->recent + 1, p->recent, k * sizeof *p->recent);
    p->recent[0] = stopped;
    return 0;
}

/* Whether nothing is too near at places between x and y: far from each other first, since what is in a body is so seen
 * soonest */
static int probed(plan_t *p, const double *x, const double *y) {
    sweep_t *s = p->sweep;
    if (!p->pairs) return 1;
    const double length = metric(p, x, y);
    p->x = x, p->y = y;
    s->stopped = -1;
    for (int parts = 1; length > parts * PROBED && s->stopped < 0; parts *= 2)
        for (int k = 1; k < 2 * parts && s->stopped < 0; k += 2)
            halve(p, 0.5 * k / parts, 0.5 * k / parts, 0, -1, 0, s->list);
    return remembered(p);
}

/* Straight from x to y, which may be x */
static int proven(plan_t *p, const double *x, const double *y) {
    sweep_t *s = p->sweep;
    if (!p->pairs) return 1;
    const double length = metric(p, x, y);
    int parts = 1;
    while (parts * PROBED < length) parts *= 2;
    p->x = x, p->y = y;
    s->stopped = -1;
    if (x == y) halve(p, 0.0, 0.0, 0, -1, 0, s->list);
    for (int k = 0; k < parts && x != y && s->stopped < 0; k++) halve(p, (double)k / parts, (k + 1.0) / parts, 0, -1, 0, s->list);
    return remembered(p);
}

static int clear(plan_t *p, const double *x, const double *y) { return (x == y || probed(p, x, y)) && proven(p, x, y); }

/* The least distance of all pairs at x, less what each keeps; which pair it is */
static double least_margin(plan_t *p, const double *x, int *pair) {
    sweep_t *s = p->sweep;
    double least = INFINITY;
    p->x = p->y = x;
    place_joints(p, 0.0, 0.0);
    for (int k = 0; k < p->pairs; k++) {
        const int i = s->first[k], j = s->second[k];
        answer_t found;
        stand(p, i);
        stand(p, j);
        if (bound_of(s, i, j) - s->required[k] >= least) continue;
        if (convex(s->shape + i) && convex(s->shape + j) && capsules_of(s, i, j) - s->required[k] >= least) continue;
        distance_of(s, i, j, &found);
        if (found.gap - s->required[k] < least) least = found.gap - s->required[k], *pair = k;
    }
    return least;
}

#endif
