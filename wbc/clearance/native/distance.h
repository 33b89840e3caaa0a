/* Signed distance of two bodies at their present places; never above the true one but for rounding. */
#ifndef WBC_DISTANCE_H
#define WBC_DISTANCE_H

#include "motion.h"

/* Lids of cylinders are taken as so many edges round them inside an endless cylinder: 8e-5 of their radius too large */
#define EDGES 256
/* Directions of lines whose sine is below the root of this have their nearest points at an end */
#define CROSSING 1e-15

typedef struct {
    double gap, a[3], b[3]; /* and nearest points */
} found_t;

static double within(double x) { return x < 0.0 ? 0.0 : x > 1.0 ? 1.0 : x; }

/* The nearest points of segments a and c: of their ends, and of the lines; returns the square of the distance */
static double segments(const double *a, const double *c, double *on_a, double *on_c) {
    double u[3], v[3], w[3], gap[3], best = INFINITY;
    minus3(a + 3, a, u);
    minus3(c + 3, c, v);
    minus3(a, c, w);
    const double uu = dot3(u, u), vv = dot3(v, v), uv = dot3(u, v), uw = dot3(u, w), vw = dot3(v, w);
    const double over_u = uu > 0.0 ? 1.0 / uu : 0.0, over_v = vv > 0.0 ? 1.0 / vv : 0.0;
    double s[6] = {0.0, 1.0, within(-uw * over_u), within((uv - uw) * over_u)};
    double t[6] = {within(vw * over_v), within((vw + uv) * over_v), 0.0, 1.0};
    int count = 4;
    const double det = uu * vv - uv * uv;
    if (det > CROSSING * uu * vv) {
        s[4] = within((uv * vw - vv * uw) / det);
        t[4] = within((uv * s[4] + vw) * over_v);
        s[5] = within((uv * t[4] - uw) * over_u);
        t[5] = within((uv * s[5] + vw) * over_v);
        count = 6;
    }
    for (int k = 0; k < count; k++) {
        for (int m = 0; m < 3; m++) gap[m] = w[m] + s[k] * u[m] - t[k] * v[m];
        const double square = dot3(gap, gap);
        if (square >= best) continue;
        best = square;
        along3(a, s[k], u, on_a);
        along3(c, t[k], v, on_c);
    }
    return best;
}

/* Points at the ends of a line through both that is at least as long as the balls on them */
static void round_ends(found_t *out, double square, double ra, double rb) {
    double n[3];
    const double length = sqrt(square);
    minus3(out->b, out->a, n);
    for (int k = 0; k < 3; k++) n[k] = length > 0.0 ? n[k] / length : k == 2;
    along3(out->a, ra, n, out->a);
    along3(out->b, -rb, n, out->b);
    out->gap = length - ra - rb;
}

static shape_t solid_of(const sweep_t *s, int b) {
    const shape_t out = {s->shape[b], s->hull[2 * b + 1], s->size + 6 * b, s->points + 3 * s->hull[2 * b]};
    return out;
}

/* A capsule or a ball */
static int round_(const sweep_t *s, int b) {
    const double *size = s->size + 6 * b;
    return s->shape[b] == SUM && size[0] == 0.0 && size[1] == 0.0 && size[3] == 0.0;
}

/* Two solids, or one and a half-space, of which A is at pose A */
static void solids(const shape_t *a, const double *A, const shape_t *b, const double *B, found_t *out) {
    /* Lengths are metres: what counts as touching, as equal, as near contact; see wbc/proximity */
    static const scene_t how = {.touch = 1e-10, .tie = 1e-9, .trust = 1e-5};
    view_t v = {*a, *b};
    answer_t answer;
    double apart_[3], n[3];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) v.R[3 * i + k] = A[i] * B[k] + A[3 + i] * B[3 + k] + A[6 + i] * B[6 + k];
    minus3(B + 9, A + 9, apart_);
    turn_back(A, apart_, v.t);
    if (a->kind == PLANE || b->kind == PLANE)
        measure_plane(&v, &answer);
    else
        measure_bounded(&how, &v, &answer);
    turn(A, answer.normal, n);
    turn(A, answer.point, out->a);
    for (int k = 0; k < 3; k++) out->a[k] += A[9 + k];
    along3(out->a, answer.gap, n, out->b);
    out->gap = answer.gap;
}

