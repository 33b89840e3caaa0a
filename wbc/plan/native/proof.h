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

#include "lanes.h"

/* Edges are proven in pieces that are no longer [rad, or characteristic lengths] */
#define PIECE 0.3
/* and of LANES pieces, or less, one after so many others */
#define STRIDE 5
/* Pieces are not halved more often */
#define PIECES 40

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

/* One pair over one piece: 1 where both halves must be looked at */
static int examine(plan_t *p, int k, int last) {
    sweep_t *s = p->sweep;
    const int i = s->first[k], j = s->second[k];
    stand(p, i);
    stand(p, j);
    const double off = way_of(p, i, s->stop_first[k])[7 * LANES] + way_of(p, j, s->stop_second[k])[7 * LANES], required = s->required[k];
    double *n = p->normals + 3 * k;
    if (bound_of(s, i, j) - off >= required) return 0;
    if (dot3(n, n) > 0.0 && parted_any(p, k) >= required) return 0;
    answer_t found;
    distance_of(s, i, j, &found);
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

/* Lanes at `count` pieces of the motion from number `from` on, of `pieces`, or at places that are evenly spread, where that is 0; the first
 * of few is y */
static void place_pieces(plan_t *p, int from, int count, int pieces) {
    lanes_t t;
    p->half = pieces ? 0.5 / pieces : 0.0;
    for (int l = 0; l < LANES; l++) {
        const int k = l - p->ended, counts = k >= 0 && k < count;
        t[l] = !counts ? 1.0 : pieces ? (from + k + 0.5) / pieces : (k + 1.0) / LANES, p->share[l] = counts && pieces;
    }
    place_lanes(p, t);
}

/* Pieces at once, behind what else is looked at: see place_pieces. How many of them are proven, the first ones */
static int look_along(plan_t *p, int from, int count, int pieces) {
    sweep_t *s = p->sweep;
    const int ended = !pieces || count < LANES;
    p->ended = ended, p->alive = (1u << (count + ended)) - 1u;
    place_pieces(p, from, count, pieces);
    int node = p->lane_node;
    place_offs(p);
    near_pairs(p);
    /* What is far from each other is looked at first: what is in a body is so seen soonest */
    for (int k = -ended; k < count && s->stopped < 0; k++) {
        const int piece = k < 0 ? 0 : p->partial ? k : (STRIDE * (k + 1)) % count, l = k < 0 ? 0 : piece + ended, *near = p->near + p->pairs * l;
        int left = 0;
        if (!(p->alive >> l & 1)) continue;
        if (!p->near_count[l]) continue;
        /* What was halved stands elsewhere */
        if (p->lane_node != node) place_pieces(p, from, count, pieces), node = p->lane_node;
        stand_at(p, l);
        for (int m = 0; m < p->near_count[l] && s->stopped < 0; m++)
            if (examine(p, near[m], 0)) s->list[left++] = near[m];
        if (left && s->stopped < 0) {
            const double low = (from + piece) / (double)pieces, high = (from + piece + 1.0) / pieces, middle = 0.5 * (low + high);
            halve(p, low, middle, s->list, left, 1, s->list + left);
            if (s->stopped < 0) halve(p, middle, high, s->list, left, 1, s->list + left);
        }
        if (s->stopped < 0) continue;
        const int stopped = s->stopped;
        s->stopped = -1;
        strike(p, stopped, 1u << l);
    }
    return s->stopped < 0 ? __builtin_ctz(~(p->alive >> ended)) : 0;
}

/* How much of the motion straight from x, which is clear, to y is proven: all or, where that is not enough, nothing; or its first part,
 * where `partial` */
static double proven(plan_t *p, const double *x, const double *y, int partial) {
    sweep_t *s = p->sweep;
    if (!p->pairs) return 1.0;
    p->x = x, p->y = y, p->partial = partial, p->struck = s->stopped = -1;
    const double wanted = metric(p, x, y) / PIECE;
    int pieces = wanted <= 1.0 ? 1 : wanted <= 2.0 ? 2 : wanted <= 4.0 ? 4 : LANES - 1, done = 0;
    if (wanted < LANES - 1) {
        done = look_along(p, 0, pieces, pieces);
    } else {
        pieces = LANES * (int)ceil(wanted / LANES);
        if (!partial) look_along(p, 0, LANES - 1, 0);
        for (int now = LANES; now == LANES && done < pieces && s->stopped < 0; done += now) now = look_along(p, done, LANES, pieces);
    }
    if (p->struck < 0) return 1.0;
    /* A pair that was too near is looked at first the next time */
    int k = 0;
    while (k < RECENT - 1 && p->recent[k] != p->struck) k++;
    memmove(p->recent + 1, p->recent, k * sizeof *p->recent);
    p->recent[0] = p->struck;
    return partial ? done / (double)pieces : 0.0;
}

/* The same from x to itself */
static int is_clear(plan_t *p, const double *x) {
    sweep_t *s = p->sweep;
    p->x = p->y = x, s->stopped = -1;
    place_joints(p, 1.0, 0.0);
    for (int k = 0; k < p->pairs && s->stopped < 0; k++) examine(p, k, 1);
    return s->stopped < 0;
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
