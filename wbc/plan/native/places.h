/* Where joints and bodies are in the middle of a piece of a motion from x to y, how far they may be off it, and which pairs of bodies
 * are near to each other there. All joints turn about z, or shift along it: see wbc/plan/coordinates.py. */
#ifndef WBC_PLACES_H
#define WBC_PLACES_H

#include "plan.h"

/* All joints at x + t (y - x); `half` of the way to y is what they do until the ends of the piece */
static void place_joints(plan_t *p, double t, double half) {
    sweep_t *s = p->sweep;
    s->node++;
    p->half = half;
    for (int f = 0; f < s->frames; f++) {
        double *pose = s->pose + 12 * f;
        const double *place = s->place + 12 * f, *axis = s->axis + 5 * f;
        if (s->parent[f] < 0) memcpy(pose, place, 12 * sizeof *pose);
        else compose(s->pose + 12 * s->parent[f], place, pose);
        p->gone[f] = 0.0;
        if (s->kind[f] == FIXED) continue;
        const int k = s->coordinate[f];
        const double way = p->y[k] - p->x[k], q = axis[3] * (p->x[k] + t * way) + axis[4];
        p->gone[f] = axis[3] * way * half;
        if (s->kind[f] == TURNING) {
            const double cosine = cos(q), sine = sin(q);
            for (int i = 0; i < 9; i += 3) {
                const double a = pose[i], b = pose[i + 1];
                pose[i] = cosine * a + sine * b, pose[i + 1] = cosine * b - sine * a;
            }
        } else {
            for (int i = 0; i < 3; i++) pose[9 + i] += q * pose[3 * i + 2];
        }
    }
}

/* What the joints from a body's on do to it within half a piece, summed up: see drift_t */
static void place_drift(plan_t *p, int b) {
    const sweep_t *s = p->sweep;
    const double *ends = s->world_line + 6 * b, around = s->line[8 * b + 7];
    drift_t *d = p->drifts + (s->depth + 1) * b;
    memset(d, 0, sizeof *d);
    for (int k = 0; k < s->chain_length[b]; k++, d++) {
        const int f = s->chain[s->depth * b + k], turning = s->kind[f] == TURNING;
        const double *pose = s->pose + 12 * f, way = p->gone[f], off = fabs(way), a[3] = {pose[2], pose[5], pose[8]};
        double u[3], most = 0.0;
        d[1] = d[0];
        if (off == 0.0) continue;
        if (!turning) {
            along3(d->linear, way, a, d[1].linear);
            d[1].reached += off, d[1].off += off, d[1].bent -= 2.0 * off * d->turned;
            continue;
        }
        for (int e = 0; e < 2; e++) {
            minus3(ends + 3 * e, pose + 9, u);
            const double along = dot3(u, a), square = dot3(u, u) - along * along;
            if (square > most) most = square;
        }
        const double far = (off < 2.0 ? off : 2.0) * (sqrt(most) + around);
        cross3(pose + 9, a, u);
        along3(d->angular, way, a, d[1].angular);
        along3(d->linear, way, u, d[1].linear);
        /* To first order about where later joints leave it */
        const double reached = far + off * d->off;
        d[1].off += far, d[1].reached += reached, d[1].turned += off;
        d[1].bent += reached * (off - 2.0 * d[1].turned);
    }
}

