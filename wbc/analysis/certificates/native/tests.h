/* The two proofs for a box: full column rank of one matrix, a small singular value of another one. */
#ifndef TESTS_H
#define TESTS_H

#include "bases.h"

/* Relative tolerance for the rounding of sums of non-negative numbers */
static const double ROOM = 1e-9;
/* Least variation of a row or column that counts, relative to the largest */
static const double FLOOR = 0.01;

/* Spread of the entries over the box in the bases: first-order parts of each joint, and all together with the rest. */
typedef struct {
    double part[MOST_JOINTS][MOST_ROWS][MOST_ROWS];
    double rest[MOST_ROWS][MOST_ROWS];
    double total[MOST_ROWS][MOST_ROWS];
} Spread;

static void spread(const Local *local, int across, int down, const Bases *b, int height, int width, Spread *out)
{
    seen_in(local->rest, across, down, b, height, width, 1, out->rest);
    for (int i = 0; i < height; ++i)
        for (int j = 0; j < width; ++j)
            out->total[i][j] = out->rest[i][j] * (1.0 + ROOM);
    for (int k = 0; k < local->count; ++k) {
        const int joint = local->used[k];
        seen_in(local->slope[joint], across, down, b, height, width, 0, out->part[joint]);
        for (int i = 0; i < height; ++i)
            for (int j = 0; j < width; ++j) {
                out->part[joint][i][j] = fabs(out->part[joint][i][j]);
                out->total[i][j] += out->part[joint][i][j] * (1.0 + ROOM);
            }
    }
}

/* What the tests work in: too large for the stacks of small functions */
typedef struct {
    Local local;
    Bases bases;
    Spread spread;
    double middle[MOST_ROWS][MOST_ROWS], A[MOST_ROWS][MOST_ROWS], B[MOST_ROWS][MOST_ROWS], x[MOST_ROWS][MOST_ROWS];
} Workspace;

/* What of an amount that the rest causes each joint stands for. */
static void share(const Local *local, double amount, double *cut)
{
    double sum = 1e-300;
    for (int k = 0; k < local->count; ++k)
        sum += local->weight[local->used[k]];
    for (int k = 0; k < local->count; ++k)
        cut[local->used[k]] += amount * local->weight[local->used[k]] / sum;
}

/* Rows, then columns, divided by how much they vary over the box: what is certain counts for more. No rank changes. */
static void equilibrate(Local *local, int rows, int cols)
{
    double factor[2][MOST_ROWS], largest;
    for (int side = 0; side < 2; ++side) {
        const int lines = side ? cols : rows, along = side ? rows : cols;
        const int step = side ? cols : 1, stride = side ? 1 : cols;
        largest = 0.0;
        for (int i = 0; i < lines; ++i) {
            double sum = 0.0;
            for (int j = 0, e = i * stride; j < along; ++j, e += step) {
                sum += local->rest[e] * local->rest[e];
                for (int k = 0; k < local->count; ++k)
                    sum += local->slope[local->used[k]][e] * local->slope[local->used[k]][e];
            }
            factor[side][i] = sqrt(sum);
            largest = fmax(largest, factor[side][i]);
        }
        for (int i = 0; i < lines; ++i) {
            const double by = 1.0 / (factor[side][i] + FLOOR * largest + 1e-300);
            for (int j = 0, e = i * stride; j < along; ++j, e += step) {
                local->value[e] *= by;
                local->rest[e] *= by;
                for (int k = 0; k < local->count; ++k)
                    local->slope[local->used[k]][e] *= by;
            }
        }
    }
}

