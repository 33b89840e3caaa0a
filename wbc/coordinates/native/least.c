/* Least singular values of several matrices that share their rows, with both singular vectors and the slope along q.
 *
 * Before this text stand the generated functions `rates` (q -> all rows, by columns) and `slope` (q, left, right ->
 * gradient of left' rows right along the tangent space), and the sizes and tables of the groups. */
#ifdef __GNUC__
/* Generated rows are compiled at -O1; these loops are worth more */
#pragma GCC optimize("O3")
#endif
#include <math.h>
#include <string.h>

/* Vectors at this cosine are orthogonal; shorter ones than TINY have no direction; sweeps at most */
#define ORTHOGONAL 1e-14
#define TINY 1e-150
#define SWEEPS 40

static double inner(const double *x, const double *y, int count) {
    double sum = 0.0;
    for (int i = 0; i < count; i++) sum += x[i] * y[i];
    return sum;
}

static void turn(double *x, double *y, double c, double s, int count) {
    for (int i = 0; i < count; i++) {
        const double kept = x[i];
        x[i] = c * kept - s * y[i];
        y[i] = s * kept + c * y[i];
    }
}

/* One-sided Jacobi: `count` vectors of `length` numbers become orthogonal; `side`, the identity before, holds the
 * combinations that they are. Returns the shortest one. */
static int separate(double *vectors, int count, int length, double *side) {
    for (int i = 0; i < count * count; i++) side[i] = i % (count + 1) == 0;
    for (int sweep = 0, turned = 1; turned && sweep < SWEEPS; sweep++) {
        turned = 0;
        for (int a = 0; a < count; a++)
            for (int b = a + 1; b < count; b++) {
                double *x = vectors + a * length, *y = vectors + b * length;
                const double xx = inner(x, x, length), yy = inner(y, y, length), xy = inner(x, y, length);
                if (xx < TINY || yy < TINY || fabs(xy) <= ORTHOGONAL * sqrt(xx * yy)) continue;
                const double ratio = (yy - xx) / (2.0 * xy);
                const double t = (ratio >= 0.0 ? 1.0 : -1.0) / (fabs(ratio) + sqrt(1.0 + ratio * ratio));
                const double c = 1.0 / sqrt(1.0 + t * t);
                turned = 1;
                turn(x, y, c, c * t, length);
                turn(side + a * count, side + b * count, c, c * t, count);
            }
    }
    int least = 0;
    double shortest = INFINITY;
    for (int k = 0; k < count; k++) {
        const double square = inner(vectors + k * length, vectors + k * length, length);
        if (square < shortest) {
            shortest = square;
            least = k;
        }
    }
    return least;
}

/* Group g: its least singular value; left singular vector over all rows, right one over all joints */
static double group(const double *rows, int g, double *left, double *right) {
    double vectors[MOST * MOST], side[MOST * MOST];
    const int first = group_start[g], height = group_start[g + 1] - first, wide = height < NV;
    const int count = wide ? height : NV, length = wide ? NV : height;
    for (int k = 0; k < count; k++)
        for (int i = 0; i < length; i++) {
            const int row = group_row[first + (wide ? k : i)], column = wide ? i : k;
            vectors[k * length + i] = row_scale[row] * rows[column * ROWS + row] * dof_scale[column];
        }
    const int least = separate(vectors, count, length, side);
    const double *along = vectors + least * length, *mix = side + least * count;
    const double sigma = sqrt(inner(along, along, length)), f = sigma > 0.0 ? 1.0 / sigma : 0.0;
    memset(left, 0, ROWS * sizeof(double));
    for (int i = 0; i < height; i++) left[group_row[first + i]] = wide ? mix[i] : f * along[i];
    for (int i = 0; i < NV; i++) right[i] = wide ? f * along[i] : mix[i];
    return sigma;
}

/* sigma: GROUPS numbers. slopes: GROUPS x NV along q, or null. right: GROUPS x NV, or null */
void conditioning(const double *q, double *sigma, double *slopes, double *right) {
    double rows[ROWS * NV], left[ROWS], seen[NV], work[WORK_W];
    long long int places[WORK_IW];
    const double *arguments[ARGUMENTS];
    double *results[ARGUMENTS];
    arguments[0] = q;
    results[0] = rows;
    rates(arguments, results, places, work, 0);
    for (int g = 0; g < GROUPS; g++) {
        double *direction = right ? right + g * NV : seen;
        sigma[g] = group(rows, g, left, direction);
        if (!slopes) continue;
        double scaled[NV];
        for (int i = 0; i < ROWS; i++) left[i] *= row_scale[i];
        for (int i = 0; i < NV; i++) scaled[i] = direction[i] * dof_scale[i];
        arguments[0] = q;
        arguments[1] = left;
        arguments[2] = scaled;
        results[0] = slopes + g * NV;
        slope(arguments, results, places, work, 0);
    }
}
