/* Curvature of the first level, of errors that no step removes: see reach.h. */
#ifndef WBC_LEVEL_CURVATURE_H
#define WBC_LEVEL_CURVATURE_H

#include "level.h"

#if LEVELS > 0

/* Curvature above this share of the largest one takes its direction */
#define BENT 1e-3

/* Jacobi's rotations of a symmetric matrix: its diagonal becomes its eigenvalues, the rows of `turn` their vectors */
static void principal(double *a, int size, double *turn) {
    for (int i = 0; i < size; i++)
        for (int j = 0; j < size; j++) turn[i * NV + j] = i == j;
    for (int sweep = 0, turned = 1; turned && sweep < SWEEPS; sweep++) {
        turned = 0;
        for (int p = 0; p < size; p++)
            for (int q = p + 1; q < size; q++) {
                const double off = a[p * NV + q], x = a[p * NV + p], y = a[q * NV + q];
                if (fabs(off) <= ORTHOGONAL * (fabs(x) + fabs(y)) || fabs(off) < DBL_MIN) continue;
                const double ratio = (y - x) / (2.0 * off);
                const double t = (ratio >= 0.0 ? 1.0 : -1.0) / (fabs(ratio) + sqrt(1.0 + ratio * ratio));
                const double c = 1.0 / sqrt(1.0 + t * t), s = c * t;
                turned = 1;
                for (int i = 0; i < size; i++) {
                    const double one = a[i * NV + p], other = a[i * NV + q];
                    a[i * NV + p] = c * one - s * other;
                    a[i * NV + q] = s * one + c * other;
                }
                for (int i = 0; i < size; i++) {
                    const double one = a[p * NV + i], other = a[q * NV + i], u = turn[p * NV + i], w = turn[q * NV + i];
                    a[p * NV + i] = c * one - s * other;
                    a[q * NV + i] = s * one + c * other;
                    turn[p * NV + i] = c * u - s * w;
                    turn[q * NV + i] = s * u + c * w;
                }
            }
    }
}

/* What curvature adds to the first level, and the directions that it takes after those of the rows */
static void take_curvature(wbc_tick *t) {
    wbc_levels *s = &t->levels;
    double local[NV * NV], turn[NV * NV], turned[NV * NV], curved[NV * NV], most = 0.0;
    for (int i = 0; i < NV; i++)
        for (int j = i; j < NV; j++) {
            const double size = dof_scale[i] * dof_scale[j] / s->scale, change = t->H[i * WIDE + j] - t->straight[i * WIDE + j];
            s->curvature[i * NV + j] = s->curvature[j * NV + i] = (change + (i == j ? damping[i] : 0.0)) * size;
            curved[i * NV + j] = curved[j * NV + i] = t->curvature[i * NV + j] * size;
            most = larger(most, fabs(curved[i * NV + j]));
        }
    s->curved = 1;
    const int free = s->width - s->rank;
    double *left = s->basis + s->rank * NV;
    for (int a = 0; a < free; a++) {
        double image[NV];
        for (int i = 0; i < NV; i++) image[i] = inner(curved + i * NV, left + a * NV, NV);
        for (int b = 0; b < free; b++) local[a * NV + b] = inner(image, left + b * NV, NV);
    }
    principal(local, free, turn);
    into_vectors(left, free, turn, free, turned);
    int taken = 0;
    for (int a = 0; a < free; a++) {
        if (!(local[a * NV + a] > BENT * most)) continue;
        exchange(turned + a * NV, turned + taken * NV, NV);
        exchange(local + a * NV + a, local + taken * NV + taken, 1);
        taken++;
    }
    memcpy(left, turned, free * NV * sizeof(double));
    for (int j = 0; j < s->rank + taken; j++) s->damped[j] = 0.0;
    s->rank += taken;
}

/* What curvature adds to H and to the right-hand side */
static void add_level_curvature(wbc_levels *s) {
    for (int i = 0; i < s->rank; i++) {
        double image[NV];
        for (int j = 0; j < NV; j++) image[j] = inner(s->curvature + j * NV, s->basis + i * NV, NV);
        s->plain[i] -= inner(image, s->x, NV);
        s->right[i] = s->plain[i];
        for (int j = 0; j < s->rank; j++) s->H[i * NV + j] += inner(image, s->basis + j * NV, NV);
    }
}

#endif

#endif
