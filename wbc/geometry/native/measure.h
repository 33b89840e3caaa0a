/* Signed distance of any two shapes of which one is convex and of finite size, at their places in the world. */
#ifndef WBC_MEASURE_H
#define WBC_MEASURE_H

#include "pieces.h"
#include "walls.h"

static inline int convex(const shape_t *a) { return a->kind < PLANE; }

/* A and B: poses of the shapes' centres; the answer is in the world */
static void measure_shapes(const tolerance_t *how, const shape_t *a, const double *A, const shape_t *b, const double *B,
                           answer_t *out) {
    const int turned = a->kind > PLANE;
    answer_t found;
    view_t v;
    view_of(turned ? b : a, turned ? B : A, turned ? a : b, turned ? A : B, &v);
    switch (v.a->kind == PLANE ? PLANE : v.b->kind) {
    case PLANE: measure_plane(&v, &found); break;
    case TUBE: measure_tube(&v, &found); break;
    case ROD: measure_rod(how, &v, &found); break;
    case MESH: measure_mesh(&v, &found); break;
    case FIELD: measure_field(how, &v, &found); break;
    default: measure_bounded(how, &v, &found);
    }
    const double *own = turned ? B : A;
    out->gap = found.gap, out->doubtful = found.doubtful;
    turn(own, found.normal, out->normal);
    turn(own, found.point, out->point);
    for (int k = 0; k < 3; k++) out->point[k] += own[9 + k];
    if (!turned) return;
    along3(out->point, out->gap, out->normal, out->point);
    for (int k = 0; k < 3; k++) out->normal[k] = -out->normal[k];
}

#endif
