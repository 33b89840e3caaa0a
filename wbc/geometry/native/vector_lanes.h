/* Numbers of LANES places at once: what they are compared and measured by. */
#ifndef WBC_VECTOR_LANES_H
#define WBC_VECTOR_LANES_H

#include "shapes.h"

/* Newton steps towards the point of a segment that is nearest to a box, from its middle on */
#define NEARER 3

static lanes_t chosen(mask_t mask, lanes_t one, lanes_t other) { return (lanes_t)((mask & (mask_t)one) | (~mask & (mask_t)other)); }

static lanes_t min_lanes(lanes_t a, lanes_t b) {
#ifdef __AVX512DQ__
    return (lanes_t)_mm512_min_pd((__m512d)a, (__m512d)b);
#else
    return chosen(a < b, a, b);
#endif
}

static lanes_t max_lanes(lanes_t a, lanes_t b) {
#ifdef __AVX512DQ__
    return (lanes_t)_mm512_max_pd((__m512d)a, (__m512d)b);
#else
    return chosen(a > b, a, b);
#endif
}

static lanes_t abs_lanes(lanes_t a) { return (lanes_t)((mask_t)a & 0x7fffffffffffffffLL); }

static lanes_t sqrt_lanes(lanes_t a) {
#ifdef __AVX512DQ__
    return (lanes_t)_mm512_sqrt_pd((__m512d)a);
#else
    for (int l = 0; l < LANES; l++) a[l] = sqrt(a[l]);
    return a;
#endif
}

static lanes_t dot_lanes(const lanes_t *a, const lanes_t *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* Less quarter turns, of which the last digits of what was rounded tell two bits, then the polynomials of fdlibm's kernels */
static void sine_cosine(lanes_t x, lanes_t *sine, lanes_t *cosine) {
    const double round = 0x1.8p52;
    const lanes_t rounded = x * 6.36619772367581382433e-01 + round, k = rounded - round;
    const lanes_t r = ((x - k * 1.57079632673412561417e+00) - k * 6.07710050630396597660e-11) - k * 2.02226624879595063154e-21, z = r * r;
    const lanes_t s = r + r * z * (-1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 +
                      z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))));
    const lanes_t c = 1.0 - 0.5 * z + z * z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 +
                      z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))));
    const mask_t quarters = (mask_t)rounded, odd = -(quarters & 1), low = ((quarters & 2) << 62), high = (((quarters + 1) & 2) << 62);
    *sine = (lanes_t)((mask_t)chosen(odd, c, s) ^ low);
    *cosine = (lanes_t)((mask_t)chosen(odd, s, c) ^ high);
}

/* The vector from a segment, both ends, to a box, its pose and half sides, where they are nearest to each other after NEARER Newton
 * steps; its length, which is returned, is no less than their distance */
static lanes_t to_box(const lanes_t *ends, const double *box, lanes_t *n) {
    lanes_t a[3], d[3], off[3], t = (lanes_t){0} + 0.5, low = {0}, high = (lanes_t){0} + 1.0, square;
    for (int m = 0; m < 3; m++) {
        a[m] = d[m] = (lanes_t){0};
        for (int i = 0; i < 3; i++) a[m] += box[3 * i + m] * (ends[i] - box[9 + i]), d[m] += box[3 * i + m] * (ends[3 + i] - ends[i]);
    }
    for (int step = 0;; step++) {
        lanes_t slope = {0}, bend = (lanes_t){0} + 1e-300;
        square = (lanes_t){0};
        for (int m = 0; m < 3; m++) {
            const lanes_t x = a[m] + t * d[m], half = (lanes_t){0} + box[12 + m];
            off[m] = x - min_lanes(max_lanes(x, -half), half);
            slope += off[m] * d[m], square += off[m] * off[m];
            bend += (lanes_t)((mask_t)(d[m] * d[m]) & (off[m] != 0.0));
        }
        if (step == NEARER) break;
        low = chosen(slope > 0.0, low, t), high = chosen(slope > 0.0, t, high);
        t = min_lanes(max_lanes(t - slope / bend, low), high);
    }
    for (int i = 0; i < 3; i++) n[i] = -(box[3 * i] * off[0] + box[3 * i + 1] * off[1] + box[3 * i + 2] * off[2]);
    return sqrt_lanes(square);
}

/* The vector from one segment to another, where they are nearest to each other; its length is no less than their distance */
static lanes_t to_segment(const lanes_t *a, const lanes_t *b, lanes_t *n) {
    const lanes_t zero = {0}, one = zero + 1.0;
    lanes_t u[3], v[3], w[3];
    for (int m = 0; m < 3; m++) u[m] = a[3 + m] - a[m], v[m] = b[3 + m] - b[m], w[m] = a[m] - b[m];
    const lanes_t uu = dot_lanes(u, u) + 1e-300, vv = dot_lanes(v, v) + 1e-300, uv = dot_lanes(u, v), uw = dot_lanes(u, w), vw = dot_lanes(v, w);
    const lanes_t det = uu * vv - uv * uv;
    lanes_t s = chosen(det > 1e-12 * uu * vv, (uv * vw - vv * uw) / det, zero);
    s = min_lanes(max_lanes(s, zero), one);
    const lanes_t t = min_lanes(max_lanes((uv * s + vw) / vv, zero), one);
    s = min_lanes(max_lanes((uv * t - uw) / uu, zero), one);
    for (int m = 0; m < 3; m++) n[m] = t * v[m] - w[m] - s * u[m];
    return sqrt_lanes(dot_lanes(n, n));
}

#endif
