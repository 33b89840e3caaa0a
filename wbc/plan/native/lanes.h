/* Pairs at LANES places of a motion at once: a direction parts both bodies of a pair, and is proven to part them within a piece.
 *
 * One of the two is a capsule or a ball that moves; the other one such too, or a convex body that stands, of which the box about it
 * counts. The bound is that of proof.h. */
#ifndef WBC_LANES_H
#define WBC_LANES_H

#include "places.h"

/* Along a direction: how far a body reaches at the place itself, and within the piece */
typedef struct {
    lanes_t here, within;
} extent_t;

/* Ends of the core of a body at all places and, where its joints move within the piece, the motion of both ends as far as it is
 * linear, and the rest of the bound, for every number of joints that count */
static void stand_lanes(plan_t *p, int b) {
    const sweep_t *s = p->sweep;
    if (p->lane_stamp[b] == p->lane_node) return;
    p->lane_stamp[b] = p->lane_node;
    lanes_t *ends = (lanes_t *)p->lane_ends + 6 * b, *way = (lanes_t *)p->lane_ways + WAYS * (s->depth + 1) * b;
    const double *line = s->line + 8 * b;
    const lanes_t *frame = (const lanes_t *)p->lane_pose + 12 * s->body_frame[b];
    for (int e = 0; e < 2; e++)
        for (int i = 0; i < 3; i++) {
            const lanes_t *row = frame + 3 * i;
            ends[3 * e + i] = row[0] * line[3 * e] + row[1] * line[3 * e + 1] + row[2] * line[3 * e + 2] + frame[9 + i];
        }
    lanes_t off = {0}, reached = {0}, bent = {0}, turned = {0};
    memset(way, 0, WAYS * sizeof *way);
    for (int k = 0; k < s->chain_length[b]; k++, way += WAYS) {
        const int f = s->chain[s->depth * b + k];
        const lanes_t *pose = (const lanes_t *)p->lane_pose + 12 * f, axis[3] = {pose[2], pose[5], pose[8]};
        const lanes_t gone = *(const lanes_t *)p->share * p->gone[f], by = abs_lanes(gone);
        for (int m = 0; m < WAYS; m++) way[WAYS + m] = way[m];
        if (p->gone[f] == 0.0) continue;
        if (s->kind[f] != TURNING) {
            for (int m = 0; m < 6; m++) way[WAYS + m] += gone * axis[m % 3];
            bent -= 2.0 * by * turned, off += by, reached += by;
        } else {
            lanes_t far = {0};
            for (int e = 0; e < 2; e++) {
                const lanes_t *end = ends + 3 * e, u[3] = {end[0] - pose[9], end[1] - pose[10], end[2] - pose[11]};
                const lanes_t along = dot_lanes(u, axis);
                far = max_lanes(far, dot_lanes(u, u) - along * along);
                for (int m = 0; m < 3; m++) {
                    const int i = (m + 1) % 3, j = (m + 2) % 3;
                    way[WAYS + 3 * e + m] += gone * (axis[i] * u[j] - axis[j] * u[i]);
                }
            }
            for (int m = 0; m < 3; m++) way[WAYS + 8 + m] += gone * axis[m];
            const lanes_t arc = min_lanes(by, (lanes_t){0} + 2.0) * (sqrt_lanes(far) + line[7]), whole = arc + by * off;
            off += arc, reached += whole, turned += by;
            bent += whole * (by - 2.0 * turned);
        }
        /* Beyond so large a turn the linear part says nothing */
        way[WAYS + 7] = off;
        way[WAYS + 6] = chosen(turned > TURNED, (lanes_t){0} + INFINITY, 0.5 * bent + turned * reached);
    }
}

/* How far the core of a round body reaches along n */
static extent_t extent_of(const plan_t *p, int b, int off, const lanes_t *n) {
    const lanes_t *ends = (const lanes_t *)p->lane_ends + 6 * b, *way = (const lanes_t *)p->lane_ways + WAYS * off;
    const lanes_t one = dot_lanes(n, ends), other = dot_lanes(n, ends + 3);
    return (extent_t){max_lanes(one, other), max_lanes(one + abs_lanes(dot_lanes(n, way)), other + abs_lanes(dot_lanes(n, way + 3))) + way[6]};
}

