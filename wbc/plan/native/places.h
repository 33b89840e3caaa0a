/* Where joints and bodies are in the middle of a piece of a motion from x to y, how far they may be off it, and which pairs of bodies
 * are near to each other there. All joints turn about z, or shift along it: see wbc/plan/coordinates.py. */
#ifndef WBC_PLACES_H
#define WBC_PLACES_H

#include "plan.h"

#ifdef __AVX512DQ__
#include <immintrin.h>
#endif

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

/* What never changes of bodies: balls about them, boxes about those that stand in the world, and how far points of the others can
 * be from the axis of each joint of their chain, or 1 where it shifts */
static void prepare(plan_t *p) {
    sweep_t *s = p->sweep;
    s->node++;
    for (int b = 0; b < s->bodies; b++) {
        const double *line = s->line + 8 * b;
        double span[3], far = 0.0;
        minus3(line + 3, line, span);
        p->radius[b] = endless(s->shape[b].kind) ? INFINITY : 0.5 * sqrt(dot3(span, span)) + line[6];
        for (int e = 0; e < 2; e++) far = fmax(far, sqrt(dot3(line + 3 * e, line + 3 * e)) + line[7]);
        for (int f = s->body_frame[b], k = 0; f >= 0; f = s->parent[f]) {
            const double *place = s->place + 12 * f, *axis = s->axis + 5 * f;
            if (k < s->chain_length[b] && s->chain[s->depth * b + k] == f)
                p->reaches[s->depth * b + k++] = s->kind[f] == TURNING ? far : 1.0;
            far += sqrt(dot3(place + 9, place + 9));
            if (s->kind[f] != SHIFTING) continue;
            const int c = s->coordinate[f];
            far += fmax(fabs(axis[3] * p->low[c] + axis[4]), fabs(axis[3] * p->high[c] + axis[4]));
        }
        if (s->body_frame[b] >= 0) continue;
        stand(p, b);
        if (!convex(s->shape + b)) continue;
        double *box = p->boxes + 15 * b;
        const double *pose = s->body_pose + 12 * b;
        memcpy(box, pose, 12 * sizeof *box);
        for (int m = 0; m < 3; m++) {
            const double axis[3] = {m == 0, m == 1, m == 2}, back[3] = {-axis[0], -axis[1], -axis[2]};
            const double up = reach(s->shape + b, axis), down = reach(s->shape + b, back);
            for (int i = 0; i < 3; i++) box[9 + i] += 0.5 * (up - down) * pose[3 * i + m];
            box[12 + m] = 0.5 * (up + down);
        }
    }
    for (int k = 0; k < p->pairs; k++) {
        const int i = s->first[k], j = s->second[k], swap = s->body_frame[i] < 0, ball = swap ? j : i, other = swap ? i : j;
        const int one = (s->depth + 1) * i + s->stop_first[k], two = (s->depth + 1) * j + s->stop_second[k];
        const int moves = s->body_frame[other] >= 0, seen = p->radius[i] < INFINITY && p->radius[j] < INFINITY;
        const double about = moves ? p->radius[other] : s->shape[other].size[4];
        p->outlines[k] = (outline_t){s->required[k] + p->radius[ball] + about, !seen ? UNSEEN : moves ? BALLS : BALL_BOX,
                                     ball, other, swap ? two : one, swap ? one : two};
    }
}

/* Bits of a lane each */
static unsigned bits(mask_t mask) {
#ifdef __AVX512DQ__
    return _mm512_movepi64_mask((__m512i)mask);
#else
    unsigned out = 0;
    for (int l = 0; l < LANES; l++) out |= (unsigned)(mask[l] & 1) << l;
    return out;
#endif
}

static lanes_t chosen(mask_t mask, lanes_t one, lanes_t other) { return (lanes_t)((mask & (mask_t)one) | (~mask & (mask_t)other)); }

/* Less quarter turns, of which the last digits of what was rounded tell two bits, then the polynomials of fdlibm's kernels */
static void sine_cosine(lanes_t x, lanes_t *sine, lanes_t *cosine) {
    const double round = 0x1.8p52;
    const lanes_t rounded = x * 6.36619772367581382433e-01 + round, k = rounded - round;
    const lanes_t r = ((x - k * 1.57079632673412561417e+00) - k * 6.07710050630396597660e-11) - k * 2.02226624879595063154e-21, z = r * r;
    const lanes_t s = r + r * z * (-1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 +
                      z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))));
    const lanes_t c = 1.0 - 0.5 * z + z * z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 +
                      z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))));
    const mask_t quarters = (mask_t)rounded, odd = -(quarters & 1), low = ((quarters & 2) << 62), high = (((quarters + 1) & 2) << 62);
    *sine = (lanes_t)((mask_t)chosen(odd, c, s) ^ low);
    *cosine = (lanes_t)((mask_t)chosen(odd, s, c) ^ high);
}

