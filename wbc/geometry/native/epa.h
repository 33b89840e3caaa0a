/* Depth of two convex shapes that overlap, by an expanding polytope.
 *
 * D is the set of all b - a, as in gjk.h, and zero is within it. A polytope of support points of D grows where its surface is
 * nearest to zero. The plane of that face bounds the depth from below, the support along its normal from above. */
#ifndef WBC_EPA_H
#define WBC_EPA_H

#include "gjk.h"

#define EPA_POINTS 320
#define EPA_FACES 1280
#define EPA_EDGES 512
/* Ends where both bounds are as close, in parts of the size of the shapes */
#define EPA_GAP 1e-10

typedef struct {
    double w[EPA_POINTS][3], normal[EPA_FACES][3], height[EPA_FACES];
    int face[EPA_FACES][3], points, faces;
} polytope_t;

/* A support point of D along m */
static void outermost(const view_t *v, const double *m, double *w) {
    const double d[3] = {-m[0], -m[1], -m[2]};
    double a[3];
    facing(v, d, w, a);
}

/* A face with its unit normal on the side that `inside` is not on; one without area never counts as the nearest */
static int add_face(polytope_t *p, int i, int k, int l, const double *inside) {
    if (p->faces == EPA_FACES) return 0;
    double x[3], y[3], n[3], out[3];
    minus3(p->w[k], p->w[i], x);
    minus3(p->w[l], p->w[i], y);
    cross3(x, y, n);
    const double size = sqrt(dot3(n, n));
    const int f = p->faces++;
    p->face[f][0] = i, p->face[f][1] = k, p->face[f][2] = l;
    if (size <= 1e-12 * sqrt(dot3(x, x) * dot3(y, y))) {
        memset(p->normal[f], 0, sizeof p->normal[f]);
        p->height[f] = INFINITY;
        return 1;
    }
    minus3(p->w[i], inside, out);
    const double sign = dot3(n, out) < 0.0 ? -1.0 : 1.0;
    for (int m = 0; m < 3; m++) p->normal[f][m] = sign * n[m] / size;
    p->height[f] = dot3(p->normal[f], p->w[i]);
    return 1;
}

/* Four support points that span a volume; 0 where there are none */
static int begin(const view_t *v, polytope_t *p, double size, double *inside) {
    double best = 0.0, found[3], line[3], side[3], m[3];
    for (int axis = 0; axis < 3; axis++) {
        double low[3], high[3], d[3] = {0.0, 0.0, 0.0};
        d[axis] = 1.0;
        outermost(v, d, high);
        d[axis] = -1.0;
        outermost(v, d, low);
        minus3(high, low, found);
        if (dot3(found, found) > best) {
            best = dot3(found, found);
            copy3(low, p->w[0]);
            copy3(high, p->w[1]);
        }
    }
    if (best <= 1e-18 * size * size) return 0;
    minus3(p->w[1], p->w[0], line);
    double area = 0.0, volume = 0.0;
    for (int axis = 0; axis < 3; axis++)
        for (int sign = -1; sign <= 1; sign += 2) {
            double d[3] = {0.0, 0.0, 0.0};
            d[axis] = sign;
            cross3(line, d, m);
            if (dot3(m, m) <= 1e-12 * best) continue;
            outermost(v, m, found);
            minus3(found, p->w[0], side);
            cross3(line, side, m);
            if (dot3(m, m) > area) {
                area = dot3(m, m);
                copy3(found, p->w[2]);
            }
        }
    if (area <= 1e-18 * size * size * best) return 0;
    minus3(p->w[2], p->w[0], side);
    cross3(line, side, m);
    for (int sign = -1; sign <= 1; sign += 2) {
        const double d[3] = {sign * m[0], sign * m[1], sign * m[2]};
        outermost(v, d, found);
        minus3(found, p->w[0], side);
        if (fabs(dot3(m, side)) > volume) {
            volume = fabs(dot3(m, side));
            copy3(found, p->w[3]);
        }
    }
    if (volume <= 1e-9 * size * sqrt(area)) return 0;
    p->points = 4;
    p->faces = 0;
    for (int k = 0; k < 3; k++) inside[k] = (p->w[0][k] + p->w[1][k] + p->w[2][k] + p->w[3][k]) / 4;
    return add_face(p, 0, 1, 2, inside) && add_face(p, 0, 1, 3, inside) && add_face(p, 0, 2, 3, inside) &&
           add_face(p, 1, 2, 3, inside);
}

/* Replace the faces that see a new point by those from their rim to it; 0 where there is no room or no rim */
static int expand(polytope_t *p, const double *w, double slack, const double *inside) {
    int edge[EPA_EDGES][2], edges = 0;
    if (p->points == EPA_POINTS) return 0;
    for (int f = p->faces - 1; f >= 0; f--) {
        if (!(dot3(p->normal[f], w) > p->height[f] + slack)) continue;
        for (int k = 0; k < 3; k++) {
            const int i = p->face[f][k], j = p->face[f][(k + 1) % 3];
            int same = 0;
            while (same < edges && !((edge[same][0] == i && edge[same][1] == j) || (edge[same][0] == j && edge[same][1] == i)))
                same++;
            if (same < edges) { /* between two faces that go */
                edges--;
                edge[same][0] = edge[edges][0], edge[same][1] = edge[edges][1];
            } else {
                if (edges == EPA_EDGES) return 0;
                edge[edges][0] = i, edge[edges][1] = j;
                edges++;
            }
        }
        p->faces--;
        memcpy(p->normal[f], p->normal[p->faces], sizeof p->normal[f]);
        memcpy(p->face[f], p->face[p->faces], sizeof p->face[f]);
        p->height[f] = p->height[p->faces];
    }
    copy3(w, p->w[p->points]);
    for (int e = 0; e < edges; e++)
        if (!add_face(p, edge[e][0], edge[e][1], p->points, inside)) return 0;
    p->points++;
    return edges > 0;
}

/* The greatest clearance that was found, at most 0 but for rounding, and its direction from A to B; -inf without one */
static double depth(const view_t *v, double *normal) {
    polytope_t p;
    double inside[3], w[3], best = INFINITY;
    const double size = v->a->size[5] + v->b->size[5];
    if (!begin(v, &p, size, inside)) return -INFINITY;
    for (;;) {
        int nearest_face = 0;
        for (int f = 1; f < p.faces; f++)
            if (p.height[f] < p.height[nearest_face]) nearest_face = f;
        const double *m = p.normal[nearest_face], low = p.height[nearest_face];
        if (!(low < INFINITY)) break;
        outermost(v, m, w);
        const double high = dot3(m, w);
        if (high < best) {
            best = high;
            for (int k = 0; k < 3; k++) normal[k] = -m[k];
        }
        if (best - low <= EPA_GAP * size || !expand(&p, w, 0.1 * EPA_GAP * size, inside)) break;
    }
    return -best;
}

#endif
