/* Pairs at LANES places of a motion at once: a direction parts both bodies of a pair, and is proven to part them within a piece.
 *
 * One of the two is a capsule or a ball that moves; the other one such too, or a convex body that stands, of which the box about it
 * counts. The bound is that of proof.h. */
#pragma once

#include "places.h"

/* Blocks of no more pairs are not looked at as such */
#define FEW 3

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
        const lanes_t gone = ((const lanes_t *)p->gone)[f], by = abs_lanes(gone);
        for (int m = 0; m < WAYS; m++) way[WAYS + m] = way[m];
        if (!bits(gone != 0.0)) continue;
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
    const double *box = p->boxes + 15 * pair->other;
    const extent_t a = extent_of(p, pair->ball, pair->ball_off, n);
    extent_t b = {{0}, {0}};
    if (pair->form == BALLS) b = extent_of(p, pair->other, pair->other_off, back);
    for (int m = 0; m < 3 && pair->form == BALL_BOX; m++)
        b.here = b.within += back[m] * box[9 + m] + box[12 + m] * abs_lanes(n[0] * box[m] + n[1] * box[3 + m] + n[2] * box[6 + m]);
    return (extent_t){-a.here - b.here - pair->core, -a.within - b.within - pair->core};
}

/* A pair is too near at some lanes: these, or what is behind the first of them, count no longer */
static void strike(plan_t *p, int k, unsigned lanes) {
    p->struck = k;
    p->alive &= p->counts == EACH ? ~lanes : (1u << __builtin_ctz(lanes)) - 1u;
    if (p->counts == WHOLE || !p->alive) p->sweep->stopped = k;
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
    const lanes_t inverse = 1.0 / distance;
    for (int m = 0; m < 3; m++) n[m] *= inverse;
    const extent_t gap = apart_along(p, pair, n);
    const int one = __builtin_ctz(near);
    for (int m = 0; m < 3; m++) known[m] = sign * n[m][one];
    const mask_t apart = (gap.within >= required) | ((gap.here >= required) & (gap.within >= required - p->open));
    return near & ~bits(apart);
}

/* Those of some lanes at which the balls about a pair, or a block of pairs, are not far enough apart */
static unsigned near_balls(plan_t *p, int k, unsigned lanes) {
    const outline_t *pair = p->outlines + k;
    if (pair->form == UNSEEN) return lanes;
    ball_lanes(p, pair->ball);
    ball_lanes(p, pair->other);
    const lanes_t *offs = (const lanes_t *)p->offs, reached = p->sweep->required[k] + pair->radii + offs[pair->ball_off] + offs[pair->other_off];
    const lanes_t *ball = (const lanes_t *)p->lane_centre + 3 * pair->ball, *other = (const lanes_t *)p->lane_centre + 3 * pair->other;
    const double *box = p->boxes + 15 * pair->other;
    lanes_t d[3];
    if (pair->form == BALLS) {
        for (int m = 0; m < 3; m++) d[m] = ball[m] - other[m];
    } else {
        const lanes_t x = ball[0] - box[9], y = ball[1] - box[10], z = ball[2] - box[11];
        for (int m = 0; m < 3; m++) d[m] = max_lanes(abs_lanes(box[m] * x + box[3 + m] * y + box[6 + m] * z) - box[12 + m], (lanes_t){0});
    }
    return lanes & bits(dot_lanes(d, d) < reached * abs_lanes(reached));
}

/* A pair behind `left` others, with its lanes, where it is not proven to be far enough apart at all of some; how many they are then */
static int look_at(plan_t *p, int k, unsigned lanes, int *near, int left) {
    lanes = near_balls(p, k, lanes & p->alive);
    if (lanes && p->outlines[k].round) lanes = undecided(p, k, lanes);
    if (!lanes) return left;
    near[2 * left] = k, near[2 * left + 1] = (int)lanes;
    return left + 1;
}

/* Those of some pairs, 0: of all, that are not proven so, and at which lanes, one behind the other; how many. It ends with one that is too near */
static int near_pairs(plan_t *p, const int *pairs, int count, int *near) {
    const int *recent = p->recent;
    int left = 0;
    for (int m = 0; m < (pairs ? count : RECENT) && p->sweep->stopped < 0; m++) {
        const int k = pairs ? pairs[m] : recent[m];
        if (k >= 0) left = look_at(p, k, ~0u, near, left);
    }
    for (int block = 0, k = 0; !pairs && k < p->pairs; block++) {
        const int end = block < p->blocks ? p->block_end[block] : p->pairs;
        const unsigned lanes = block < p->blocks && end - k > FEW ? near_balls(p, p->pairs + block, p->alive) : p->alive;
        for (; lanes && k < end && p->sweep->stopped < 0; k++)
            if (k != recent[0] && k != recent[1] && k != recent[2]) left = look_at(p, k, lanes, near, left);
        k = end;
    }
    return left;
}
