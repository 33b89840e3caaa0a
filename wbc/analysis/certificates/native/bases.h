/* Singular values of a small matrix with bases of both sides, by one-sided Jacobi turns. */
#ifndef BASES_H
#define BASES_H

#include "form.h"

typedef struct {
    int rows, cols;                             /* rows >= cols */
    double left[MOST_ROWS][MOST_ROWS];          /* left[k]: orthonormal in R^rows; the first cols belong to sigma */
    double right[MOST_COLS][MOST_COLS];         /* right[k]: orthonormal in R^cols */
    double sigma[MOST_COLS];                    /* largest first */
} Bases;

static double dot(const double *a, const double *b, int n)
{
    double sum = 0.0;
    for (int i = 0; i < n; ++i)
        sum += a[i] * b[i];
    return sum;
}

static void turn(double *a, double *b, int n, double c, double s)
{
    for (int i = 0; i < n; ++i) {
        const double x = a[i], y = b[i];
        a[i] = c * x - s * y;
        b[i] = s * x + c * y;
    }
}

static void swap_rows(double *a, double *b, int n)
{
    turn(a, b, n, 0.0, 1.0);
}

/* Unit vector at right angles to the first `known` ones, in place k: the unit vector that sticks out most. */
static void complete(double vectors[][MOST_ROWS], int k, int known, int n)
{
    double best = -1.0, trial[MOST_ROWS];
    for (int axis = 0; axis < n; ++axis) {
        memset(trial, 0, sizeof trial);
        trial[axis] = 1.0;
        for (int pass = 0; pass < 2; ++pass)
            for (int j = 0; j < known; ++j) {
                const double along = dot(trial, vectors[j], n);
                for (int i = 0; i < n; ++i)
                    trial[i] -= along * vectors[j][i];
            }
        const double size = sqrt(dot(trial, trial, n));
        if (size > best) {
            best = size;
            for (int i = 0; i < n; ++i)
                vectors[k][i] = trial[i] / size;
        }
    }
}

/* Of the rows x cols matrix whose entry (i, j) is at a[i * across + j * down]; left bases are made up to `wanted`. */
static void bases(const double *a, int rows, int cols, int across, int down, int wanted, Bases *out)
{
    double (*u)[MOST_ROWS] = out->left;
    out->rows = rows;
    out->cols = cols;
    for (int j = 0; j < cols; ++j) {
        for (int i = 0; i < rows; ++i)
            u[j][i] = a[i * across + j * down];
        for (int i = 0; i < cols; ++i)
            out->right[j][i] = i == j;
    }
    for (int sweep = 0; sweep < 30; ++sweep) {
        int quiet = 1;
        for (int p = 0; p < cols - 1; ++p)
            for (int q = p + 1; q < cols; ++q) {
                const double alpha = dot(u[p], u[p], rows), beta = dot(u[q], u[q], rows);
                const double gamma = dot(u[p], u[q], rows);
                if (gamma * gamma <= 1e-26 * alpha * beta || gamma == 0.0)
                    continue;
                const double zeta = (beta - alpha) / (2.0 * gamma);
                const double t = (zeta >= 0.0 ? 1.0 : -1.0) / (fabs(zeta) + sqrt(1.0 + zeta * zeta));
                const double c = 1.0 / sqrt(1.0 + t * t);
                turn(u[p], u[q], rows, c, c * t);
                turn(out->right[p], out->right[q], cols, c, c * t);
                quiet = 0;
            }
        if (quiet)
            break;
    }
    for (int j = 0; j < cols; ++j)
        out->sigma[j] = sqrt(dot(u[j], u[j], rows));
    for (int p = 0; p < cols - 1; ++p)
        for (int q = p + 1; q < cols; ++q)
            if (out->sigma[q] > out->sigma[p]) {
                const double larger = out->sigma[q];
                out->sigma[q] = out->sigma[p];
                out->sigma[p] = larger;
                swap_rows(u[p], u[q], rows);
                swap_rows(out->right[p], out->right[q], cols);
            }
    int known = 0;
    for (; known < cols && out->sigma[known] > 1e-7 * out->sigma[0]; ++known)
        for (int i = 0; i < rows; ++i)
            u[known][i] /= out->sigma[known];
    for (; known < wanted; ++known)
        complete(u, known, known, rows);
}

/* out[i][j] = left[i]' A right[j] of an entry-wise table, for i < height, j < width; absolute: of absolute values. */
static void seen_in(const double *a, int across, int down, const Bases *b, int height, int width, int absolute,
                    double out[][MOST_ROWS])
{
    double half[MOST_ROWS][MOST_COLS];
    for (int i = 0; i < b->rows; ++i)
        for (int j = 0; j < width; ++j) {
            double sum = 0.0;
            for (int k = 0; k < b->cols; ++k) {
                const double x = a[i * across + k * down], y = b->right[j][k];
                sum += absolute ? x * fabs(y) : x * y;
            }
            half[i][j] = sum;
        }
    for (int i = 0; i < height; ++i)
        for (int j = 0; j < width; ++j) {
            double sum = 0.0;
            for (int k = 0; k < b->rows; ++k)
                sum += (absolute ? fabs(b->left[i][k]) : b->left[i][k]) * half[k][j];
            out[i][j] = sum;
        }
}

#endif
