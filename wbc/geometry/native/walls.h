/* Distance of a solid from the wall round the inside of an endless cylinder, and from the outside of one. */
#ifndef WBC_WALLS_H
#define WBC_WALLS_H

#include "pair.h"

/* A capsule or a ball */
static inline int is_round(const shape_t *a) {
    return a->kind == SUM && a->size[0] == 0.0 && a->size[1] == 0.0 && a->size[3] == 0.0;
}

/* Round outlines are taken as so many edges round them inside an endless cylinder: 8e-5 of their radius too large */
#define EDGES 256

/* Of an ellipsoid: how far it reaches in directions across the cylinder's axis; of others: their corners */
static void measure_tube(const view_t *v, answer_t *out) {
    const shape_t *a = v->a;
    const int lids = a->kind == SUM && a->size[3] > 0.0, smooth = a->kind == ELLIPSOID;
    const int count = a->kind == HULL ? a->count : lids ? 2 * EDGES : smooth ? EDGES : 8;
    const double wide = lids ? a->size[3] / cos(M_PI / EDGES) : 0.0;
    double most = -1.0, local[3], d[3], n[3], at[2] = {0.0, 0.0};
    for (int k = 0; k < count; k++) {
        const double angle = 2 * M_PI * (lids ? k / 2 : k) / EDGES, way[3] = {cos(angle), sin(angle), 0.0};
        if (a->kind == HULL)
            for (int m = 0; m < 3; m++) local[m] = a->points[k + m * a->count];
        else
            for (int m = 0; m < 3; m++) local[m] = (k >> m) & 1 ? a->size[m] : -a->size[m];
        if (lids) local[0] = wide * way[0], local[1] = wide * way[1], local[2] = k % 2 ? a->size[2] : -a->size[2];
        if (smooth) {
            turn(v->R, way, n);
            support(a, n, local);
        }
        minus3(local, v->t, n);
        turn_back(v->R, n, d);
        double square = d[0] * d[0] + d[1] * d[1];
        if (smooth) { /* no point of it is farther off the axis than the greatest of these */
            const double reached = fmax(0.0, dot3(way, d)) / cos(M_PI / EDGES);
            square = reached * reached;
        }
        if (square <= most) continue;
        most = square;
        copy3(local, out->point);
        at[0] = smooth ? way[0] : d[0], at[1] = smooth ? way[1] : d[1];
    }
    const double length = sqrt(most), size = hypot(at[0], at[1]);
    const double across[3] = {size > 0.0 ? at[0] / size : 1.0, size > 0.0 ? at[1] / size : 0.0, 0.0};
    turn(v->R, across, out->normal);
    out->gap = v->b->size[3] - length - a->size[4];
    along3(out->point, a->size[4], out->normal, out->point);
    out->doubtful = 0;
}

/* Has a solid see, in place of the endless cylinder, a piece of it beside it, so long that nothing leaves it by a lid */
static void beside_rod(view_t *v, shape_t *piece) {
    const double z[3] = {v->R[2], v->R[5], v->R[8]}, radius = v->b->size[3];
    *piece = (shape_t){SUM, 0, {0.0, 0.0, 4.0 * (v->a->size[5] + radius), radius}};
    piece->size[5] = hypot(piece->size[2], radius);
    v->b = piece;
    along3(v->t, -dot3(v->t, z), z, v->t);
}

/* A capsule or a ball beside an endless cylinder: their axes seen along the cylinder's are a segment and a point. Whether it is off the
 * axis; all points of the segment are at least as far along the normal as the nearest one, so that it gives the depth too */
static int measure_round_rod(const view_t *v, answer_t *out) {
    const double z[3] = {v->R[2], v->R[5], v->R[8]}, half = v->a->size[2], along[3] = {-z[2] * z[0], -z[2] * z[1], 1.0 - z[2] * z[2]};
    double off[3];
    along3(v->t, -dot3(v->t, z), z, off);
    const double at = along[2] > 1e-12 ? fmin(fmax(off[2] / along[2], -half), half) : 0.0;
    along3(off, -at, along, off);
    const double size = sqrt(dot3(off, off));
    if (size < 1e-9 * v->b->size[3]) return 0;
    for (int k = 0; k < 3; k++) out->normal[k] = off[k] / size, out->point[k] = v->a->size[4] * out->normal[k];
    out->point[2] += at;
    out->gap = size - v->b->size[3] - v->a->size[4];
    out->doubtful = 0;
    return 1;
}

static void measure_rod(const tolerance_t *how, const view_t *v, answer_t *out) {
    if (is_round(v->a) && measure_round_rod(v, out)) return;
    shape_t piece;
    view_t beside = *v;
    beside_rod(&beside, &piece);
    measure_bounded(how, &beside, out);
}

#endif
