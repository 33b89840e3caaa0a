/* A matrix of trigonometric polynomials, its first derivatives at the centre of a box and what they leave out there.

   Every entry is a sum of terms a cos(w.q) + b sin(w.q). With v = a cos + b sin and s its slope at the centre, and
   x = sum_i |w_i| h_i, a term differs on the box by at most |v| x^2 / 2 + |s| x^3 / 6 from v + s w.(q - centre). */
#ifndef FORM_H
#define FORM_H

#include <math.h>
#include <string.h>

/* wbc.analysis.search refuses what is larger */
enum { MOST_ROWS = 24, MOST_COLS = 16, MOST_JOINTS = 16, MOST_FREQS = 1024 };

/* Rounding of one evaluated term relative to its size: phase, sine and two products, with a margin */
static const double ROUNDING = 1e-14;

typedef struct {
    int rows, cols, joints, freqs, terms;
    const double *w;        /* [freqs][joints], whole numbers */
    const int *start;       /* [rows * cols + 1]: terms of an entry */
    const int *freq;        /* [terms] */
    const double *a, *b;    /* [terms] */
} Form;

typedef struct {
    double value[MOST_ROWS * MOST_COLS];
    double slope[MOST_JOINTS][MOST_ROWS * MOST_COLS];   /* times the half width of the joint */
    double rest[MOST_ROWS * MOST_COLS];                 /* bound of all else, rounding included */
    double weight[MOST_JOINTS];                         /* of the rest by joints, for the choice of a cut */
    int used[MOST_JOINTS], count;                       /* joints that appear at all */
    double cosine[MOST_FREQS], sine[MOST_FREQS], reach[MOST_FREQS];
} Local;

static void form_local(const Form *f, const double *centre, const double *half, Local *out)
{
    const int n = f->joints, entries = f->rows * f->cols;
    int seen[MOST_JOINTS] = { 0 };
    memset(out->weight, 0, sizeof out->weight);
    for (int k = 0; k < f->freqs; ++k) {
        double phase = 0.0, x = 0.0;
        for (int i = 0; i < n; ++i) {
            const double w = f->w[k * n + i];
            if (w != 0.0) {
                phase += w * centre[i];
                x += fabs(w) * half[i];
                seen[i] = 1;
            }
        }
        out->cosine[k] = cos(phase);
        out->sine[k] = sin(phase);
        out->reach[k] = x;
    }
    out->count = 0;
    for (int i = 0; i < n; ++i)
        if (seen[i])
            out->used[out->count++] = i;
    for (int i = 0; i < out->count; ++i)
        memset(out->slope[out->used[i]], 0, sizeof(double) * (size_t)entries);
    for (int e = 0; e < entries; ++e) {
        double value = 0.0, rest = 0.0;
        for (int t = f->start[e]; t < f->start[e + 1]; ++t) {
            const int k = f->freq[t];
            const double *w = f->w + k * n, x = out->reach[k];
            const double v = f->a[t] * out->cosine[k] + f->b[t] * out->sine[k];
            const double s = f->b[t] * out->cosine[k] - f->a[t] * out->sine[k];
            const double left = fabs(v) * x * x / 2.0 + fabs(s) * x * x * x / 6.0;
            value += v;
            rest += left + ROUNDING * (fabs(f->a[t]) + fabs(f->b[t])) * (1.0 + x);
            for (int i = 0; i < n; ++i)
                if (w[i] != 0.0) {
                    out->slope[i][e] += s * w[i] * half[i];
                    out->weight[i] += fabs(w[i]) * half[i] * left;
                }
        }
        out->value[e] = value;
        out->rest[e] = rest;
    }
}

#endif
