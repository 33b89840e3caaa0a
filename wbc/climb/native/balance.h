/* How much slack wrenches in the cones of contacts have that bear the robot's weight: a linear program, by its dual.
 *
 *     t* = max t     over x, t <= 1     with  G x = r,   A x + s t <= b,   |Z'x| <= ROOM
 *
 * r is affine in the centre of mass. With G' = Q (R; 0), Q = (Y, Z) and x = Y R'^-1 r + Z u only u and t are free, and the dual
 *
 *     min (b - A Y R'^-1 r)'z     with  Z'A'z + box = 0,   s'z + cap = 1,   z >= 0
 *
 * has a feasible basis at once: the box and the cap. Each of its solutions bounds t* for every centre of mass. */
#ifndef WBC_BALANCE_H
#define WBC_BALANCE_H

#include "vectors.h"
#include <stdlib.h>

/* Greatest force by which contacts may squeeze what is between them, in weights */
#define ROOM 1e3
/* What a reduced cost or a pivot must exceed */
#define TINY 1e-10

/* t*, and the coefficients of the bound t(r) = bound[0] + bound[1..6] r that holds there; -INFINITY: contacts of less than six
 * independent wrenches, 0 in `bound` then. G: 6 x n, A: m x n; work: see balance_work */
static double largest_slack(int n, int m, const double *G, const double *r, const double *A, const double *b, const double *s,
                            double *bound, double *work) {
    const int p = n - 6, rows = p + 1, columns = m + 2 * p + 1;
    memset(bound, 0, 7 * sizeof *bound);
    if (p < 0) return -INFINITY;
    double *Q = work, *B = Q + n * 6, *T = B + m * n, *cost = T + rows * (columns + 2), R[36], g[6], y[6] = {0};
    int *basis = (int *)(cost + columns);
    /* Householder vectors of G' in Q, and B = A Q */
    for (int i = 0; i < n; i++)
        for (int k = 0; k < 6; k++) Q[i * 6 + k] = G[k * n + i];
    memcpy(B, A, (size_t)(m * n) * sizeof *B);
    for (int k = 0; k < 6; k++) {
        double size = 0.0, all = 0.0;
        for (int i = 0; i < n; i++) all += G[k * n + i] * G[k * n + i];
        for (int i = k; i < n; i++) size += Q[i * 6 + k] * Q[i * 6 + k];
        if (!(size > 1e-14 * (all + 1e-300))) return -INFINITY;
        const double top = Q[k * 6 + k] > 0.0 ? -sqrt(size) : sqrt(size), first = Q[k * 6 + k] - top, by = -1.0 / (top * first);
        Q[k * 6 + k] = first;
        for (int j = k + 1; j < 6; j++) {
            double sum = 0.0;
            for (int i = k; i < n; i++) sum += Q[i * 6 + k] * Q[i * 6 + j];
            for (int i = k; i < n; i++) Q[i * 6 + j] -= by * sum * Q[i * 6 + k];
        }
        for (int j = 0; j < m; j++) {
            double sum = 0.0;
            for (int i = k; i < n; i++) sum += Q[i * 6 + k] * B[j * n + i];
            for (int i = k; i < n; i++) B[j * n + i] -= by * sum * Q[i * 6 + k];
        }
        for (int j = 0; j < k; j++) R[j * 6 + k] = Q[j * 6 + k];
        R[k * 6 + k] = top;
    }
    for (int k = 0; k < 6; k++) { /* R' g = r */
        g[k] = r[k];
        for (int j = 0; j < k; j++) g[k] -= R[j * 6 + k] * g[j];
        g[k] /= R[k * 6 + k];
    }
    for (int i = 0; i < m; i++) {
        cost[i] = b[i];
        for (int k = 0; k < 6; k++) cost[i] -= B[i * n + k] * g[k];
    }
    for (int k = 0; k < 2 * p; k++) cost[m + k] = ROOM;
    cost[m + 2 * p] = 1.0;
    /* Columns: z, box above, box below, cap; then the sides as they are, and a little apart so that no basis comes twice */
    const int wide = columns + 2;
    for (int j = 0; j < rows; j++) {
        double *row = T + j * wide;
        memset(row, 0, (size_t)wide * sizeof *row);
        for (int i = 0; i < m; i++) row[i] = j < p ? B[i * n + 6 + j] : s[i];
        if (j < p) row[m + j] = 1.0, row[m + p + j] = -1.0;
        row[m + 2 * p] = row[columns] = j == p;
        row[columns + 1] = (j == p) + 1e-8 * (1.0 + 0.61803398874989 * j - floor(0.61803398874989 * j));
        basis[j] = j < p ? m + j : m + 2 * p;
    }
    double *price = cost + columns + rows; /* reduced costs; `basis` lies between */
    for (int i = 0; i < columns; i++) {
        price[i] = cost[i];
        for (int j = 0; j < rows; j++) price[i] -= cost[basis[j]] * T[j * wide + i];
    }
    for (int pivot = 0; pivot < 50 * rows + 200; pivot++) {
        int in = -1, out = -1;
        double least = -1e-9, ratio = INFINITY;
        for (int i = 0; i < columns; i++)
            if (price[i] < least) {
                least = price[i], in = i;
                if (pivot > 20 * rows + 100) break;
            }
        if (in < 0) break;
        for (int j = 0; j < rows; j++) {
            const double d = T[j * wide + in];
            if (d > TINY && T[j * wide + columns + 1] < ratio * d) ratio = T[j * wide + columns + 1] / d, out = j;
        }
        if (out < 0) return -INFINITY;
        double *row = T + out * wide;
        const double by = 1.0 / row[in];
        for (int i = 0; i < wide; i++) row[i] *= by;
        for (int j = 0; j < rows; j++) {
            const double d = T[j * wide + in];
            if (j == out || d == 0.0) continue;
            for (int i = 0; i < wide; i++) T[j * wide + i] -= d * row[i];
        }
        const double d = price[in];
        for (int i = 0; i < columns; i++) price[i] -= d * row[i];
        basis[out] = in;
    }
    double slack = 0.0;
    for (int j = 0; j < rows; j++) {
        const double z = T[j * wide + columns];
        slack += cost[basis[j]] * z;
        bound[0] += (basis[j] < m ? b[basis[j]] : cost[basis[j]]) * z;
        if (basis[j] < m)
            for (int k = 0; k < 6; k++) y[k] -= B[basis[j] * n + k] * z;
    }
    for (int k = 5; k >= 0; k--) { /* bound = R^-1 y */
        bound[1 + k] = y[k];
        for (int j = k + 1; j < 6; j++) bound[1 + k] -= R[k * 6 + j] * bound[1 + j];
        bound[1 + k] /= R[k * 6 + k];
    }
    return slack;
}

/* Numbers that largest_slack works on */
static size_t balance_work(int n, int m) {
    const size_t p = n > 6 ? n - 6 : 0, rows = p + 1, columns = m + 2 * p + 1;
    return 6 * n + (size_t)m * n + rows * (columns + 2) + 2 * columns + rows + 8;
}

#endif
