/* The distance of a segment from a box. */
#ifndef WBC_SEGMENT_BOX_H
#define WBC_SEGMENT_BOX_H

#include "vectors.h"

/* Newton steps at most; most segments need three */
#define BOX_STEPS 24

/* By what x is beyond the half sides h of a box about 0 */
static inline void beyond_box(const double *x, const double *h, double *out) {
    for (int k = 0; k < 3; k++) out[k] = x[k] > h[k] ? x[k] - h[k] : x[k] < -h[k] ? x[k] + h[k] : 0.0;
}

/* Distance of the segment from a to b from the box about 0 with half sides h; where on it (0 to 1) it is nearest, and the normal
 * out of the box there. 0 where it goes through the box; never above the true distance but for rounding.
 *
 * Half the squared distance is convex along the segment, and its slope is made of straight pieces: Newton steps, or the middle of
 * what brackets the zero. What is returned is how far the normal that was found parts the two. */
static inline double segment_box(const double *a, const double *b, const double *h, double *share, double *normal) {
    double d[3], x[3], off[3], low = 0.0, high = 1.0, t = 0.5;
    minus3(b, a, d);
    for (int step = 0; step < BOX_STEPS; step++) {
        double bend = 0.0;
        along3(a, t, d, x);
        beyond_box(x, h, off);
        for (int k = 0; k < 3; k++) bend += off[k] != 0.0 ? d[k] * d[k] : 0.0;
        const double slope = dot3(off, d);
        if (slope > 0.0) high = t;
        else low = t;
        if (slope == 0.0 || !(bend > 0.0)) break;
        double next = t - slope / bend;
        /* The first steps may lead out of the segment: its end then is where to look */
        if (next <= low) next = low > 0.0 ? 0.5 * (low + t) : 0.0;
        else if (next >= high) next = high < 1.0 ? 0.5 * (high + t) : 1.0;
        if (next == t) break;
        t = next;
    }
    *share = t;
    const double length = sqrt(dot3(off, off));
    if (!(length > 0.0)) return 0.0;
    double one, other, most = 0.0;
    for (int k = 0; k < 3; k++) {
        normal[k] = off[k] / length;
        most += h[k] * fabs(normal[k]);
    }
    one = dot3(normal, a), other = dot3(normal, b);
    return (one < other ? one : other) - most;
}

#endif
