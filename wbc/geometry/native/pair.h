/* Signed distance, normal and witness of two convex shapes, or of one and a half-space.
 *
 * A normal is declared where shapes lie in each other and none is better than its opposite: the first of the greatest
 * clearance out of the line from centre to centre; the axes z, y, x of A, then of B; what is left of the line across the axes z
 * of A and of B; the cross products of an axis of A and one of B; and their opposites in the same order. Among these are
 * all face normals of two boxes, capsules or balls added up, so that they give the depth of such shapes; and of a ball in
 * a cylinder. */
#ifndef WBC_PAIR_H
#define WBC_PAIR_H

#include "epa.h"

#define DECLARED 36
/* Directions more nearly parallel than this have no cross product */
#define PARALLEL 1e-6
/* How far shapes that overlap are moved apart to find where they touch, in parts of their size */
#define RAISED 0.1

static void view_of(const shape_t *a, const double *A, const shape_t *b, const double *B, view_t *v) {
    double apart_[3];
    v->a = a, v->b = b;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) v->R[3 * i + k] = A[i] * B[k] + A[3 + i] * B[3 + k] + A[6 + i] * B[6 + k];
    minus3(B + 9, A + 9, apart_);
    turn_back(A, apart_, v->t);
}

static int list(double (*out)[3], int count, const double *d, double least) {
    const double size = sqrt(dot3(d, d));
    if (!(size > least)) return count;
    for (int k = 0; k < 3; k++) out[count][k] = d[k] / size;
    return count + 1;
}

/* The declared directions without the opposites; seen from A */
static int declare(const view_t *v, double (*out)[3]) {
    const double axes[6][3] = {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}, {v->R[2], v->R[5], v->R[8]},
                               {v->R[1], v->R[4], v->R[7]}, {v->R[0], v->R[3], v->R[6]}};
    const double length = sqrt(dot3(v->t, v->t));
    double d[3];
    int count = length > 0.0 ? list(out, 0, v->t, 0.0) : 0;
    for (int k = 0; k < 6; k++) count = list(out, count, axes[k], 0.0);
    for (int k = 0; k < 6 && length > 0.0; k += 3) {
        along3(v->t, -dot3(v->t, axes[k]), axes[k], d);
        count = list(out, count, d, PARALLEL * length);
    }
    for (int i = 2; i >= 0; i--)
        for (int k = 5; k >= 3; k--) {
            cross3(axes[i], axes[k], d);
            count = list(out, count, d, PARALLEL);
        }
    return count;
}

/* The first declared direction of the greatest clearance, which is returned */
static double best_declared(const view_t *v, double tie, double *normal) {
    double way[DECLARED][3], value[DECLARED], most = -INFINITY;
    const int half = declare(v, way);
    for (int k = 0; k < half; k++)
        for (int m = 0; m < 3; m++) way[half + k][m] = -way[k][m];
    for (int k = 0; k < 2 * half; k++) {
        value[k] = clearance(v, way[k]);
        if (value[k] > most) most = value[k];
    }
    int first = 0;
    while (value[first] < most - tie) first++;
    copy3(way[first], normal);
    return value[first];
}

/* Whether the declared directions hold the deepest one of overlapping shapes */
static int closed(const shape_t *a, const shape_t *b) {
    if (a->kind != SUM || b->kind != SUM) return 0;
    const double *x = a->size, *y = b->size;
    if (x[3] == 0.0 && y[3] == 0.0) return 1;
    /* one of them a ball */
    return (x[0] == 0.0 && x[1] == 0.0 && x[2] == 0.0 && x[3] == 0.0) ||
           (y[0] == 0.0 && y[1] == 0.0 && y[2] == 0.0 && y[3] == 0.0);
}

/* A point of A where the two touch that overlap, for the normal they leave each other by */
static void touching(const view_t *v, double value, const double *normal, double *point) {
    view_t raised = *v;
    const double size = v->a->size[5] + v->b->size[5];
    double n[3], distance;
    along3(v->t, RAISED * size - value, normal, raised.t);
    if (!apart(&raised, 0.0, &distance, n, point)) middle(v->a, normal, point);
}

/* Where a declared normal leaves A and B, in the middle of what is flat to it */
static void between(const view_t *v, double value, const double *normal, double *point) {
    double back[3], b[3], other[3];
    middle(v->a, normal, point);
    turn_back(v->R, normal, back);
    for (int k = 0; k < 3; k++) back[k] = -back[k];
    middle(v->b, back, b);
    turn(v->R, b, other);
    for (int k = 0; k < 3; k++) point[k] = 0.5 * (point[k] + other[k] + v->t[k] - value * normal[k]);
}

static void measure_bounded(const tolerance_t *how, const view_t *v, answer_t *out) {
    const double balls = v->a->size[4] + v->b->size[4];
    double value, other[3];
    if (!apart(v, how->touch, &value, out->normal, out->point)) {
        value = best_declared(v, how->tie, out->normal);
        if (!closed(v->a, v->b)) {
            const double found = depth(v, other);
            if (found > value + how->tie) {
                value = found;
                copy3(other, out->normal);
            }
        }
        touching(v, value, out->normal, out->point);
    }
    out->doubtful = 0;
    for (int k = 0; k < 3; k++) other[k] = -out->normal[k];
    if (value - balls <= how->trust && value - clearance(v, other) <= how->tie) {
        const double found = best_declared(v, how->tie, other);
        if (found >= value - how->tie) { /* always, where the declared ones hold the deepest */
            value = found;
            copy3(other, out->normal);
            between(v, value, out->normal, out->point);
        }
        out->doubtful = 1;
    }
    out->gap = value - balls;
    along3(out->point, v->a->size[4], out->normal, out->point);
}

/* One of the two is a half-space */
static void measure_plane(const view_t *v, answer_t *out) {
    double back[3], d[3], far[3];
    out->doubtful = 0;
    if (v->a->kind == PLANE) {
        const double up[3] = {0.0, 0.0, 1.0};
        copy3(up, out->normal);
        turn_back(v->R, up, back);
        for (int k = 0; k < 3; k++) d[k] = -back[k];
        middle(v->b, d, far);
        turn(v->R, far, out->point);
        for (int k = 0; k < 2; k++) out->point[k] += v->t[k];
        out->point[2] = 0.0;
        out->gap = v->t[2] - reach(v->b, d) - v->b->size[4];
        return;
    }
    for (int k = 0; k < 3; k++) out->normal[k] = -v->R[3 * k + 2];
    middle(v->a, out->normal, out->point);
    along3(out->point, v->a->size[4], out->normal, out->point);
    out->gap = dot3(v->t, out->normal) - reach(v->a, out->normal) - v->a->size[4];
}

#endif
