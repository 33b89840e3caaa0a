/* Distance of two convex shapes that are apart, by Gilbert, Johnson and Keerthi's method.
 *
 * D is the set of all b - a for points a of A and b of B; the distance is that of D from zero. A simplex of support points
 * of D comes closer with every step: the nearest point of it is found by looking at every vertex, edge and face that the
 * newest support point is part of, which has no case that fails where the simplex is flat. */
#ifndef WBC_GJK_H
#define WBC_GJK_H

#include "shapes.h"

#define GJK_STEPS 128
/* Ends where upper and lower bound of the distance are as close, in parts of it, or by rounding, in parts of the sizes: the
 * normal is as good as the root of the former */
#define GJK_GAP 1e-13
#define GJK_ROUNDING 4e-16

/* Two shapes, seen from A: B is turned by R and moved by t */
typedef struct {
    const shape_t *a, *b;
    double R[9], t[3];
} view_t;

typedef struct {
    int count;
    double w[4][3], a[4][3], u[4];
} simplex_t;

/* w = b - a for the a that is farthest and the b that is least far along d */
static inline void facing(const view_t *v, const double *d, double *w, double *a) {
    double back[3], b[3];
    support(v->a, d, a);
    turn_back(v->R, d, back);
    for (int k = 0; k < 3; k++) back[k] = -back[k];
    support(v->b, back, b);
    turn(v->R, b, w);
    for (int k = 0; k < 3; k++) w[k] += v->t[k] - a[k];
}

/* -h_A(n) - h_B(-n): how far the shapes are apart along a unit vector n; the distance is at least that */
static inline double clearance(const view_t *v, const double *n) {
    double back[3];
    turn_back(v->R, n, back);
    for (int k = 0; k < 3; k++) back[k] = -back[k];
    return dot3(v->t, n) - reach(v->a, n) - reach(v->b, back);
}

typedef struct {
    double square, v[3], u[4];
    int count, at[4];
} best_t;

static inline void offer_edge(const simplex_t *s, int i, int k, best_t *best) {
    double d[3], v[3];
    minus3(s->w[k], s->w[i], d);
    const double length = dot3(d, d), t = -dot3(s->w[i], d);
    if (!(t > 0.0 && t < length)) return;
    const double share = t / length;
    along3(s->w[i], share, d, v);
    const double square = dot3(v, v);
    if (square >= best->square) return;
    best->square = square, best->count = 2;
    best->at[0] = i, best->at[1] = k;
    best->u[0] = 1.0 - share, best->u[1] = share;
    copy3(v, best->v);
}

static inline void offer_face(const simplex_t *s, int i, int k, int l, best_t *best) {
    double p[3], r[3], n[3], c[3], back[3];
    minus3(s->w[k], s->w[i], p);
    minus3(s->w[l], s->w[i], r);
    cross3(p, r, n);
    const double square = dot3(n, n);
    if (square <= 1e-24 * dot3(p, p) * dot3(r, r)) return;
    for (int m = 0; m < 3; m++) back[m] = -s->w[i][m];
    cross3(back, r, c);
    const double second = dot3(c, n) / square;
    cross3(p, back, c);
    const double third = dot3(c, n) / square;
    if (!(second > 0.0 && third > 0.0 && second + third < 1.0)) return;
    const double height = dot3(n, s->w[i]) / square;
    if (height * height * square >= best->square) return;
    best->square = height * height * square, best->count = 3;
    best->at[0] = i, best->at[1] = k, best->at[2] = l;
    best->u[0] = 1.0 - second - third, best->u[1] = second, best->u[2] = third;
    for (int m = 0; m < 3; m++) best->v[m] = height * n[m];
}

/* Whether zero is within the four points */
static inline int encloses(const simplex_t *s) {
    double p[3], r[3], x[3], c[3];
    minus3(s->w[0], s->w[3], p);
    minus3(s->w[1], s->w[3], r);
    minus3(s->w[2], s->w[3], x);
    cross3(r, x, c);
    const double volume = dot3(p, c), first = -dot3(s->w[3], c);
    cross3(x, p, c);
    const double second = -dot3(s->w[3], c);
    cross3(p, r, c);
    const double third = -dot3(s->w[3], c), fourth = volume - first - second - third;
    if (volume > 0.0) return first >= 0.0 && second >= 0.0 && third >= 0.0 && fourth >= 0.0;
    return volume < 0.0 && first <= 0.0 && second <= 0.0 && third <= 0.0 && fourth <= 0.0;
}

/* The nearest point of the simplex, whose last vertex is new; keeps what carries it. 0 where zero is enclosed */
static inline int reduce(simplex_t *s, double *v) {
    const int new = s->count - 1;
    best_t best = {.square = dot3(s->w[new], s->w[new]), .count = 1, .at = {new}, .u = {1.0}};
    copy3(s->w[new], best.v);
    for (int i = 0; i < new; i++) offer_edge(s, i, new, &best);
    for (int i = 0; i < new; i++)
        for (int k = i + 1; k < new; k++) offer_face(s, i, k, new, &best);
    if (new == 3 && encloses(s)) return 0;
    simplex_t kept;
    kept.count = best.count;
    for (int k = 0; k < best.count; k++) {
        copy3(s->w[best.at[k]], kept.w[k]);
        copy3(s->a[best.at[k]], kept.a[k]);
        kept.u[k] = best.u[k];
    }
    *s = kept;
    copy3(best.v, v);
    return 1;
}

/* Whether shapes are farther apart than `touch`; then their distance, its unit normal from A to B, and the nearest point of A,
 * all seen from A. The distance is what the normal proves: the nearest points may be farther apart by what rounding leaves.
 * The search begins along `start`; it ends where the distance is proven to be `enough`, which then is what is returned of it. */
static int apart_by(const view_t *view, double touch, const double *start, double enough, double *distance, double *normal,
                    double *point) {
    simplex_t s, last;
    double v[3], w[3], a[3];
    facing(view, start, s.w[0], s.a[0]);
    s.count = 1, s.u[0] = 1.0;
    copy3(s.w[0], v);
    const double rounding = GJK_ROUNDING * (view->a->size[5] + view->b->size[5] + sqrt(dot3(view->t, view->t)));
    double square = dot3(v, v), proven = 0.0, length = 0.0;
    for (int step = 0; step < GJK_STEPS; step++) {
        if (square <= touch * touch) return 0;
        facing(view, v, w, a);
        length = sqrt(square);
        proven = dot3(v, w) / length;
        if (length - proven <= fmax(GJK_GAP * length, rounding) || proven >= enough) break;
        last = s;
        copy3(w, s.w[s.count]);
        copy3(a, s.a[s.count]);
        s.count++;
        double next[3];
        if (!reduce(&s, next)) return 0;
        const double nearer = dot3(next, next);
        if (nearer >= square || step == GJK_STEPS - 1) { /* rounding leaves nothing to gain */
            s = last;
            break;
        }
        copy3(next, v);
        square = nearer;
    }
    *distance = proven;
    for (int k = 0; k < 3; k++) {
        normal[k] = v[k] / length;
        point[k] = 0.0;
        for (int i = 0; i < s.count; i++) point[k] += s.u[i] * s.a[i][k];
    }
    return 1;
}

static int apart(const view_t *view, double touch, double *distance, double *normal, double *point) {
    return apart_by(view, touch, view->t, INFINITY, distance, normal, point);
}

#endif
