/* Distance of a solid from what is made of convex pieces in a tree of boxes: the triangles of a surface, the prisms below a
 * map of heights. */
#ifndef WBC_PIECES_H
#define WBC_PIECES_H

#include "pair.h"

/* Deeper than any tree */
#define STACK 128
/* A lifted solid comes down in so many steps at most, until it is so near, in parts of the sizes */
#define STEPS 64
#define LANDED 1e-10

/* The three upper corners of piece k of a field; the diagonal of a cell goes from its corner at the least x and y */
static inline void upper_corners(const shape_t *whole, int k, double (*out)[3]) {
    const int column = k / 2 % (whole->count - 1), row = k / 2 / (whole->count - 1);
    const int right[3] = {0, !(k & 1), 1}, up[3] = {0, k & 1, 1};
    for (int i = 0; i < 3; i++) {
        out[i][0] = (column + right[i] - 0.5 * (whole->count - 1)) * whole->size[0];
        out[i][1] = (row + up[i]) * whole->size[1] - whole->size[3];
        out[i][2] = whole->points[(row + up[i]) * whole->count + column + right[i]];
    }
}

/* How far piece k reaches along d */
static double reach_of_piece(const shape_t *whole, int k, const double *d) {
    double corner[3][3], out = -INFINITY;
    if (whole->kind == MESH)
        for (int i = 0; i < 3; i++)
            for (int m = 0; m < 3; m++) corner[i][m] = whole->points[3 * LANES * k + m * LANES + i];
    else
        upper_corners(whole, k, corner);
    for (int i = 0; i < 3; i++) {
        const double z = whole->kind == FIELD && d[2] < 0.0 ? -whole->size[2] : corner[i][2];
        out = fmax(out, corner[i][0] * d[0] + corner[i][1] * d[1] + z * d[2]);
    }
    return out;
}

/* Piece number k as a hull of 8 points; `room` is for those that are not stored: three above, three below, the last one again */
static shape_t piece_of(const shape_t *whole, int k, double *room) {
    shape_t out = {HULL, LANES, {0.0}, whole->points + 3 * LANES * k};
    double corner[3][3];
    out.size[5] = whole->size[5];
    if (whole->kind == MESH) return out;
    upper_corners(whole, k, corner);
    for (int i = 0; i < LANES; i++)
        for (int m = 0; m < 3; m++) room[i + m * LANES] = i > 2 && m == 2 ? -whole->size[2] : corner[i > 4 ? 2 : i % 3][m];
    out.points = room;
    return out;
}

/* The box of the first shape without its ball, along the axes of the second */
static void box_beside(const view_t *v, double *box) {
    for (int k = 0; k < 3; k++) {
        const double axis[3] = {v->R[k], v->R[3 + k], v->R[6 + k]}, back[3] = {-axis[0], -axis[1], -axis[2]};
        const double middle = -dot3(v->t, axis);
        box[k] = middle - reach(v->a, back);
        box[3 + k] = middle + reach(v->a, axis);
    }
}

/* A bound from below of the distance of the first shape from what is in a box of the second's: between both boxes, then along
 * the line between these */
static double from_box(const view_t *v, const double *mine, const double *box, double enough) {
    double m[3], n[3], least = 0.0;
    for (int k = 0; k < 3; k++) m[k] = fmax(0.0, box[k] - mine[3 + k]) - fmax(0.0, mine[k] - box[3 + k]);
    const double length = sqrt(dot3(m, m));
    if (!(length > 0.0) || length >= enough) return length;
    for (int k = 0; k < 3; k++) {
        m[k] /= length;
        least += m[k] * box[m[k] > 0.0 ? k : 3 + k];
    }
    turn(v->R, m, n);
    return fmax(length, least + dot3(v->t, n) - reach(v->a, n));
}

/* Distance of the first shape without its ball from the nearest piece of the second, normal and point as of `apart`; 0 where it
 * goes through one */
