/* Whether swinging arms stay above a plane or outside a cylinder, as wbc.walking.planner.swings.clearance. */
#ifndef WBC_WALKING_SURFACE_H
#define WBC_WALKING_SURFACE_H

#include "arm.h"

/* A plane through `origin` with the normal `axis`, or (radius > 0) a cylinder about that line. */
typedef struct {
    double origin[3], axis[3], radius;
} Surface;

static double above(const Surface *surface, const double *p)
{
    double local[3], square = 0.0;
    for (int k = 0; k < 3; ++k)
        local[k] = p[k] - surface->origin[k];
    const double along = dot(local, surface->axis);
    if (surface->radius <= 0.0)
        return along;
    for (int k = 0; k < 3; ++k)
        square += (local[k] - along * surface->axis[k]) * (local[k] - along * surface->axis[k]);
    return sqrt(square) - surface->radius;
}

/* For m swings at n points each: whether upper arm, forearm and hand are `least` (of each link) above the surface, at
   the parts `parts` of each. `points` m x n x 6 x 3 in the frame of the body, `bodies` m x n x 4 x 4; a hand that is
   within `touching` of one of its `holds` (m x 2 x 3) may touch. */
void stay_above(const Surface *surface, long m, long n, const double *points, const double *bodies, const double *holds,
                const double *parts, long some, const double *least, double touching, unsigned char *out)
{
    for (long s = 0; s < m; ++s) {
        out[s] = 1;
        for (long i = 0; i < n && out[s]; ++i) {
            const Frame body = frame_of(bodies + 16 * (s * n + i));
            const double(*p)[3] = (const double (*)[3])(points + 3 * POINTS * (s * n + i));
            double placed[4][3];
            int links = 3;
            for (int j = 0; j < 4; ++j)
                for (int k = 0; k < 3; ++k)
                    placed[j][k] = dot(body.row[k], p[2 + j]) + body.row[k][3];
            for (int end = 0; end < 2; ++end) {
                double gap[3];
                for (int k = 0; k < 3; ++k)
                    gap[k] = placed[3][k] - holds[3 * (2 * s + end) + k];
                if (sqrt(dot(gap, gap)) <= touching)
                    links = 2;
            }
            for (int j = 0; j < links && out[s]; ++j)
                for (long a = 0; a < some; ++a) {
                    double where[3];
                    for (int k = 0; k < 3; ++k)
                        where[k] = placed[j][k] + parts[a] * (placed[j + 1][k] - placed[j][k]);
                    out[s] &= above(surface, where) >= least[j];
                }
        }
    }
}

#endif