/* What each joint adds to the largest eigenvalue of the bounds B: y' (its part of B) d / y'd with the left vector y. */
static void ratio_by_joint(const Bases *b, const Spread *s, const Local *local, const double *d, int n, double *cut)
{
    double y[MOST_COLS], next[MOST_COLS], rest = 0.0, along = 0.0, scale[MOST_COLS];
    for (int i = 0; i < n; ++i) {
        y[i] = 1.0;
        scale[i] = 1.0 / fmax(b->sigma[i], 1e-9 * b->sigma[0]);
    }
    for (int pass = 0; pass < 8; ++pass) {
        double largest = 1e-300;
        for (int j = 0; j < n; ++j) {
            next[j] = 0.3 * y[j];
            for (int i = 0; i < n; ++i)
                next[j] += y[i] * s->total[i][j];
            largest = fmax(largest, next[j]);
        }
        for (int j = 0; j < n; ++j)
            y[j] = next[j] / largest;
    }
    for (int i = 0; i < n; ++i)
        along += y[i] * d[i];
    for (int i = 0; i < n; ++i) {
        for (int k = 0; k < local->count; ++k)
            cut[local->used[k]] += y[i] * scale[i] * dot(s->part[local->used[k]][i], d, n) / along;
        rest += y[i] * scale[i] * dot(s->rest[i], d, n) / along;
    }
    share(local, rest, cut);
}

/* Whether M has full column rank on the box. With S^-1 U' M V = I + E at each of its points, |E| <= B entry by entry,
   and some d > 0 with B d < d, no I + E is singular (Perron and Frobenius). Returns max (B d)_i / d_i; below 1 it is
   proved. `cut`: how much each joint adds to it. */
static double regular(const Form *f, const double *centre, const double *half, double *cut, Workspace *work)
{
    Local *local = &work->local;
    Bases *b = &work->bases;
    Spread *s = &work->spread;
    const int n = f->cols;
    double d[MOST_COLS], next[MOST_COLS], ratio = 0.0;
    form_local(f, centre, half, local);
    equilibrate(local, f->rows, n);
    bases(local->value, f->rows, n, n, 1, n, b);
    if (b->sigma[0] <= 0.0)
        return INFINITY;
    spread(local, n, 1, b, n, n, s);
    seen_in(local->value, n, 1, b, n, n, 0, work->middle);
    for (int i = 0; i < n; ++i) {
        const double size = fmax(b->sigma[i], 1e-9 * b->sigma[0]);
        d[i] = 1.0;
        for (int j = 0; j < n; ++j) {
            const double off = fabs(work->middle[i][j] - (i == j ? size : 0.0));
            s->total[i][j] = (s->total[i][j] + off * (1.0 + ROOM) + 1e-13 * b->sigma[0]) / size;
        }
    }
    for (int pass = 0; pass < 12; ++pass) {
        double largest = 0.0;
        ratio = 0.0;
        for (int i = 0; i < n; ++i) {
            next[i] = dot(s->total[i], d, n);
            ratio = fmax(ratio, next[i] / d[i]);
        }
        if (ratio < 1.0 - ROOM)
            return ratio * (1.0 + ROOM);
        if (pass == 11)
            break;
        for (int i = 0; i < n; ++i)
            largest = fmax(largest, next[i] += 0.3 * d[i]);
        for (int i = 0; i < n; ++i)
            d[i] = next[i] / largest + 1e-7;
    }
    ratio_by_joint(b, s, local, d, n, cut);
    return ratio;
}

/* x >= 0 with A x + B <= x for non-negative A, B (n x width), column by column, so that (I - A)^-1 B <= x; 0 if none
   was found. By elimination without pivots, which an M-matrix allows. */
static int dominating(int n, int width, double A[][MOST_ROWS], double B[][MOST_ROWS], double x[][MOST_ROWS])
{
    double m[MOST_ROWS][MOST_ROWS];
    for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j)
            m[i][j] = (i == j) - A[i][j];
        for (int c = 0; c < width; ++c)
            x[i][c] = B[i][c] * (1.0 + 1e-4) + 1e-12;
    }
    for (int p = 0; p < n; ++p) {
        if (m[p][p] < 1e-3)
            return 0;
        for (int i = p + 1; i < n; ++i) {
            const double r = m[i][p] / m[p][p];
            for (int j = p; j < n; ++j)
                m[i][j] -= r * m[p][j];
            for (int c = 0; c < width; ++c)
                x[i][c] -= r * x[p][c];
        }
    }
    for (int i = n - 1; i >= 0; --i)
        for (int c = 0; c < width; ++c) {
            for (int j = i + 1; j < n; ++j)
                x[i][c] -= m[i][j] * x[j][c];
            x[i][c] /= m[i][i];
        }
    for (int i = 0; i < n; ++i)
        for (int c = 0; c < width; ++c) {
            double sum = B[i][c];
            for (int j = 0; j < n; ++j)
                sum += A[i][j] * x[j][c];
            if (!(x[i][c] >= sum * (1.0 + ROOM)))
                return 0;
        }
    return 1;
}

