/* Rows for corners and ends of pairs that are close: see wbc/proximity/corners.py. */
#ifndef WBC_CORNERS_H
#define WBC_CORNERS_H

#include "pairs.h"

/* A corner no farther than this from the core of the other body is inside, and has no row [m] */
#define INSIDE 1e-6
/* A shape has at most this many: a hull, and both rims of a cylinder */
#define MOST_CORNERS 16

typedef struct {
    double gap, line[6];
} corner_t;

static void line_through(const double *point, const double *normal, double *line) {
    copy3(normal, line);
    cross3(point, normal, line + 3);
}

/* Corner number c of body `own` against body `other`; the normal times sign */
static void corner_row(const scene_t *s, int own, int other, int c, double sign, corner_t *out) {
    const double *O = s->body_pose + 12 * own, *T = s->body_pose + 12 * other;
    const shape_t *shape = s->shape + other;
    double point[3], offset[3], local[3], core[3], normal[3];
    out->gap = s->far;
    memset(out->line, 0, sizeof out->line);
    turn(O, s->corner + 3 * (own * s->width + c), point);
    for (int k = 0; k < 3; k++) point[k] += O[9 + k];
    minus3(point, T + 9, offset);
    turn_back(T, offset, local);
    nearest(shape, local, core);
    minus3(core, local, offset);
    const double length = sqrt(dot3(offset, offset));
    if (length <= INSIDE) return;
    turn(T, offset, normal);
    for (int k = 0; k < 3; k++) normal[k] *= sign / length;
    out->gap = length - s->shape[own].size[4] - shape->size[4];
    line_through(point, normal, out->line);
}

/* All corners of a pair; how many */
static int corners_of(const scene_t *s, int pair, corner_t *found) {
    const int bodies[2] = {s->first[pair], s->second[pair]};
    const double more = gap_of(s, pair) - s->answer[7 * pair];
    int count = 0;
    for (int side = 0; side < 2; side++) {
        const int own = bodies[side], other = bodies[1 - side];
        if (s->shape[other].kind != SUM) continue;
        for (int c = 0; c < s->corner_count[own]; c++) {
            corner_row(s, own, other, c, side ? -1.0 : 1.0, found + count);
            if (found[count].gap < s->far / 2) found[count++].gap += more;
        }
    }
    return count;
}

/* The nearest corners of a row's pair, in a fixed order */
static void corner_rows(scene_t *s, int row) {
    const int pair = s->row_pair[row], more = s->corners;
    corner_t found[2 * MOST_CORNERS];
    int order[2 * MOST_CORNERS], count = corners_of(s, pair, found);
    for (int k = 0; k < count; k++) order[k] = k;
    for (int i = 1; i < count; i++) /* by distance; they are few */
        for (int k = i; k > 0 && found[order[k]].gap < found[order[k - 1]].gap; k--) {
            const int swap = order[k];
            order[k] = order[k - 1], order[k - 1] = swap;
        }
    if (count > more) count = more;
    for (int i = 1; i < count; i++) /* by number */
        for (int k = i; k > 0 && order[k] < order[k - 1]; k--) {
            const int swap = order[k];
            order[k] = order[k - 1], order[k - 1] = swap;
        }
    for (int k = 0; k < more; k++) {
        const int at = s->rows + row * more + k;
        if (k < count) {
            s->distance[at] = found[order[k]].gap;
            memcpy(s->line + 6 * at, found[order[k]].line, 6 * sizeof(double));
            memcpy(s->side + (size_t)s->nv * at, s->pair_side + (size_t)s->nv * pair, s->nv * sizeof(double));
        } else {
            s->distance[at] = s->far;
            memset(s->line + 6 * at, 0, 6 * sizeof(double));
            memset(s->side + (size_t)s->nv * at, 0, s->nv * sizeof(double));
        }
    }
}

static void no_corner_rows(scene_t *s, int row) {
    const int at = s->rows + row * s->corners;
    for (int k = 0; k < s->corners; k++) s->distance[at + k] = s->far;
    memset(s->drift + at, 0, s->corners * sizeof(double));
    memset(s->line + 6 * at, 0, 6 * s->corners * sizeof(double));
    memset(s->side + (size_t)s->nv * at, 0, (size_t)s->nv * s->corners * sizeof(double));
}

#endif
