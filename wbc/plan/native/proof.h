/* Whether all pairs of bodies are far enough apart while every coordinate goes evenly from one end to the other: proven.
 *
 * In the middle of a piece of the motion a direction n parts both bodies of a pair: no point of A is above a, none of B below b.
 * With v the motion of a point x until the ends of the piece as far as it is linear, |n v(x)| is how much that may change, and
 *
 *     |x(t) - x - v(x)| <= 1/2 sum_j o_j r_j (o_j + 2 sum_i o_i),     i: the turning joints that carry joint j
 *
 * for joints that go by o_j, with x at most r_j away from the axis (1 of joints that shift). Bodies that slide along each other
 * are so proven in few pieces. Where it is not enough, LANES parts are looked at. */
#pragma once

#include "lanes.h"

/* Edges are proven in pieces that are no longer [rad, or characteristic lengths] */
#define PIECE 0.3
/* Pieces are not split into LANES parts more often */
#define PARTS 13

/* What the first `stop` joints of its chain do to a body at the place at hand: of WAYS numbers the first, the others LANES behind each
 * other; where it stands none */
static const double *way_of(plan_t *p, int b, int stop) {
    static const double none[LANES * WAYS];
    if (!stop) return none;
    stand_lanes(p, b);
    return p->lane_ways + LANES * WAYS * ((p->sweep->depth + 1) * b + stop) + p->lane;
}

/* No point of a body is farther along n, at any instant of the piece; the first `stop` joints of its chain move it */
static double top(plan_t *p, int b, int stop, const double *n) {
    const sweep_t *s = p->sweep;
    const shape_t *shape = s->shape + b;
    const double *pose = s->body_pose + 12 * b, *ends = s->world_line + 6 * b, *line = s->line + 8 * b, *way = way_of(p, b, stop);
    double local[3], rate[2] = {0.0, 0.0}, turn[3], across[3];
    for (int m = 0; m < 3; m++) {
        for (int e = 0; e < 2; e++) rate[e] += n[m] * way[LANES * (3 * e + m)];
        turn[m] = way[LANES * (8 + m)];
    }
    const double bend = way[LANES * 6], one = fabs(rate[0]), other = fabs(rate[1]);
    if (is_round(shape)) return fmax(dot3(n, ends) + one, dot3(n, ends + 3) + other) + line[6] + bend;
    turn_back(pose, n, local);
    cross3(n, turn, across);
    return dot3(n, pose + 9) + reach(shape, local) + shape->size[4] + fmax(one, other) + line[7] * sqrt(dot3(across, across)) + bend;
}

/* How far a pair is apart at least along its direction, or along the normal of a half-space; -INFINITY where a shape has no support */
static double parted(plan_t *p, int k) {
    const sweep_t *s = p->sweep;
    const double *n = p->normals + 3 * k, back[3] = {-n[0], -n[1], -n[2]};
    const int i = s->first[k], j = s->second[k], other = s->shape[j].kind == PLANE ? i : j, wall = other == i ? j : i;
    if (convex(s->shape + i) && convex(s->shape + j)) return -top(p, i, s->stop_first[k], n) - top(p, j, s->stop_second[k], back);
    if (s->shape[wall].kind != PLANE || !convex(s->shape + other)) return -INFINITY;
    const double *W = s->body_pose + 12 * wall, down[3] = {-W[2], -W[5], -W[8]};
    return dot3(down, W + 9) - top(p, other, other == i ? s->stop_first[k] : s->stop_second[k], down);
}

/* One pair over one piece: 1 where its parts must be looked at */
static int examine(plan_t *p, int k, int last) {
    sweep_t *s = p->sweep;
    const int i = s->first[k], j = s->second[k];
    stand(p, i);
    stand(p, j);
    const double off = way_of(p, i, s->stop_first[k])[7 * LANES] + way_of(p, j, s->stop_second[k])[7 * LANES], required = s->required[k];
    double *n = p->normals + 3 * k;
    if (bound_of(s, i, j) - off >= required) return 0;
    if (dot3(n, n) > 0.0 && parted(p, k) >= required) return 0;
    answer_t found;
    distance_of(s, i, j, &found);
    copy3(found.normal, n);
    if (found.gap < required) return strike(p, k, 1u << p->lane), 0;
    return !(last || off <= p->open || found.gap - off >= required - p->open || parted(p, k) >= required - p->open);
}