/* All joints, and the balls about bodies that move, at LANES places x + t (y - x) */
static void place_lanes(plan_t *p, lanes_t t) {
    const sweep_t *s = p->sweep;
    for (int f = 0; f < s->frames; f++) {
        lanes_t *pose = (lanes_t *)p->lane_pose + 12 * f;
        const double *B = s->place + 12 * f, *axis = s->axis + 5 * f;
        if (s->parent[f] < 0) {
            for (int m = 0; m < 12; m++) pose[m] = (lanes_t){0} + B[m];
        } else {
            const lanes_t *A = (const lanes_t *)p->lane_pose + 12 * s->parent[f];
            for (int i = 0; i < 3; i++) {
                for (int m = 0; m < 3; m++) pose[3 * i + m] = A[3 * i] * B[m] + A[3 * i + 1] * B[3 + m] + A[3 * i + 2] * B[6 + m];
                pose[9 + i] = A[3 * i] * B[9] + A[3 * i + 1] * B[10] + A[3 * i + 2] * B[11] + A[9 + i];
            }
        }
        if (s->kind[f] == FIXED) continue;
        const int k = s->coordinate[f];
        const lanes_t q = axis[3] * (p->x[k] + t * (p->y[k] - p->x[k])) + axis[4];
        if (s->kind[f] == TURNING) {
            lanes_t sine, cosine;
            sine_cosine(q, &sine, &cosine);
            for (int i = 0; i < 9; i += 3) {
                const lanes_t a = pose[i], b = pose[i + 1];
                pose[i] = cosine * a + sine * b, pose[i + 1] = cosine * b - sine * a;
            }
        } else {
            for (int i = 0; i < 3; i++) pose[9 + i] += q * pose[3 * i + 2];
        }
    }
    for (int b = 0; b < s->bodies; b++) {
        if (s->body_frame[b] < 0) continue;
        lanes_t *centre = (lanes_t *)p->lane_centre + 3 * b;
        const lanes_t *pose = (const lanes_t *)p->lane_pose + 12 * s->body_frame[b];
        const double *line = s->line + 8 * b;
        for (int i = 0; i < 3; i++) {
            centre[i] = pose[9 + i];
            for (int m = 0; m < 3; m++) centre[i] += 0.5 * (line[m] + line[3 + m]) * pose[3 * i + m];
        }
    }
}

/* How far points of bodies may be off within `half` of the motion: what their first joints do, summed up */
static void place_offs(plan_t *p, double half) {
    const sweep_t *s = p->sweep;
    for (int b = 0; b < s->bodies; b++) {
        double *off = p->offs + (s->depth + 1) * b;
        off[0] = 0.0;
        for (int k = 0; k < s->chain_length[b]; k++) {
            const int f = s->chain[s->depth * b + k], c = s->coordinate[f];
            const double way = fabs(s->axis[5 * f + 3] * (p->y[c] - p->x[c]) * half);
            off[k + 1] = off[k];
            if (way > 0.0) off[k + 1] += (s->kind[f] == TURNING ? fmin(way, 2.0) : way) * p->reaches[s->depth * b + k];
        }
    }
}

/* Pairs that may be nearer than required, lane by lane into `near`: within a piece where `share` is 1, at its middle where it is 0 */
static void near_pairs(plan_t *p, lanes_t share) {
    memset(p->near_count, 0, sizeof p->near_count);
    for (int k = 0; k < p->pairs; k++) {
        const outline_t *pair = p->outlines + k;
        const double off = p->offs[pair->ball_off] + p->offs[pair->other_off];
        unsigned near = (1u << LANES) - 1;
        if (pair->form != UNSEEN && off < INFINITY) {
            const lanes_t *ball = (const lanes_t *)p->lane_centre + 3 * pair->ball, reached = pair->least + share * off;
            lanes_t square = {0};
            if (pair->form == BALLS) {
                const lanes_t *other = (const lanes_t *)p->lane_centre + 3 * pair->other;
                for (int m = 0; m < 3; m++) square += (ball[m] - other[m]) * (ball[m] - other[m]);
            } else {
                const double *box = p->boxes + 15 * pair->other;
                const lanes_t x = ball[0] - box[9], y = ball[1] - box[10], z = ball[2] - box[11];
                for (int m = 0; m < 3; m++) {
                    const lanes_t c = box[m] * x + box[3 + m] * y + box[6 + m] * z;
                    const lanes_t over = (lanes_t)((mask_t)c & 0x7fffffffffffffffLL) - box[12 + m], e = (lanes_t)((mask_t)over & (over > 0.0));
                    square += e * e;
                }
            }
            near = bits((square < reached * reached) & (reached > 0.0));
        }
        for (; near; near &= near - 1) {
            const int l = __builtin_ctz(near);
            p->near[p->pairs * l + p->near_count[l]++] = k;
        }
    }
}

/* The joints at the place of a lane, which is the middle of a piece of which `half` is half */
static void stand_at(plan_t *p, int lane, double half) {
    sweep_t *s = p->sweep;
    s->node++;
    p->half = half;
    for (int m = 0; m < 12 * s->frames; m++) s->pose[m] = p->lane_pose[LANES * m + lane];
    for (int f = 0; f < s->frames; f++) {
        const int moves = s->kind[f] != FIXED;
        p->gone[f] = moves ? s->axis[5 * f + 3] * (p->y[s->coordinate[f]] - p->x[s->coordinate[f]]) * half : 0.0;
    }
}

#endif