/* A body and the ball about it */
static void stand(plan_t *p, int b) {
    sweep_t *s = p->sweep;
    static const double still[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    const int moves = s->body_frame[b] >= 0;
    if (s->stamp[b] == s->node || (!moves && s->stamp[b])) return;
    const double *frame = moves ? s->pose + 12 * s->body_frame[b] : still, *line = s->line + 8 * b;
    double *ends = s->world_line + 6 * b, *ball = p->balls + 4 * b, span[3];
    for (int e = 0; e < 2; e++) {
        turn(frame, line + 3 * e, ends + 3 * e);
        for (int k = 0; k < 3; k++) ends[3 * e + k] += frame[9 + k];
    }
    compose(frame, s->body_place + 12 * b, s->body_pose + 12 * b);
    minus3(ends + 3, ends, span);
    along3(ends, 0.5, span, ball);
    ball[3] = p->radius[b];
    s->stamp[b] = s->node;
    if (p->half > 0.0) place_drift(p, b);
}

/* How far points of a body may be off its place; the first `stop` joints of its chain move it */
static double off_of(const plan_t *p, int b, int stop) {
    return p->half > 0.0 && stop ? p->drifts[(p->sweep->depth + 1) * b + stop].off : 0.0;
}

/* Pairs of a moving body and one in the world are looked at many at a time: against the box about that */
static void prepare(plan_t *p) {
    sweep_t *s = p->sweep;
    p->loose = 0;
    s->node++;
    for (int b = 0; b < s->bodies; b++) {
        const double *line = s->line + 8 * b;
        double span[3];
        minus3(line + 3, line, span);
        p->radius[b] = endless(s->shape[b].kind) ? INFINITY : 0.5 * sqrt(dot3(span, span)) + line[6];
        if (s->body_frame[b] < 0) stand(p, b);
    }
    int blocks = 0;
    for (int b = 0; b < s->bodies; b++) {
        int lane = 0;
        p->first_block[b] = blocks;
        for (int k = 0; k < p->pairs; k++) {
            const int i = s->first[k], j = s->second[k], other = i == b ? j : i;
            if (s->body_frame[b] < 0 || (i != b && j != b)) continue;
            const shape_t *shape = s->shape + other;
            if (s->body_frame[other] >= 0 || !convex(shape) || p->radius[b] == INFINITY) {
                if (i == b || s->body_frame[i] < 0) p->loose_pairs[p->loose++] = k;
                continue;
            }
            double *lanes = p->lanes + 16 * LANES * blocks + lane, *pose = s->body_pose + 12 * other, middle[3];
            for (int m = 0; m < 3; m++) {
                double axis[3] = {m == 0, m == 1, m == 2}, back[3] = {-axis[0], -axis[1], -axis[2]};
                const double up = reach(shape, axis), down = reach(shape, back);
                lanes[(12 + m) * LANES] = 0.5 * (up + down), middle[m] = 0.5 * (up - down);
            }
            for (int m = 0; m < 9; m++) lanes[m * LANES] = pose[m];
            for (int m = 0; m < 3; m++) lanes[(9 + m) * LANES] = pose[9 + m] + dot3(pose + 3 * m, middle);
            lanes[15 * LANES] = s->required[k] + shape->size[4];
            p->block_pairs[LANES * blocks + lane++] = k;
            if (lane == LANES) lane = 0, blocks++;
        }
        if (!lane) continue;
        for (int l = lane; l < LANES; l++) {
            p->block_pairs[LANES * blocks + l] = -1;
            for (int m = 0; m < 16; m++) p->lanes[(16 * blocks + m) * LANES + l] = p->lanes[16 * blocks * LANES + m * LANES];
        }
        blocks++;
    }
    p->first_block[s->bodies] = blocks;
}

/* Pairs that may be nearer than required within the piece, into `out`; how many */
static int near_pairs(plan_t *p, int *out) {
    sweep_t *s = p->sweep;
    int count = 0;
    for (int b = 0; b < s->bodies; b++) {
        if (s->body_frame[b] < 0) continue;
        stand(p, b);
        const double *ball = p->balls + 4 * b, keep = ball[3] + off_of(p, b, s->chain_length[b]);
        for (int block = p->first_block[b]; block < p->first_block[b + 1]; block++) {
            const lanes_t *lane = (const lanes_t *)(p->lanes + 16 * LANES * block);
            const lanes_t x = ball[0] - lane[9], y = ball[1] - lane[10], z = ball[2] - lane[11];
            lanes_t least = lane[15] + keep, square = {0};
            for (int m = 0; m < 3; m++) {
                const lanes_t c = lane[m] * x + lane[3 + m] * y + lane[6 + m] * z;
                const lanes_t size = (lanes_t)((mask_t)c & 0x7fffffffffffffffLL), over = size - lane[12 + m];
                const lanes_t e = (lanes_t)((mask_t)over & (over > 0.0));
                square += e * e;
            }
            const mask_t near = (square < least * least) & (least > 0.0);
            for (int l = 0; l < LANES; l++)
                if (near[l] && p->block_pairs[LANES * block + l] >= 0) out[count++] = p->block_pairs[LANES * block + l];
        }
    }
    for (int m = 0; m < p->loose; m++) {
        const int k = p->loose_pairs[m], i = s->first[k], j = s->second[k];
        const double *one = p->balls + 4 * i, *other = p->balls + 4 * j;
        double d[3];
        minus3(one, other, d);
        const double least = one[3] + other[3] + s->required[k] + off_of(p, i, s->stop_first[k]) + off_of(p, j, s->stop_second[k]);
        if (least > 0.0 && !(dot3(d, d) >= least * least)) out[count++] = k;
    }
    return count;
}

#endif