/* Some pairs, 0: all, over stretches at once, and over LANES parts of those where that is not enough; which of them count as proven */
static unsigned look_along(plan_t *p, const stretch_t *all, int count, const int *pairs, int many, int depth, int *room) {
    sweep_t *s = p->sweep;
    const int counts = p->counts;
    p->alive = (1u << count) - 1u;
    place_lanes(p, all, count);
    const int near = near_pairs(p, pairs, many, room);
    int *halved = room + 2 * near;
    for (int l = 0; l < count && s->stopped < 0; l++) {
        for (int m = 0, stood = 0; m < near && s->stopped < 0 && p->alive >> l & 1; m++) {
            if (!(room[2 * m + 1] >> l & 1)) continue;
            if (!stood++) stand_at(p, l);
            if (!examine(p, room[2 * m], depth >= PARTS)) room[2 * m + 1] &= ~(1 << l);
        }
    }
    for (int l = 0; l < count && s->stopped < 0; l++) {
        const unsigned alive = p->alive;
        const double low = all[l].low, wide = (all[l].high - low) / LANES;
        stretch_t parts[LANES];
        int left = 0;
        for (int m = 0; m < near && alive >> l & 1; m++)
            if (room[2 * m + 1] >> l & 1) halved[left++] = room[2 * m];
        if (!left) continue;
        for (int m = 0; m < LANES; m++) parts[m] = (stretch_t){all[l].x, all[l].y, low + m * wide, low + (m + 1) * wide};
        p->counts = WHOLE;
        look_along(p, parts, LANES, halved, left, depth + 1, halved + left);
        p->counts = counts, p->alive = alive;
        const int stopped = s->stopped;
        if (stopped >= 0) s->stopped = -1, strike(p, stopped, 1u << l);
    }
    return s->stopped < 0 ? p->alive : 0;
}

/* Pieces of an edge of some length */
static int pieces_of(double length) { return (int)fmax(1.0, ceil(length / PIECE)); }

/* How much is proven of the way straight through some points, of which the first is clear: all or, where that is not enough, nothing; or
 * its first part, where that `counts` */
static double proven(plan_t *p, const double *const *point, int count, int counts) {
    sweep_t *s = p->sweep;
    stretch_t all[LANES];
    int number[count], pieces = 0, done = 0;
    if (!p->pairs) return 1.0;
    p->counts = counts, p->struck = s->stopped = -1;
    for (int k = 0; k < count - 1; k++) pieces += number[k] = pieces_of(metric(p, point[k], point[k + 1]));
    for (int k = 0, i = 0; k < count - 1 && p->struck < 0;) {
        int lanes = 0, now;
        for (; lanes < LANES && k < count - 1; lanes++) {
            all[lanes] = (stretch_t){point[k], point[k + 1], i / (double)number[k], (i + 1.0) / number[k]};
            if (++i == number[k]) k++, i = 0;
        }
        now = lanes;
        /* Lanes that are left look at points between */
        for (int m = 1; lanes < LANES && m < count - !counts; m++) all[lanes++] = (stretch_t){point[m], point[m], 0.0, 0.0};
        const int good = __builtin_ctz(~look_along(p, all, lanes, 0, p->pairs, 0, s->list));
        done += good < now ? good : now;
    }
    if (p->struck < 0) return 1.0;
    /* A pair that was too near is looked at first the next time */
    int k = 0;
    while (k < RECENT - 1 && p->recent[k] != p->struck) k++;
    memmove(p->recent + 1, p->recent, k * sizeof *p->recent);
    p->recent[0] = p->struck;
    return counts ? done / (double)pieces : 0.0;
}

static int is_clear(plan_t *p, const double *x) {
    p->counts = WHOLE, p->sweep->stopped = -1;
    return look_along(p, &(stretch_t){x, x, 0.0, 0.0}, 1, 0, p->pairs, PARTS, p->sweep->list);
}

/* The least distance of all pairs at x, less what each keeps; what is less than `enough` may be any */
static double least_margin(plan_t *p, const double *x, double enough) {
    sweep_t *s = p->sweep;
    double least = INFINITY;
    place_lanes(p, &(stretch_t){x, x, 0.0, 0.0}, 1);
    stand_at(p, 0);
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