/* A solid and the wall round the inside of a cylinder: the point of it that is farthest from the axis */
static void inside(const shape_t *a, const double *A, double radius, const double *W, found_t *out) {
    double most = -1.0, local[3], world[3], d[3], at[2] = {0, 0};
    const int lids = a->kind == SUM && a->size[3] > 0.0, count = a->kind == HULL ? a->count : lids ? 2 * EDGES : 8;
    const double wide = lids ? a->size[3] / cos(M_PI / EDGES) : 0.0;
    for (int k = 0; k < count; k++) {
        if (a->kind == HULL)
            for (int m = 0; m < 3; m++) local[m] = a->points[k + m * a->count];
        else
            for (int m = 0; m < 3; m++) local[m] = (k >> m) & 1 ? a->size[m] : -a->size[m];
        if (lids) {
            const double angle = 2 * M_PI * (k / 2) / EDGES;
            local[0] = wide * cos(angle), local[1] = wide * sin(angle), local[2] = k % 2 ? a->size[2] : -a->size[2];
        }
        turn(A, local, world);
        for (int m = 0; m < 3; m++) world[m] += A[9 + m] - W[9 + m];
        turn_back(W, world, d);
        const double square = d[0] * d[0] + d[1] * d[1];
        if (square <= most) continue;
        most = square;
        for (int m = 0; m < 3; m++) out->a[m] = world[m] + W[9 + m];
        at[0] = d[0], at[1] = d[1];
    }
    const double length = sqrt(most), n[3] = {length > 0.0 ? at[0] / length : 1.0, length > 0.0 ? at[1] / length : 0.0, 0.0};
    turn(W, n, d);
    out->gap = radius - length - a->size[4];
    along3(out->a, a->size[4], d, out->a);
    along3(out->a, out->gap, d, out->b);
}

/* A solid and an endless cylinder: a piece of it beside the solid, so long that nothing leaves it by a lid */
static void outside(const shape_t *a, const double *A, double radius, const double *W, found_t *out) {
    const double z[3] = {W[2], W[5], W[8]}, reach_ = a->size[5] + a->size[4];
    double size[6] = {0.0, 0.0, 0.0, radius, 0.0, 0.0}, pose[12], d[3];
    minus3(A + 9, W + 9, d);
    memcpy(pose, W, sizeof pose);
    along3(W + 9, dot3(d, z), z, pose + 9);
    size[2] = 4.0 * (reach_ + radius);
    size[5] = sqrt(size[2] * size[2] + radius * radius);
    const shape_t whole_ = {SUM, 0, size, 0};
    solids(a, A, &whole_, pose, out);
}

/* Distance of a segment's box and a box, both in one frame */
static double boxes(const double *ends, const double *box) {
    double square = 0.0;
    for (int k = 0; k < 3; k++) {
        const double least = fmin(ends[k], ends[3 + k]), most = fmax(ends[k], ends[3 + k]);
        const double off = fmax(0.0, fmax(box[k] - most, least - box[3 + k]));
        square += off * off;
    }
    return sqrt(square);
}

/* Whether a point is within a closed surface: the solid angles of its triangles add up to the whole (Van Oosterom and
 * Strackee, The solid angle of a plane triangle, 1983) */
static int enclosed(const sweep_t *s, int mesh, const double *point) {
    const int root = s->hull[2 * mesh], count = s->hull[2 * mesh + 1];
    const double *box = s->box + 6 * root;
    int node = root;
    double angle = 0.0;
    for (int k = 0; k < 3; k++)
        if (!(point[k] > box[k] && point[k] < box[3 + k])) return 0;
    while (s->tree[2 * node] >= 0) node = s->tree[2 * node];
    const double *triangle = s->triangle + 24 * (-1 - s->tree[2 * node]);
    for (int f = 0; f < count; f++, triangle += 24) {
        double x[3][3], n[3][3], length[3];
        for (int i = 0; i < 3; i++) {
            for (int k = 0; k < 3; k++) x[i][k] = triangle[8 * k + i] - point[k];
            length[i] = sqrt(dot3(x[i], x[i]));
        }
        cross3(x[1], x[2], n[0]);
        const double under = length[0] * length[1] * length[2] + dot3(x[0], x[1]) * length[2] +
                             dot3(x[1], x[2]) * length[0] + dot3(x[2], x[0]) * length[1];
        angle += 2.0 * atan2(dot3(x[0], n[0]), under);
    }
    return fabs(angle) > 2.0 * M_PI;
}

/* A solid, in a capsule about `ends` (world) of this radius, and a surface of triangles; where it goes through one, the balls
 * on it count and nothing else */
