/* Vectors of three numbers, and poses: a rotation row by row, then a position. */
#ifndef WBC_VECTORS_H
#define WBC_VECTORS_H

#include <math.h>
#include <string.h>

static inline double dot3(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline void cross3(const double *a, const double *b, double *out) {
    const double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
    out[0] = x, out[1] = y, out[2] = z;
}

static inline void copy3(const double *a, double *out) { out[0] = a[0], out[1] = a[1], out[2] = a[2]; }

static inline void minus3(const double *a, const double *b, double *out) {
    for (int k = 0; k < 3; k++) out[k] = a[k] - b[k];
}

/* out = a + s b */
static inline void along3(const double *a, double s, const double *b, double *out) {
    for (int k = 0; k < 3; k++) out[k] = a[k] + s * b[k];
}

/* out = R a; not in place */
static inline void turn(const double *R, const double *a, double *out) {
    for (int k = 0; k < 3; k++) out[k] = dot3(R + 3 * k, a);
}

/* out = R' a; not in place */
static inline void turn_back(const double *R, const double *a, double *out) {
    for (int k = 0; k < 3; k++) out[k] = R[k] * a[0] + R[3 + k] * a[1] + R[6 + k] * a[2];
}

/* out = A B for rotations; not in place */
static inline void turns(const double *A, const double *B, double *out) {
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) out[3 * i + k] = A[3 * i] * B[k] + A[3 * i + 1] * B[3 + k] + A[3 * i + 2] * B[6 + k];
}

/* The rotation about the unit vector u by an angle with this cosine and sine. Not inlined: gcc 12 makes multiply-adds of it there,
 * whatever -ffp-contract says, and ticks would differ between processors */
static __attribute__((noinline, unused)) void axis_angle(const double *u, double c, double s, double *R) {
    const double t = 1.0 - c;
    R[0] = c + t * u[0] * u[0], R[1] = t * u[0] * u[1] - s * u[2], R[2] = t * u[0] * u[2] + s * u[1];
    R[3] = t * u[0] * u[1] + s * u[2], R[4] = c + t * u[1] * u[1], R[5] = t * u[1] * u[2] - s * u[0];
    R[6] = t * u[0] * u[2] - s * u[1], R[7] = t * u[1] * u[2] + s * u[0], R[8] = c + t * u[2] * u[2];
}

/* out = A * B for poses; not in place */
static inline void compose(const double *A, const double *B, double *out) {
    turns(A, B, out);
    turn(A, B + 9, out + 9);
    for (int k = 0; k < 3; k++) out[9 + k] += A[9 + k];
}

#endif
