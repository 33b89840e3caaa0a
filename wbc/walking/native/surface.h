/* Heights above a plane or a cylinder. */
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

#endif
