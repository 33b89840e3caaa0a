/* Spaces as rows of orthonormal vectors, and the one rank-revealing factorisation that levels share. */
#ifndef WBC_SPACES_H
#define WBC_SPACES_H

#include "certify.h"

#if LEVELS > 0

/* Singular values below this are damped */
#define ONSET 1e-2
/* Rows whose remainder is shorter than this have no direction of their own */
#define NOTHING 1e-10
/* Directions that binding rows or equalities share by less than this angle count as one */
#define SHARED 1e-7
/* Remainders that differ by less than this share are equally good pivots: the first one is taken */
#define TIE 1e-6
/* Columns at this cosine are orthogonal; columns shorter than TINY_COLUMN have no direction; sweeps at most */
#define ORTHOGONAL 1e-15
#define TINY_COLUMN 1e-14
#define SWEEPS 40

INLINE double inner(const double *x, const double *y, int count) {
    double sum = 0.0;
    for (int i = 0; i < count; i++) sum += x[i] * y[i];
    return sum;
}

INLINE void add_to(double *out, const double *in, double f, int count) {
    for (int i = 0; i < count; i++) out[i] += f * in[i];
}

INLINE void exchange(double *x, double *y, int count) {
    for (int i = 0; i < count; i++) {
        const double kept = x[i];
        x[i] = y[i];
        y[i] = kept;
    }
}

/* The row that is taken next, or -1 where what is left of all is no longer than `least` */
static int best_row(const double *rows, int from, int count, int width, double least) {
    double square[LEVEL_MOST + 1], longest = 0.0;
    for (int i = from; i < count; i++) {
        square[i] = inner(rows + i * NV + from, rows + i * NV + from, width - from);
        longest = larger(longest, square[i]);
    }
    if (!(longest > least * least)) return -1;
    int best = from;
    while (square[best] < (1.0 - 2.0 * TIE) * longest) best++;
    return best;
}

/* Householder's factorisation with pivoting. `rows` (count of them, NV apart, of `width` numbers) becomes the lower
 * trapezoid L, in the order `order`, and q orthonormal rows with rows = L q. Those of q beyond the rank, which is
 * returned, are the directions that no row sees. */
static int reduce(double *rows, int count, int width, double least, int *order, double *q) {
    double mirror[NV * NV], factor[NV];
    const int most = count < width ? count : width;
    int rank = 0;
    for (int i = 0; i < count; i++) order[i] = i;
    for (; rank < most; rank++) {
        const int best = best_row(rows, rank, count, width, least), left = width - rank, was = order[rank];
        if (best < 0) break;
        double *row = rows + rank * NV + rank, *axis = mirror + rank * NV;
        exchange(rows + best * NV, rows + rank * NV, width);
        order[rank] = order[best];
        order[best] = was;
        const double length = sqrt(inner(row, row, left)), end = row[0] > 0.0 ? -length : length;
        memcpy(axis, row, left * sizeof(double));
        axis[0] -= end;
        factor[rank] = 1.0 / (length * (length + fabs(row[0])));
        for (int i = rank + 1; i < count; i++) {
            double *other = rows + i * NV + rank;
            add_to(other, axis, -factor[rank] * inner(axis, other, left), left);
        }
        row[0] = end;
        for (int j = 1; j < left; j++) row[j] = 0.0;
    }
    for (int j = 0; j < width; j++) {
        double *direction = q + j * NV;
        for (int i = 0; i < width; i++) direction[i] = i == j;
        for (int k = rank - 1; k >= 0; k--)
            add_to(direction + k, mirror + k * NV, -factor[k] * inner(mirror + k * NV, direction + k, width - k), width - k);
    }
    return rank;
}

/* Jacobi's rotations until the columns of L are orthogonal, each with the direction that it is along */
static void separate(double *columns, int rank, int count, double *q, int width) {
    for (int sweep = 0, turned = 1; turned && sweep < SWEEPS; sweep++) {
        turned = 0;
        for (int a = 0; a < rank; a++)
            for (int b = a + 1; b < rank; b++) {
                double *x = columns + a * LEVEL_MOST, *y = columns + b * LEVEL_MOST;
                const double xx = inner(x, x, count), yy = inner(y, y, count), xy = inner(x, y, count);
                if (smaller(xx, yy) < TINY_COLUMN * TINY_COLUMN || fabs(xy) <= ORTHOGONAL * sqrt(xx * yy)) continue;
                const double ratio = (yy - xx) / (2.0 * xy);
                const double t = (ratio >= 0.0 ? 1.0 : -1.0) / (fabs(ratio) + sqrt(1.0 + ratio * ratio));
                const double c = 1.0 / sqrt(1.0 + t * t), s = c * t;
                turned = 1;
                for (int i = 0; i < count; i++) {
                    const double kept = x[i];
                    x[i] = c * kept - s * y[i];
                    y[i] = s * kept + c * y[i];
                }
                for (int i = 0; i < width; i++) {
                    const double kept = q[a * NV + i];
                    q[a * NV + i] = c * kept - s * q[b * NV + i];
                    q[b * NV + i] = s * kept + c * q[b * NV + i];
                }
            }
    }
}

/* A lower bound of the least singular value of the first `rank` rows of L, a triangle */
static double least_singular(const double *rows, int rank) {
    double inverse[NV * NV], square = 0.0;
    for (int c = 0; c < rank; c++)
        for (int r = c; r < rank; r++) {
            double sum = r == c;
            for (int k = c; k < r; k++) sum -= rows[r * NV + k] * inverse[k * NV + c];
            inverse[r * NV + c] = sum / rows[r * NV + r];
            square += inverse[r * NV + c] * inverse[r * NV + c];
        }
    return rank > 0 ? 1.0 / sqrt(square) : WBC_INF;
}

/* out = rows of `directions` (count of them, in coordinates of `space`) as vectors of v / dof_scale */
static void into_vectors(const double *space, int width, const double *directions, int count, double *out) {
    for (int j = 0; j < count; j++) {
        for (int i = 0; i < NV; i++) out[j * NV + i] = 0.0;
        for (int k = 0; k < width; k++) add_to(out + j * NV, space + k * NV, directions[j * NV + k], NV);
    }
}

#endif

#endif