static void triangles(const sweep_t *s, const shape_t *a, const double *A, const double *ends, double radius, int mesh,
                      found_t *out) {
    const double *M = s->body_pose + 12 * mesh;
    double local[6], d[3], distance, normal[3], point[3];
    int stack[128], top = 0;
    view_t v = {*a};
    for (int e = 0; e < 2; e++) {
        minus3(ends + 3 * e, M + 9, d);
        turn_back(M, d, local + 3 * e);
    }
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) v.R[3 * i + k] = A[i] * M[k] + A[3 + i] * M[3 + k] + A[6 + i] * M[6 + k];
    minus3(M + 9, A + 9, d);
    turn_back(A, d, v.t);
    out->gap = INFINITY;
    stack[top++] = s->hull[2 * mesh];
    while (top) {
        const int node = stack[--top], left = s->tree[2 * node], right = s->tree[2 * node + 1];
        if (boxes(local, s->box + 6 * node) - radius >= out->gap) continue;
        if (left >= 0) {
            const int swap = boxes(local, s->box + 6 * left) < boxes(local, s->box + 6 * right);
            stack[top++] = swap ? right : left;
            stack[top++] = swap ? left : right;
            continue;
        }
        for (int k = -1 - left; k < -right; k++) {
            double size[6] = {0};
            size[5] = s->size[6 * mesh + 5];
            const shape_t face = {HULL, 8, size, s->triangle + 24 * k};
            v.b = face;
            if (!apart(&v, 1e-10, &distance, normal, point)) {
                distance = 0.0;
                for (int m = 0; m < 3; m++) normal[m] = m == 2, point[m] = 0.0;
            }
            if (distance - a->size[4] >= out->gap) continue;
            out->gap = distance - a->size[4];
            along3(point, a->size[4], normal, point);
            turn(A, point, out->a);
            turn(A, normal, d);
            for (int m = 0; m < 3; m++) out->a[m] += A[9 + m];
            along3(out->a, out->gap, d, out->b);
        }
    }
    const double ball = a->size[4], core = out->gap + ball;
    double center[3];
    if (!s->hull[2 * mesh + 1] || !(core > 0.0)) return;
    minus3(A + 9, M + 9, d);
    turn_back(M, d, center);
    if (!enclosed(s, mesh, center)) return;
    /* Wholly within: as deep as the far side of its ball; from the surface back to there */
    for (int k = 0; k < 3 && out->gap != 0.0; k++) d[k] = (out->b[k] - out->a[k]) / out->gap;
    along3(out->a, -2.0 * ball, d, out->a);
    out->gap = -core - ball;
    along3(out->a, -out->gap, d, out->b);
}

static void swapped(found_t *out) {
    double a[3];
    copy3(out->a, a);
    copy3(out->b, out->a);
    copy3(a, out->b);
}

static void distance_of(const sweep_t *s, int i, int j, found_t *out) {
    const double *A = s->body_pose + 12 * i, *B = s->body_pose + 12 * j;
    const int turned = s->shape[i] >= INSIDE;
    if (turned) {
        const int k = i;
        i = j, j = k;
        A = s->body_pose + 12 * i, B = s->body_pose + 12 * j;
    }
    const shape_t a = solid_of(s, i);
    const double *ends = s->world_line + 6 * i, radius = s->line[8 * i + 6];
    if (s->shape[j] == INSIDE) {
        inside(&a, A, s->size[6 * j + 3], B, out);
    } else if (s->shape[j] == OUTSIDE) {
        outside(&a, A, s->size[6 * j + 3], B, out);
    } else if (s->shape[j] == TRIANGLES) {
        triangles(s, &a, A, ends, radius, j, out);
    } else if (round_(s, i) && round_(s, j)) {
        const double square = segments(ends, s->world_line + 6 * j, out->a, out->b);
        round_ends(out, square, radius, s->line[8 * j + 6]);
    } else {
        const shape_t b = solid_of(s, j);
        solids(&a, A, &b, B, out);
    }
    if (turned) swapped(out);
}

/* Of finite size, its centre within it */
static int bounded(const sweep_t *s, int b) { return s->shape[b] == SUM || s->shape[b] == HULL; }

/* A bound from below: the capsules about both bodies */
static double capsules_of(const sweep_t *s, int i, int j) {
    double a[3], b[3];
    return sqrt(segments(s->world_line + 6 * i, s->world_line + 6 * j, a, b)) - s->line[8 * i + 6] - s->line[8 * j + 6];
}

/* A quick bound from below: the balls about both bodies; above a half-space, from a cylinder */
static double bound_of(const sweep_t *s, int i, int j) {
    const double *one = s->world_line + 6 * i, *other = s->world_line + 6 * j;
    const int kind = s->shape[j] == SUM || s->shape[j] == HULL || s->shape[j] == TRIANGLES ? s->shape[i] : s->shape[j];
    double a[3], b[3], radii = s->line[8 * i + 6];
    if (kind == SUM || kind == HULL || kind == TRIANGLES) {
        double d[3], span[3], balls = 0.0;
        for (int k = 0; k < 3; k++) d[k] = 0.5 * (one[k] + one[3 + k] - other[k] - other[3 + k]);
        minus3(one + 3, one, span);
        balls += 0.5 * sqrt(dot3(span, span));
        minus3(other + 3, other, span);
        balls += 0.5 * sqrt(dot3(span, span));
        radii += s->line[8 * j + 6];
        return sqrt(dot3(d, d)) - balls - radii;
    }
    const int wall = s->shape[j] == kind ? j : i;
    const double *W = s->body_pose + 12 * wall, *ends = wall == j ? one : other, radius = s->size[6 * wall + 3];
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
    if (kind == INSIDE) return radius - sqrt(most) - radii;
    const double zero[6] = {0};
    return sqrt(segments(flat[0], zero, a, b)) - radius - radii;
}

#endif
