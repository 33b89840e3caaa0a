/* Heights above a plane or a cylinder. */
#ifndef WBC_WALKING_SURFACE_H
#define WBC_WALKING_SURFACE_H

#include "arm.h"

/* A plane through `origin` with the normal `axis`, or (radius > 0) a cylinder about that line. */
typedef struct {
    double origin[3], axis[3], radius;
} Surface;

/* From a cylinder's axis straight to a point. */
static void across(const Surface *surface, const double *p, double *out)
{
    for (int k = 0; k < 3; ++k)
        out[k] = p[k] - surface->origin[k];
    const double along = dot(out, surface->axis);
    for (int k = 0; k < 3; ++k)
        out[k] -= along * surface->axis[k];
}

static double above(const Surface *surface, const double *p)
{
    double local[3];
    if (surface->radius > 0.0) {
        across(surface, p, local);
        return sqrt(dot(local, local)) - surface->radius;
    }
    for (int k = 0; k < 3; ++k)
        local[k] = p[k] - surface->origin[k];
    return dot(local, surface->axis);
}

#endif
