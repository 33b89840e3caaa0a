/* Rows for corners and ends of pairs that are close: see wbc/proximity/corners.py. */
#ifndef WBC_CORNERS_H
#define WBC_CORNERS_H

#include "pairs.h"

/* A corner no farther than this from the core of the other body is inside, and has no row [m] */
#define INSIDE 1e-6
/* A shape has at most this many: a hull, and both rims of a cylinder */
#define MOST_CORNERS 48
/* Corners of a hull that are nearer to each other than this part of its bounding sphere's radius count as one */
#define TOGETHER 0.3
/* By how much a hull with more corners than these is tilted to find what comes down first [rad] */
#define TILT 0.1
/* In so many directions */
#define TILTS 4

typedef struct {
    double gap, line[6], place[3];
    int own, rolls;
} corner_t;

static void line_through(const double *point, const double *normal, double *line) {
    copy3(normal, line);
    cross3(point, normal, line + 3);
}

/* Whether it is a hull with more corners than are listed, in front of a half-space */
static int rolls(const scene_t *s, int own, int other) {
    const shape_t *shape = s->shape + own;
    return s->shape[other].kind == PLANE && shape->kind == HULL && shape->count >= s->corner_count[own] + LANES;
}

/* The point of a hull that is lowest above a half-space after tilt number c */
static void lowest_tilted(const scene_t *s, int own, int other, int c, double *out) {
    const double *O = s->body_pose + 12 * own, *T = s->body_pose + 12 * other, way = 2.0 * M_PI * (c + 0.5) / TILTS;
    const double down[3] = {TILT * cos(way), TILT * sin(way), -1.0};
    double world[3], local[3];
    turn(T, down, world);
    turn_back(O, world, local);
    support(s->shape + own, local, out);
}

/* Corner number c of body `own` against body `other`; the normal times sign */
static void corner_row(const scene_t *s, int own, int other, int c, double sign, corner_t *out) {
    const double *O = s->body_pose + 12 * own, *T = s->body_pose + 12 * other;
    const shape_t *shape = s->shape + other;
    double corner[3], point[3], offset[3], local[3], core[3], normal[3];
    out->gap = s->far;
    memset(out->line, 0, sizeof out->line);
    copy3(s->corner + 3 * (own * s->width + c), corner);
    out->rolls = rolls(s, own, other);
    if (out->rolls) lowest_tilted(s, own, other, c, corner);
    turn(O, corner, point);
    for (int k = 0; k < 3; k++) point[k] += O[9 + k];
    copy3(point, out->place);
    out->own = own;
    minus3(point, T + 9, offset);
    turn_back(T, offset, local);
    double length = local[2], ball = 0.0;
    if (shape->kind == PLANE) {
        for (int k = 0; k < 3; k++) normal[k] = -sign * T[3 * k + 2];
    } else {
        nearest(shape, local, core);
        minus3(core, local, offset);
        length = sqrt(dot3(offset, offset)), ball = shape->size[4];
        if (length <= INSIDE) return;
        turn(T, offset, normal);
        for (int k = 0; k < 3; k++) normal[k] *= sign / length;
    }
    out->gap = length - s->shape[own].size[4] - ball;
    line_through(point, normal, out->line);
}

/* All corners of a pair; how many */
static int corners_of(const scene_t *s, int pair, corner_t *found) {
    const int bodies[2] = {s->first[pair], s->second[pair]};
    const double more = gap_of(s, pair) - s->answer[7 * pair];
    int count = 0;
    for (int side = 0; side < 2; side++) {
        const int own = bodies[side], other = bodies[1 - side];
        if (s->shape[other].kind != SUM && s->shape[other].kind != PLANE) continue;
        const int all = rolls(s, own, other) ? TILTS : s->corner_count[own];
        for (int c = 0; c < all; c++) {
            corner_row(s, own, other, c, side ? -1.0 : 1.0, found + count);
            if (found[count].gap < s->far / 2) found[count++].gap += more;
        }
    }
    return count;
}

/* The nearest corner that is not taken, which takes those of its hull that count as one with it; -1 without any */
static int next_corner(const scene_t *s, const corner_t *found, int count, signed char *taken) {
    int best = -1;
    for (int k = 0; k < count; k++)
        if (!taken[k] && (best < 0 || found[k].gap < found[best].gap)) best = k;
    if (best < 0) return best;
    const shape_t *shape = s->shape + found[best].own;
    const double apart = shape->kind == HULL ? (found[best].rolls ? FLAT : TOGETHER) * shape->size[5] : 0.0;
    taken[best] = 1;
    for (int k = 0; apart > 0.0 && k < count; k++) {
        double off[3];
        minus3(found[k].place, found[best].place, off);
        if (found[k].own == found[best].own && dot3(off, off) < apart * apart) taken[k] = 1;
    }
    return best;
}

/* The nearest corners of a row's pair, in a fixed order */
static void corner_rows(scene_t *s, int row) {
    const int pair = s->row_pair[row], more = s->corners;
    corner_t found[2 * MOST_CORNERS];
    signed char taken[2 * MOST_CORNERS] = {0};
    int order[2 * MOST_CORNERS], all = corners_of(s, pair, found), count = 0;
    for (int k; count < more && (k = next_corner(s, found, all, taken)) >= 0; count++) order[count] = k;
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