static double nearest_piece(const view_t *v, double *normal, double *point) {
    double mine[6], room[3 * LANES], best = INFINITY, ahead = 0.0, back[3], n[3], p[3], distance;
    double bound[STACK] = {0.0};
    int stack[STACK], top = 0;
    view_t beside = *v;
    box_beside(v, mine);
    stack[top++] = 0;
    while (top) {
        const int node = stack[--top], left = v->b->tree[2 * node], right = v->b->tree[2 * node + 1];
        if (bound[top] >= best) continue;
        if (left >= 0) {
            const double one = from_box(v, mine, v->b->box + 6 * left, best), other = from_box(v, mine, v->b->box + 6 * right, best);
            bound[top] = fmax(one, other), stack[top++] = one < other ? right : left;
            bound[top] = fmin(one, other), stack[top++] = one < other ? left : right;
            continue;
        }
        for (int k = -1 - left; k < -right; k++) {
            /* As far away along the normal that was found last */
            if (best < INFINITY && ahead - reach_of_piece(v->b, k, back) >= best) continue;
            const shape_t piece = piece_of(v->b, k, room);
            beside.b = &piece;
            if (!apart_by(&beside, 1e-10, best < INFINITY ? normal : v->t, best, &distance, n, p)) {
                distance = 0.0;
                for (int m = 0; m < 3; m++) n[m] = m == 2, p[m] = 0.0;
            }
            if (distance >= best) continue;
            best = distance;
            copy3(n, normal);
            copy3(p, point);
            ahead = dot3(v->t, normal) - reach(v->a, normal);
            turn_back(v->R, normal, back);
            for (int m = 0; m < 3; m++) back[m] = -back[m];
        }
    }
    return best;
}

/* Whether the centre of the first shape is within a closed surface: the solid angles of its triangles add up to the whole (Van
 * Oosterom and Strackee, The solid angle of a plane triangle, 1983) */
static int enclosed(const view_t *v) {
    double angle = 0.0, center[3];
    const double back[3] = {-v->t[0], -v->t[1], -v->t[2]}, *triangle = v->b->points;
    turn_back(v->R, back, center);
    for (int k = 0; k < 3; k++)
        if (!(center[k] > v->b->box[k] && center[k] < v->b->box[3 + k])) return 0;
    for (int f = 0; f < v->b->count; f++, triangle += 3 * LANES) {
        double x[3][3], n[3], length[3];
        for (int i = 0; i < 3; i++) {
            for (int k = 0; k < 3; k++) x[i][k] = triangle[LANES * k + i] - center[k];
            length[i] = sqrt(dot3(x[i], x[i]));
        }
        cross3(x[1], x[2], n);
        const double under = length[0] * length[1] * length[2] + dot3(x[0], x[1]) * length[2] +
                             dot3(x[1], x[2]) * length[0] + dot3(x[2], x[0]) * length[1];
        angle += 2.0 * atan2(dot3(x[0], n), under);
    }
    return fabs(angle) > 2.0 * M_PI;
}

/* Where a solid goes through a triangle, the ball on it counts and nothing else; wholly within a closed surface it is as deep as
 * the far side of its ball */
static void measure_mesh(const view_t *v, answer_t *out) {
    const double core = nearest_piece(v, out->normal, out->point), ball = v->a->size[4];
    const int within = v->b->count && core > 0.0 && enclosed(v);
    out->gap = (within ? -core : core) - ball;
    along3(out->point, within ? -ball : ball, out->normal, out->point);
    for (int k = 0; k < 3 && within; k++) out->normal[k] = -out->normal[k];
    out->doubtful = 0;
}

/* A solid that is in the ground leaves it upwards. It is lifted above all of the map along its z axis and comes down until it
 * lands (conservative advancement); the lift that is left, along the normal of where it lands, is its depth. */
static void measure_field(const tolerance_t *how, const view_t *v, answer_t *out) {
    const double ball = v->a->size[4], z[3] = {v->R[2], v->R[5], v->R[8]}, size = v->a->size[5] + v->b->size[5];
    out->gap = nearest_piece(v, out->normal, out->point);
    if (out->gap <= how->touch) {
        double box[6];
        view_t lifted = *v;
        box_beside(v, box);
        double lift = v->b->box[5] - box[2] + 0.1 * v->a->size[5] + 1e-6 * size, cosine = 1.0;
        for (int step = 0; step < STEPS; step++) {
            double n[3], p[3];
            along3(v->t, -lift, z, lifted.t);
            const double distance = nearest_piece(&lifted, n, p);
            if (!(distance > 0.0) || !(-dot3(n, z) > 0.0)) break;
            copy3(n, out->normal);
            copy3(p, out->point);
            cosine = -dot3(n, z);
            if (distance <= LANDED * size) break;
            lift -= distance / cosine;
        }
        out->gap = fmin(-lift * cosine, 0.0);
    }
    out->gap -= ball;
    along3(out->point, ball, out->normal, out->point);
    out->doubtful = 0;
}

#endif
