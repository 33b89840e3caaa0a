/* Where joints and bodies are in the middle of a piece of a motion from x to y, how far they may be off it, and which pairs of bodies
 * are near to each other there. All joints turn about z, or shift along it: see wbc/plan/coordinates.py. */
#pragma once

#include "plan.h"

/* A body at the place of its frame */
static void stand(plan_t *p, int b) {
    sweep_t *s = p->sweep;
    if (s->stamp[b] == s->node || (s->body_frame[b] < 0 && s->stamp[b])) return;
    place_core(s, b);
    s->stamp[b] = s->node;
}

/* What stays of bodies until they or the limits change: balls about them, boxes about those that stand in the world, and how far points
 * of the others can be from the axis of each joint of their chain, or 1 where it shifts */
void wbc_plan_prepare(plan_t *p) {
    sweep_t *s = p->sweep;
    double radius[s->bodies + 1];
    s->node++;
    for (int b = 0; b < s->bodies; b++) {
        const double *line = s->line + 8 * b;
        double span[3], far = 0.0;
        minus3(line + 3, line, span);
        radius[b] = endless(s->shape[b].kind) ? INFINITY : 0.5 * sqrt(dot3(span, span)) + line[6];
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
    for (int k = 0; k < p->pairs + p->blocks; k++) {
        const int i = s->first[k], j = s->second[k], swap = s->body_frame[i] < 0, ball = swap ? j : i, other = swap ? i : j;
        const int one = (s->depth + 1) * i + s->stop_first[k], two = (s->depth + 1) * j + s->stop_second[k];
        const int moves = s->body_frame[other] >= 0, seen = radius[i] < INFINITY && radius[j] < INFINITY;
        const double about = moves ? radius[other] : s->shape[other].size[4];
        const shape_t *shape = s->shape + other;
        p->outlines[k] = (outline_t){radius[ball] + about, s->line[8 * ball + 6] + (moves ? s->line[8 * other + 6] : shape->size[4]),
                                     !seen ? UNSEEN : moves ? BALLS : BALL_BOX, ball, other, swap ? two : one, swap ? one : two,
                                     seen && is_round(s->shape + ball) && (moves ? is_round(shape) : convex(shape)), moves || is_box(shape)};
    }
}

/* All joints in the middles of some stretches, LANES at most, and how far they go until their ends */
static void place_lanes(plan_t *p, const stretch_t *all, int count) {
    const sweep_t *s = p->sweep;
    p->lane_node++;
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
        lanes_t *gone = (lanes_t *)p->gone + f, q = {0};
        *gone = (lanes_t){0};
        if (s->kind[f] == FIXED) continue;
        for (int l = 0, k = s->coordinate[f]; l < count; l++) {
            const stretch_t *at = all + l;
            const double way = axis[3] * (at->y[k] - at->x[k]);
            q[l] = axis[3] * at->x[k] + axis[4] + 0.5 * (at->low + at->high) * way, (*gone)[l] = 0.5 * (at->high - at->low) * way;
        }
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
}

/* The ball about a body that moves, there, and how far points of it may be off at most: what its first joints do, summed up */
static void ball_lanes(plan_t *p, int b) {
    const sweep_t *s = p->sweep;
    if (s->body_frame[b] < 0 || p->ball_stamp[b] == p->lane_node) return;
    p->ball_stamp[b] = p->lane_node;
    lanes_t *centre = (lanes_t *)p->lane_centre + 3 * b, *off = (lanes_t *)p->offs + (s->depth + 1) * b;
    const lanes_t *pose = (const lanes_t *)p->lane_pose + 12 * s->body_frame[b];
    const double *line = s->line + 8 * b;
    for (int i = 0; i < 3; i++) {
        centre[i] = pose[9 + i];
        for (int m = 0; m < 3; m++) centre[i] += 0.5 * (line[m] + line[3 + m]) * pose[3 * i + m];
    }
    for (int k = 0; k < s->chain_length[b]; k++) {
        const int f = s->chain[s->depth * b + k];
        const lanes_t way = abs_lanes(((const lanes_t *)p->gone)[f]), most = s->kind[f] == TURNING ? min_lanes(way, (lanes_t){0} + 2.0) : way;
        off[k + 1] = off[k] + chosen(way > 0.0, most * p->reaches[s->depth * b + k], (lanes_t){0});
    }
}

/* The joints at the place of a lane */
static void stand_at(plan_t *p, int lane) {
    sweep_t *s = p->sweep;
    s->node++;
    p->lane = lane;
    for (int m = 0; m < 12 * s->frames; m++) s->pose[m] = p->lane_pose[LANES * m + lane];
}
