/* Support functions and points of shapes, each about its centre and without the ball that is added to it. */
#ifndef WBC_SHAPES_H
#define WBC_SHAPES_H

#include "vectors.h"

#ifdef __AVX512DQ__
#include <immintrin.h>
#endif

/* What a shape is, see wbc/shapes/solid.py: a box, a disc across z and a ball added up (spheres, capsules, boxes, cylinders);
 * a hull; an ellipsoid; a half-space z <= 0; the wall round an endless cylinder about z, and that cylinder; a surface of
 * triangles; a map of heights */
enum { SUM, HULL, ELLIPSOID, PLANE, TUBE, ROD, MESH, FIELD };

/* Faces that a direction is this nearly normal to count as flat to it */
#define FLAT 1e-9
/* Hulls have so many points or a multiple of it: the last one is there more than once */
#define LANES 8
typedef double lanes_t __attribute__((vector_size(64), aligned(8), may_alias));
typedef long long mask_t __attribute__((vector_size(64), aligned(8), may_alias));

/* Bits of a lane each */
static inline unsigned bits(mask_t mask) {
#ifdef __AVX512DQ__
    return _mm512_movepi64_mask((__m512i)mask);
#else
    unsigned out = 0;
    for (int l = 0; l < LANES; l++) out |= (unsigned)(mask[l] & 1) << l;
    return out;
#endif
}

typedef struct {
    int kind;
    int count;            /* points of a hull; triangles of a mesh that is closed, else 0; columns of heights of a field */
    double size[6];       /* half sides or semi-axes (3), disc or radius, ball, radius of the bounding sphere; of a field its
                             half sides and the depth of its base */
    const double *points; /* all x, all y, all z of a hull; so of each triangle, 8 points with the last again; heights of a
                             field, row by row along y */
    const int *tree;      /* of a mesh or a field, 2 each: left and right child, or -1 - first and -1 - last of its pieces */
    const double *box;    /* 6 each: least and greatest corner */
} shape_t;

/* [m]: what counts as touching, as equal, and as near contact */
typedef struct {
    double touch, tie, trust;
} tolerance_t;

/* Distance, normal from A to B and point of A; whether the normal is a declared one */
typedef struct {
    double gap, normal[3], point[3];
    int doubtful;
} answer_t;

/* How far LANES points of a hull, from number k on, reach along d */
static inline lanes_t heights(const shape_t *a, const double *d, int k) {
    const double *x = a->points + k, *y = x + a->count, *z = y + a->count;
    return d[0] * *(const lanes_t *)x + d[1] * *(const lanes_t *)y + d[2] * *(const lanes_t *)z;
}

/* The first of a hull's points that reach farthest along d; LANES points at a time */
static inline void farthest(const shape_t *a, const double *d, double *out) {
    const double *x = a->points, *y = x + a->count, *z = y + a->count;
    lanes_t most = {0}, at = {0};
    most -= INFINITY;
    for (int k = 0; k < a->count; k += LANES) {
        const lanes_t height = heights(a, d, k);
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

/* Length of d after the stretch by the semi-axes of an ellipsoid: how far that reaches along d */
static inline double stretched(const shape_t *a, const double *d) {
    const double e[3] = {a->size[0] * d[0], a->size[1] * d[1], a->size[2] * d[2]};
    return sqrt(dot3(e, e));
}

/* A point that reaches farthest along d, which need not be a unit vector */
static inline void support(const shape_t *a, const double *d, double *out) {
    if (a->kind == HULL) {
        farthest(a, d, out);
        return;
    }
    if (a->kind == ELLIPSOID) {
        const double length = stretched(a, d);
        for (int k = 0; k < 3; k++) out[k] = length > 0.0 ? a->size[k] * a->size[k] * d[k] / length : 0.0;
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
    if (a->kind == ELLIPSOID) return stretched(a, d);
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
        for (int first = 0; first < a->count; first += LANES) {
            /* Most are far from it: they are not looked at one by one */
            if (!bits(heights(a, d, first) >= most - 2.0 * FLAT * a->size[5])) continue;
            for (int k = first; k < first + LANES; k++) {
                const int again = k > 0 && x[k] == x[k - 1] && y[k] == y[k - 1] && z[k] == z[k - 1];
                if (again || d[0] * x[k] + d[1] * y[k] + d[2] * z[k] < most - FLAT * a->size[5]) continue;
                sum[0] += x[k], sum[1] += y[k], sum[2] += z[k];
                count++;
            }
        }
        for (int k = 0; k < 3; k++) out[k] = sum[k] / count;
        return;
    }
    if (a->kind == ELLIPSOID) {
        support(a, d, out);
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
