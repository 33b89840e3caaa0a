/* Signed distance of two bodies at their present places; never above the true one but for rounding. */
#ifndef WBC_DISTANCE_H
#define WBC_DISTANCE_H

#include "motion.h"
#include "segment_box.h"
#include "segments.h"

/* Lengths are metres: what counts as touching, as equal, as near contact */
static const tolerance_t HOW = {1e-10, 1e-9, 1e-5};

/* Capsules and balls, by the segments that are their cores */
static void distance_of_round(const double *one, double ra, const double *other, double rb, answer_t *out) {
    double s, t, a[3], b[3], n[3];
    const double length = sqrt(segments(one, one + 3, other, other + 3, &s, &t));
    for (int k = 0; k < 3; k++) {
        a[k] = one[k] + s * (one[3 + k] - one[k]);
        b[k] = other[k] + t * (other[3 + k] - other[k]);
    }
    minus3(b, a, n);
    for (int k = 0; k < 3; k++) out->normal[k] = length > 0.0 ? n[k] / length : k == 2;
    along3(a, ra, out->normal, out->point);
    out->gap = length - ra - rb;
}

/* A capsule or ball i and a box j; 0 where the core of the one goes through the other */
static int distance_of_box(const sweep_t *s, int i, int j, answer_t *out) {
    const double *pose = s->body_pose + 12 * j, *ends = s->world_line + 6 * i, radius = s->line[8 * i + 6];
    double d[3], local[6], span[3], n[3], t;
    for (int e = 0; e < 2; e++) {
        minus3(ends + 3 * e, pose + 9, d);
        turn_back(pose, d, local + 3 * e);
    }
    const double core = segment_box(local, local + 3, s->shape[j].size, &t, n);
    if (!(core > HOW.trust)) return 0;
    turn(pose, n, out->normal);
    for (int k = 0; k < 3; k++) out->normal[k] = -out->normal[k];
    minus3(ends + 3, ends, span);
    along3(ends, t, span, out->point);
    along3(out->point, radius, out->normal, out->point);
    out->gap = core - radius - s->shape[j].size[4];
    return 1;
}

static int is_box(const shape_t *a) { return a->kind == SUM && a->size[3] == 0.0; }

static void distance_of(const sweep_t *s, int i, int j, answer_t *out) {
    const int round_i = is_round(s->shape + i), round_j = is_round(s->shape + j);
    if (round_i && round_j)
        distance_of_round(s->world_line + 6 * i, s->line[8 * i + 6], s->world_line + 6 * j, s->line[8 * j + 6], out);
    else if (round_i && is_box(s->shape + j) && distance_of_box(s, i, j, out))
        return;
    else if (round_j && is_box(s->shape + i) && distance_of_box(s, j, i, out)) {
        along3(out->point, out->gap, out->normal, out->point);
        for (int k = 0; k < 3; k++) out->normal[k] = -out->normal[k];
    } else
        measure_shapes(&HOW, s->shape + i, s->body_pose + 12 * i, s->shape + j, s->body_pose + 12 * j, out);
}

/* A bound from below: the capsules about both bodies */
static double capsules_of(const sweep_t *s, int i, int j) {
    const double *one = s->world_line + 6 * i, *other = s->world_line + 6 * j;
    return segment_distance(one, one + 3, other, other + 3) - s->line[8 * i + 6] - s->line[8 * j + 6];
}

/* Fixed in the world and without end */
static int endless(int kind) { return kind == PLANE || kind == TUBE || kind == ROD; }

/* A quick bound from below: the balls about both bodies; above a half-space, from a cylinder */
static double bound_of(const sweep_t *s, int i, int j) {
    const double *one = s->world_line + 6 * i, *other = s->world_line + 6 * j;
    const int wall = endless(s->shape[j].kind) ? j : i, kind = s->shape[wall].kind;
    double a[3], b[3], radii = s->line[8 * i + 6];
    if (!endless(kind)) {
        double d[3], span[3], balls = 0.0;
        for (int k = 0; k < 3; k++) d[k] = 0.5 * (one[k] + one[3 + k] - other[k] - other[3 + k]);
        minus3(one + 3, one, span);
        balls += 0.5 * sqrt(dot3(span, span));
        minus3(other + 3, other, span);
        balls += 0.5 * sqrt(dot3(span, span));
        radii += s->line[8 * j + 6];
        return sqrt(dot3(d, d)) - balls - radii;
    }
    const double *W = s->body_pose + 12 * wall, *ends = wall == j ? one : other, radius = s->shape[wall].size[3];
    radii = s->line[8 * (wall == j ? i : j) + 6];
    double least = INFINITY, most = 0.0, flat[2][3];
    for (int e = 0; e < 2; e++) {
        minus3(ends + 3 * e, W + 9, a);
        turn_back(W, a, b);
        least = fmin(least, b[2]);
        most = fmax(most, b[0] * b[0] + b[1] * b[1]);
        flat[e][0] = b[0], flat[e][1] = b[1], flat[e][2] = 0.0;
    }
    if (kind == PLANE) return least - radii;
    if (kind == TUBE) return radius - sqrt(most) - radii;
    const double zero[3] = {0};
    return segment_distance(flat[0], flat[1], zero, zero) - radius - radii;
}

#endif
