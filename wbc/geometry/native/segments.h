/* The nearest points of two segments. */
#ifndef WBC_SEGMENTS_H
#define WBC_SEGMENTS_H

#include "vectors.h"

/* Segments whose directions have a smaller squared sine count as parallel: their nearest points are also looked for at the ends */
#define NEARLY_PARALLEL 1e-6

static inline double unit_clamp(double x) { return x < 0.0 ? 0.0 : x > 1.0 ? 1.0 : x; }

/* |w + s u - t v|^2 */
static inline double square_at(const double *w, const double *u, const double *v, double s, double t) {
    double gap[3];
    for (int m = 0; m < 3; m++) gap[m] = w[m] + s * u[m] - t * v[m];
    return dot3(gap, gap);
}

/* Square of the distance of the segments a b and c d, and where on them their nearest points are (0 to 1).
 *
 * s of the lines' nearest points, clamped; t for that s, clamped; s again for that t (Ericson, Real-time collision detection,
 * 5.1.9). Of nearly parallel segments rounding may spoil s: there the nearest points of the ends are looked at too. */
static inline double segments(const double *a, const double *b, const double *c, const double *d, double *on_a, double *on_c) {
    double u[3], v[3], w[3], s = 0.0, t = 0.0;
    minus3(b, a, u);
    minus3(d, c, v);
    minus3(a, c, w);
    const double uu = dot3(u, u), vv = dot3(v, v), uv = dot3(u, v), uw = dot3(u, w), vw = dot3(v, w);
    const double det = uu * vv - uv * uv;
    if (det > 1e-12 * uu * vv) s = unit_clamp((uv * vw - vv * uw) / det);
    if (vv > 0.0) t = (uv * s + vw) / vv;
    const double on = unit_clamp(t);
    if (on != t || vv <= 0.0) s = uu > 0.0 ? unit_clamp((uv * on - uw) / uu) : 0.0;
    double best = square_at(w, u, v, s, on);
    *on_a = s, *on_c = on;
    if (det > NEARLY_PARALLEL * uu * vv) return best;
    const double over_u = uu > 0.0 ? 1.0 / uu : 0.0, over_v = vv > 0.0 ? 1.0 / vv : 0.0;
    const double at[4][2] = {{0.0, unit_clamp(vw * over_v)},
                             {1.0, unit_clamp((vw + uv) * over_v)},
                             {unit_clamp(-uw * over_u), 0.0},
                             {unit_clamp((uv - uw) * over_u), 1.0}};
    for (int k = 0; k < 4; k++) {
        const double square = square_at(w, u, v, at[k][0], at[k][1]);
        if (square >= best) continue;
        best = square;
        *on_a = at[k][0], *on_c = at[k][1];
    }
    return best;
}

static inline double segment_square(const double *a, const double *b, const double *c, const double *d) {
    double s, t;
    return segments(a, b, c, d, &s, &t);
}

static inline double segment_distance(const double *a, const double *b, const double *c, const double *d) {
    return sqrt(segment_square(a, b, c, d));
}

#endif
