/* Distances of many shapes or segments in one call. No memory is allocated. */
#include "measure.h"
#include "segments.h"

long long wbc_shape_size(void) { return (long long)sizeof(shape_t); }

/* Of n segments a b and c d, 3 numbers an end */
void wbc_segment_distances(long n, const double *a, const double *b, const double *c, const double *d, double *out) {
    for (long k = 0; k < n; k++) out[k] = segment_distance(a + 3 * k, b + 3 * k, c + 3 * k, d + 3 * k);
}

/* Of n pairs of shapes at the poses of their centres (12 each): distance, normal, point, 7 each */
void wbc_distances(const tolerance_t *how, const shape_t *shape, const double *pose, long n, const int *first, const int *second,
                   double *out) {
    for (long k = 0; k < n; k++, out += 7) {
        answer_t found;
        measure_shapes(how, shape + first[k], pose + 12 * first[k], shape + second[k], pose + 12 * second[k], &found);
        out[0] = found.gap;
        copy3(found.normal, out + 1);
        copy3(found.point, out + 4);
    }
}

/* Of n segments a b from a shape, in its frame */
void wbc_segments_from(const tolerance_t *how, const shape_t *shape, long n, const double *a, const double *b, double *out) {
    const double here[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    for (long k = 0; k < n; k++) {
        double z[3], x[3], y[3], pose[12];
        answer_t found;
        minus3(b + 3 * k, a + 3 * k, z);
        const double length = sqrt(dot3(z, z));
        const shape_t segment = {SUM, 0, {0.0, 0.0, 0.5 * length, 0.0, 0.0, 0.5 * length}};
        for (int i = 0; i < 3; i++) z[i] = length > 0.0 ? z[i] / length : i == 2;
        const double other[3] = {fabs(z[0]) <= 0.6, fabs(z[0]) > 0.6, 0.0};
        cross3(z, other, y);
        const double size = sqrt(dot3(y, y));
        for (int i = 0; i < 3; i++) y[i] /= size;
        cross3(y, z, x);
        for (int i = 0; i < 3; i++) {
            pose[3 * i] = x[i], pose[3 * i + 1] = y[i], pose[3 * i + 2] = z[i];
            pose[9 + i] = 0.5 * (a[3 * k + i] + b[3 * k + i]);
        }
        measure_shapes(how, &segment, pose, shape, here, &found);
        out[k] = found.gap;
    }
}