/* The bound of `tube` with the first `strong` singular values eliminated, and which joints it is due to; INFINITY
   where they cannot be. In the bases of J at the centre J = [S + A, B; c', g'] with the smallest singular value last
   and the weak ones, which only lie in B and g, between; with y' = c' (S + A)^-1 the vector (-y, 0, 1), no shorter
   than 1, times J is (0, g - y'B). */
static double eliminated(int strong, int n, int m, const Local *local, double *cut, Workspace *work)
{
    const Bases *b = &work->bases;
    const Spread *s = &work->spread;
    const int last = n - 1, width = m - strong;
    const double pad = 1e-13 * b->sigma[0];
    double size = 0.0, rest = 0.0;
    for (int i = 0; i < strong; ++i) {
        const double sigma = fmax(b->sigma[i], 1e-6 * b->sigma[0]);
        for (int j = 0; j < strong; ++j)
            work->A[i][j] = (s->total[j][i] + fabs(work->middle[j][i] - (i == j ? sigma : 0.0)) + pad) / sigma;
        for (int c = 0; c < width; ++c)
            work->B[i][c] = (s->total[strong + c][i] + fabs(work->middle[strong + c][i]) + pad) / sigma;
    }
    if (!dominating(strong, width, work->A, work->B, work->x))
        return INFINITY;
    for (int c = 0; c < width; ++c) {
        double sum = s->total[strong + c][last] + fabs(work->middle[strong + c][last]) + pad;
        for (int j = 0; j < strong; ++j)
            sum += (s->total[j][last] + fabs(work->middle[j][last]) + pad) * work->x[j][c];
        size += sum * sum;
        rest += s->rest[strong + c][last];
    }
    memset(cut, 0, sizeof(double) * MOST_JOINTS);
    for (int k = 0; k < local->count; ++k) {
        const double (*part)[MOST_ROWS] = s->part[local->used[k]];
        for (int c = 0; c < width; ++c) {
            double sum = part[strong + c][last];
            for (int j = 0; j < strong; ++j)
                sum += part[j][last] * work->x[j][c] + s->total[j][last] * part[strong + c][j] / b->sigma[j];
            cut[local->used[k]] += sum;
        }
    }
    share(local, rest, cut);
    return sqrt(size) * (1.0 + 1e-6);
}

/* Upper bound of the smallest singular value of J (rows <= cols) on the box, the best with all other singular values
   eliminated or fewer of them: those that are small as well are better left alone. `centre_value`: the singular value
   at the centre, `least`: a lower bound on the box, by the Frobenius norm of the spread. `cut` is of the bound that is
   returned. */
static double tube(const Form *f, const double *centre, const double *half, double *cut, double *centre_value,
                   double *least, Workspace *work)
{
    Local *local = &work->local;
    Bases *b = &work->bases;
    Spread *s = &work->spread;
    const int n = f->rows, m = f->cols, last = n - 1;
    double best = INFINITY, moved = 0.0;
    form_local(f, centre, half, local);
    /* of the transpose: its left bases are those of the joints, completed beyond the rank of the first n - 1 rows */
    bases(local->value, m, n, 1, m, n - 1, b);
    for (int k = last; k < m; ++k)
        complete(b->left, k, k, m);
    spread(local, 1, m, b, m, n, s);
    seen_in(local->value, 1, m, b, m, n, 0, work->middle);
    *centre_value = b->sigma[last];
    for (int i = 0; i < m; ++i)
        for (int j = 0; j < n; ++j)
            moved += s->total[i][j] * s->total[i][j];
    *least = b->sigma[last] - sqrt(moved) * (1.0 + ROOM) - 1e-12 * b->sigma[0];
    for (int strong = last; strong >= 0; --strong) {
        double trial[MOST_JOINTS];
        const double bound = eliminated(strong, n, m, local, trial, work);
        if (bound < best) {
            best = bound;
            memcpy(cut, trial, sizeof trial);
        }
    }
    return best;
}

#endif
