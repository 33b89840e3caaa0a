/* Least singular value of a matrix, with its singular vectors where they are wanted, by one-sided Jacobi rotations.
 * What stands by itself, such as a lock of a joint that moves none of the other rows, is taken out before. */
#ifdef __GNUC__
/* Generated rows are compiled at -O1; these loops are worth more */
#pragma GCC optimize("O3")
#endif
#include <math.h>
#include <string.h>

/* Squares of cosines below this are those of orthogonal vectors; shorter ones than TINY have no direction; sweeps at
 * most */
#define ORTHOGONAL 1e-28
#define TINY 1e-150
#define SWEEPS 40

static double inner(const double *restrict x, const double *restrict y, int count) {
    double sum[4] = {0.0, 0.0, 0.0, 0.0};
    int i = 0;
    for (; i + 4 <= count; i += 4)
        for (int k = 0; k < 4; k++) sum[k] += x[i + k] * y[i + k];
    for (; i < count; i++) sum[0] += x[i] * y[i];
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

static void turn(double *restrict x, double *restrict y, double c, double s, int count) {
    for (int i = 0; i < count; i++) {
        const double kept = x[i];
        x[i] = c * kept - s * y[i];
        y[i] = s * kept + c * y[i];
    }
}

/* `count` vectors of `length` numbers become orthogonal; `side`, where it is not null, becomes the combinations that
 * they are. Returns the shortest one. */
static int separate(double *vectors, int count, int length, double *side) {
    double square[count];
    if (side)
        for (int i = 0; i < count * count; i++) side[i] = i % (count + 1) == 0;
    for (int sweep = 0, turned = 1; turned && sweep < SWEEPS; sweep++) {
        turned = 0;
        /* Anew in every sweep, so that rounding does not add up */
        for (int k = 0; k < count; k++) square[k] = inner(vectors + k * length, vectors + k * length, length);
        for (int a = 0; a < count; a++)
            for (int b = a + 1; b < count; b++) {
                double *x = vectors + a * length, *y = vectors + b * length;
                const double xx = square[a], yy = square[b], xy = inner(x, y, length);
                if (xx < TINY || yy < TINY || xy * xy <= ORTHOGONAL * xx * yy) continue;
                const double ratio = (yy - xx) / (2.0 * xy);
                const double t = (ratio >= 0.0 ? 1.0 : -1.0) / (fabs(ratio) + sqrt(1.0 + ratio * ratio));
                const double c = 1.0 / sqrt(1.0 + t * t);
                turned = 1;
                turn(x, y, c, c * t, length);
                if (side) turn(side + a * count, side + b * count, c, c * t, count);
                square[a] = xx - t * xy;
                square[b] = yy + t * xy;
            }
    }
    int least = 0;
    for (int k = 0; k < count; k++) {
        square[k] = inner(vectors + k * length, vectors + k * length, length);
        if (square[k] < square[least]) least = k;
    }
    return least;
}

/* Leave out of `kept` the lines without entries, as many as there are more lines than `least` */
static int without_empty(int *kept, int count, const int *entries, int least) {
    int left = 0, spare = count - least;
    for (int k = 0; k < count; k++) {
        if (spare > 0 && entries[kept[k]] == 0)
            spare--;
        else
            kept[left++] = kept[k];
    }
    return left;
}

/* matrix: height x width, row by row. left, right: its singular vectors [height], [width], or both null */
double least_singular(const double *matrix, int height, int width, double *left, double *right) {
    int in_row[height], in_column[width], at[height], rows[height], columns[width], taken[width];
    memset(in_row, 0, sizeof in_row);
    memset(in_column, 0, sizeof in_column);
    memset(taken, 0, sizeof taken);
    for (int i = 0; i < height; i++)
        for (int j = 0; j < width; j++)
            if (matrix[i * width + j] != 0.0) {
                in_row[i]++;
                in_column[j]++;
                at[i] = j;
            }
    /* Entries alone in their row and column are singular values */
    int h = 0, w = 0, single = -1;
    double sigma = INFINITY;
    for (int i = 0; i < height; i++)
        if (in_row[i] == 1 && in_column[at[i]] == 1) {
            const double value = fabs(matrix[i * width + at[i]]);
            taken[at[i]] = 1;
            if (value < sigma) {
                sigma = value;
                single = i;
            }
        } else
            rows[h++] = i;
    for (int j = 0; j < width; j++)
        if (!taken[j]) columns[w++] = j;
    w = without_empty(columns, w, in_column, h < w ? h : w);
    h = without_empty(rows, h, in_row, w < h ? w : h);
    if (left) {
        memset(left, 0, height * sizeof(double));
        memset(right, 0, width * sizeof(double));
    }
    if (h > 0 && w > 0) {
        const int wide = h < w, count = wide ? h : w, length = wide ? w : h;
        double vectors[count * length], side[count * count];
        for (int k = 0; k < count; k++)
            for (int i = 0; i < length; i++)
                vectors[k * length + i] = matrix[rows[wide ? k : i] * width + columns[wide ? i : k]];
        const int least = separate(vectors, count, length, left ? side : 0);
        const double *along = vectors + least * length, *mix = side + least * count;
        const double found = sqrt(inner(along, along, length)), f = found > 0.0 ? 1.0 / found : 0.0;
        if (found < sigma) {
            sigma = found;
            single = -1;
            if (left) {
                for (int i = 0; i < h; i++) left[rows[i]] = wide ? mix[i] : f * along[i];
                for (int j = 0; j < w; j++) right[columns[j]] = wide ? f * along[j] : mix[j];
            }
        }
    }
    if (left && single >= 0) {
        left[single] = 1.0;
        right[at[single]] = matrix[single * width + at[single]] < 0.0 ? -1.0 : 1.0;
    }
    return sigma;
}
