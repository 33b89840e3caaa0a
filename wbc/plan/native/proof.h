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

/* Edges are proven in pieces that are no longer [rad, or characteristic lengths] */
#define PIECE 0.25
/* and of LANES pieces, or less, one after so many others */
#define STRIDE 5
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

/* One pair over one piece: 1 where both halves must be looked at */
static int examine(plan_t *p, int k, int last) {
    sweep_t *s = p->sweep;
    const int i = s->first[k], j = s->second[k];
    stand(p, i);
    stand(p, j);
    const double off = off_of(p, i, s->stop_first[k]) + off_of(p, j, s->stop_second[k]), required = s->required[k];
    const int bounded = p->radius[i] < INFINITY && p->radius[j] < INFINITY;
    double *n = p->normals + 3 * k;
    if (bounded && (is_round(s->shape + j) ? from_ball(p, j, i) : from_ball(p, i, j)) - off >= required) return 0;
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

/* One piece for some pairs, and both halves of it where that is not enough */
static void halve(plan_t *p, double low, double high, const int *pairs, int count, int depth, int *room) {
    sweep_t *s = p->sweep;
    int left = 0;
    place_joints(p, 0.5 * (low + high), 0.5 * (high - low));
    for (int k = 0; k < count && s->stopped < 0; k++)
        if (examine(p, pairs[k], depth >= PIECES)) room[left++] = pairs[k];
    if (!left || s->stopped >= 0) return;
    halve(p, low, 0.5 * (low + high), room, left, depth + 1, room + left);
    if (s->stopped < 0) halve(p, 0.5 * (low + high), high, room, left, depth + 1, room + left);
}

/* Whether none of the pairs that were too near last is so again, at y; others too where `all` */
static int apart_at(plan_t *p, int all) {
    const sweep_t *s = p->sweep;
    if (!all && p->recent[0] < 0) return 1;
    place_joints(p, 1.0, 0.0);
    for (int k = 0; k < RECENT && s->stopped < 0; k++)
        if (p->recent[k] >= 0) examine(p, p->recent[k], 1);
    for (int k = 0; all && k < p->pairs && s->stopped < 0; k++) examine(p, k, 1);
    return s->stopped < 0;
}

/* Pieces at once: `count` of the motion from number `from` on, of `pieces`, behind what else is looked at; or places that are evenly
 * spread, where `pieces` is 0. The first of few is y */
static void look_along(plan_t *p, int from, int count, int pieces) {
    sweep_t *s = p->sweep;
    const double half = pieces ? 0.5 / pieces : 0.0;
    const int ended = !pieces || count < LANES;
    lanes_t t, share = {0};
    for (int l = 0; l < LANES; l++) t[l] = 1.0;
    for (int k = 0; k < count; k++) {
        const int l = k + ended;
        t[l] = pieces ? (from + k + 0.5) / pieces : (k + 1.0) / LANES, share[l] = pieces > 0;
    }
    place_lanes(p, t);
    place_offs(p, half);
    near_pairs(p, share);
    /* What is far from each other is looked at first: what is in a body is so seen soonest */
    for (int k = -ended; k < count && s->stopped < 0; k++) {
        const int piece = k < 0 ? 0 : (STRIDE * (k + 1)) % count, l = k < 0 ? 0 : piece + ended, *near = p->near + p->pairs * l;
        int left = 0;
        if (!p->near_count[l]) continue;
        stand_at(p, l, share[l] * half);
        for (int m = 0; m < p->near_count[l] && s->stopped < 0; m++)
            if (examine(p, near[m], 0)) s->list[left++] = near[m];
        if (!left || s->stopped >= 0) continue;
        const double low = (from + piece) / (double)pieces, high = (from + piece + 1.0) / pieces, middle = 0.5 * (low + high);
        halve(p, low, middle, s->list, left, 1, s->list + left);
        if (s->stopped < 0) halve(p, middle, high, s->list, left, 1, s->list + left);
    }
}

/* Straight from x, which is clear, to y; only y where they are the same */
static int clear(plan_t *p, const double *x, const double *y) {
    sweep_t *s = p->sweep;
    if (!p->pairs) return 1;
    p->x = x, p->y = y;
    s->stopped = -1;
    if (apart_at(p, x == y) && x != y) {
        const double wanted = metric(p, x, y) / PIECE;
        if (wanted < LANES - 1) {
            const int pieces = wanted <= 1.0 ? 1 : wanted <= 2.0 ? 2 : wanted <= 4.0 ? 4 : LANES - 1;
            look_along(p, 0, pieces, pieces);
        } else {
            const int pieces = LANES * (int)ceil(wanted / LANES);
            look_along(p, 0, LANES - 1, 0);
            for (int k = 0; k < pieces && s->stopped < 0; k += LANES) look_along(p, k, LANES, pieces);
        }
    }
    if (s->stopped < 0) return 1;
    /* A pair that was too near is looked at first the next time */
    int k = 0;
    while (k < RECENT - 1 && p->recent[k] != s->stopped) k++;
    memmove(p->recent + 1, p->recent, k * sizeof *p->recent);
    p->recent[0] = s->stopped;
    return 0;
}

/* The least distance of all pairs at x, less what each keeps; what is less than `enough` may be any */
static double least_margin(plan_t *p, const double *x, double enough) {
    sweep_t *s = p->sweep;
    double least = INFINITY;
    p->x = p->y = x;
    place_joints(p, 0.0, 0.0);
    for (int k = 0; k < p->pairs && least >= enough; k++) {
        const int i = s->first[k], j = s->second[k];
        answer_t found;
        stand(p, i);
        stand(p, j);
        if (bound_of(s, i, j) - s->required[k] >= least) continue;
        if (convex(s->shape + i) && convex(s->shape + j) && capsules_of(s, i, j) - s->required[k] >= least) continue;
        distance_of(s, i, j, &found);
        if (found.gap - s->required[k] < least) least = found.gap - s->required[k];
    }
    return least;
}

#endif
