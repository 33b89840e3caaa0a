/* Support functions and points of shapes, each about its centre and without the ball that is added to it. */
#ifndef WBC_SHAPES_H
#define WBC_SHAPES_H

#include "scene.h"
#include "vectors.h"

/* Faces that a direction is this nearly normal to count as flat to it */
#define FLAT 1e-9
/* Hulls have so many points or a multiple of it: the last one is there more than once */
#define LANES 8
typedef double lanes_t __attribute__((vector_size(64), aligned(8), may_alias));
typedef long long mask_t __attribute__((vector_size(64), aligned(8), may_alias));

/* size: half sides (3), disc, ball, radius of the bounding sphere */
typedef struct {
    int kind, count;
    const double *size, *points;
} shape_t;

static shape_t shape_of(const scene_t *s, int body) {
    const shape_t out = {s->kind[body], s->hull[2 * body + 1], s->size + 6 * body, s->points + 3 * s->hull[2 * body]};
    return out;
}

/* The first of a hull's points that reach farthest along d; LANES points at a time */
static inline void farthest(const shape_t *a, const double *d, double *out) {
    const double *x = a->points, *y = x + a->count, *z = y + a->count;
    lanes_t most = {0}, at = {0};
    most -= INFINITY;
    for (int k = 0; k < a->count; k += LANES) {
        const lanes_t height = d[0] * *(const lanes_t *)(x + k) + d[1] * *(const lanes_t *)(y + k) + d[2] * *(const lanes_t *)(z + k);
        const mask_t higher = height > most;
        most = (lanes_t)((higher & (mask_t)height) | (~higher & (mask_t)most));
        at = (lanes_t)((higher & (mask_t)(at * 0.0 + k)) | (~higher & (mask_t)at));
    }
    int best = 0, first = (int)at[0];
    for (int l = 1; l < LANES; l++) {
        const int k = (int)at[l] + l;
        if (most[l] > most[best] || (most[l] == most[best] && k < first)) best = l, first = k;
    }
    out[0] = x[first], out[1] = y[first], out[2] = z[first];
}

/* A point that reaches farthest along d, which need not be a unit vector */
static inline void support(const shape_t *a, const double *d, double *out) {
    if (a->kind == HULL) {
        farthest(a, d, out);
        return;
    }
    for (int k = 0; k < 3; k++) out[k] = copysign(a->size[k], d[k]);
    if (a->size[3] > 0.0) {
        const double width = sqrt(d[0] * d[0] + d[1] * d[1]);
        if (width > 0.0) {
            out[0] += a->size[3] * d[0] / width;
            out[1] += a->size[3] * d[1] / width;
        }
    }
}

/* How far the shape reaches along d, times the length of d */
static inline double reach(const shape_t *a, const double *d) {
    if (a->kind == HULL) {
        double point[3];
        support(a, d, point);
        return dot3(point, d);
    }
    double out = a->size[0] * fabs(d[0]) + a->size[1] * fabs(d[1]) + a->size[2] * fabs(d[2]);
    if (a->size[3] > 0.0) out += a->size[3] * sqrt(d[0] * d[0] + d[1] * d[1]);
    return out;
}

/* As support, but the middle of a face that is flat to the unit vector d */
static void middle(const shape_t *a, const double *d, double *out) {
    if (a->kind == HULL) {
        const double *x = a->points, *y = x + a->count, *z = y + a->count, most = reach(a, d);
        double sum[3] = {0.0, 0.0, 0.0};
        int count = 0;
        for (int k = 0; k < a->count; k++) {
            const int again = k > 0 && x[k] == x[k - 1] && y[k] == y[k - 1] && z[k] == z[k - 1];
            if (again || d[0] * x[k] + d[1] * y[k] + d[2] * z[k] < most - FLAT * a->size[5]) continue;
            sum[0] += x[k], sum[1] += y[k], sum[2] += z[k];
            count++;
        }
        for (int k = 0; k < 3; k++) out[k] = sum[k] / count;
        return;
    }
    for (int k = 0; k < 3; k++) out[k] = fabs(d[k]) > FLAT ? copysign(a->size[k], d[k]) : 0.0;
    const double width = sqrt(d[0] * d[0] + d[1] * d[1]);
    if (a->size[3] > 0.0 && width > FLAT) {
        out[0] += a->size[3] * d[0] / width;
        out[1] += a->size[3] * d[1] / width;
    }
}

/* The point of a box or of a disc between two lids that is nearest to p */
static inline void nearest(const shape_t *a, const double *p, double *out) {
    for (int k = 0; k < 3; k++) out[k] = fmin(fmax(p[k], -a->size[k]), a->size[k]);
    if (a->size[3] > 0.0) {
        const double width = sqrt(p[0] * p[0] + p[1] * p[1]);
        const double share = width > a->size[3] ? a->size[3] / width : 1.0;
        out[0] = share * p[0];
        out[1] = share * p[1];
    }
}

#endif