/* How far a pair is apart along n, which leads from `ball` to `other` */
static extent_t apart_along(const plan_t *p, const outline_t *pair, const lanes_t *n) {
    const lanes_t back[3] = {-n[0], -n[1], -n[2]};
    const extent_t a = extent_of(p, pair->ball, pair->ball_off, n);
    if (pair->form == BALLS) {
        const extent_t b = extent_of(p, pair->other, pair->other_off, back);
        return (extent_t){-a.here - b.here - pair->core, -a.within - b.within - pair->core};
    }
    const double *box = p->boxes + 15 * pair->other;
    lanes_t top = {0};
    for (int m = 0; m < 3; m++)
        top += back[m] * box[9 + m] + box[12 + m] * abs_lanes(n[0] * box[m] + n[1] * box[3 + m] + n[2] * box[6 + m]);
    return (extent_t){-a.here - top - pair->core, -a.within - top - pair->core};
}

/* A pair is too near at some lanes: what is behind the first of these counts no longer, and what ends there */
static void strike(plan_t *p, int k, unsigned lanes) {
    const unsigned behind = lanes & ~p->ended;
    p->struck = k;
    p->alive &= behind ? (1u << __builtin_ctz(behind)) - 1u : p->alive >> 1;
    p->alive &= ~p->ended;
    if (!p->partial || !p->alive) p->sweep->stopped = k;
}

/* Lanes at which a pair is not proven to be apart, of those in `near` */
static unsigned undecided(plan_t *p, int k, unsigned near) {
    sweep_t *s = p->sweep;
    const outline_t *pair = p->outlines + k;
    const double required = s->required[k], sign = pair->ball == s->first[k] ? 1.0 : -1.0;
    double *known = p->normals + 3 * k;
    lanes_t n[3];
    stand_lanes(p, pair->ball);
    if (pair->form == BALLS) stand_lanes(p, pair->other);
    if (dot3(known, known) > 0.0) {
        for (int m = 0; m < 3; m++) n[m] = (lanes_t){0} + sign * known[m];
        near &= ~bits(apart_along(p, pair, n).within >= required);
        if (!near) return 0;
    }
    const lanes_t *ends = (const lanes_t *)p->lane_ends, *core = ends + 6 * pair->ball;
    const lanes_t distance = pair->form == BALLS ? to_segment(core, ends + 6 * pair->other, n) : to_box(core, p->boxes + 15 * pair->other, n);
    const unsigned hit = pair->exact ? near & bits(distance < pair->core + required) : 0;
    if (hit) strike(p, k, hit);
    if (s->stopped >= 0 || !(near &= p->alive)) return 0;
    for (int m = 0; m < 3; m++) n[m] /= distance;
    const extent_t gap = apart_along(p, pair, n);
    const int one = __builtin_ctz(near);
    for (int m = 0; m < 3; m++) known[m] = sign * n[m][one];
    const mask_t apart = (gap.within >= required) | ((gap.here >= required) & (gap.within >= required - p->open));
    return near & ~bits(apart);
}

/* A pair where it may be nearer than required, lane by lane into `near`: within a piece, or at its middle */
static void near_pair(plan_t *p, int k) {
    const outline_t *pair = p->outlines + k;
    const double off = p->offs[pair->ball_off] + p->offs[pair->other_off];
    unsigned near = p->alive;
    if (pair->form != UNSEEN && off < INFINITY) {
        const lanes_t *ball = (const lanes_t *)p->lane_centre + 3 * pair->ball, reached = p->sweep->required[k] + pair->radii + *(const lanes_t *)p->share * off;
        lanes_t square = {0};
        if (pair->form == BALLS) {
            const lanes_t *other = (const lanes_t *)p->lane_centre + 3 * pair->other;
            for (int m = 0; m < 3; m++) square += (ball[m] - other[m]) * (ball[m] - other[m]);
        } else {
            const double *box = p->boxes + 15 * pair->other;
            const lanes_t x = ball[0] - box[9], y = ball[1] - box[10], z = ball[2] - box[11];
            for (int m = 0; m < 3; m++) {
                const lanes_t over = abs_lanes(box[m] * x + box[3 + m] * y + box[6 + m] * z) - box[12 + m], e = (lanes_t)((mask_t)over & (over > 0.0));
                square += e * e;
            }
        }
        near &= bits((square < reached * reached) & (reached > 0.0));
        if (near && pair->round) near = undecided(p, k, near);
    }
    for (; near; near &= near - 1) {
        const int l = __builtin_ctz(near);
        p->near[p->pairs * l + p->near_count[l]++] = k;
    }
}

/* All pairs, those that were too near last first, until one is too near */
static void near_pairs(plan_t *p) {
    memset(p->near_count, 0, sizeof p->near_count);
    for (int k = 0; k < RECENT && p->sweep->stopped < 0; k++)
        if (p->recent[k] >= 0) near_pair(p, p->recent[k]);
    for (int k = 0; k < p->pairs && p->sweep->stopped < 0; k++)
        if (k != p->recent[0] && k != p->recent[1] && k != p->recent[2]) near_pair(p, k);
}

#endif
