/* Whether configurations and edges are free: bodies are proven clear between samples; rows at the ends and in the middle. */
#ifndef WBC_EDGES_H
#define WBC_EDGES_H

#include "proof.h"
#include "project.h"

static int within(const plan_t *p, const double *x) {
    for (int k = 0; k < p->n; k++)
        if (!(x[k] >= p->low[k] && x[k] <= p->high[k])) return 0;
    return 1;
}

static int is_free(plan_t *p, const double *x) { return within(p, x) && (!has_rows(p) || keeps(p, &p->path, x)) && is_clear(p, x); }

/* Rows between two configurations that keep them: in the middle equalities may drift, and what the margins bend by there they
 * may bend by anywhere */
static int rows_between(plan_t *p, const double *x, const double *y) {
    kept_rows_t *rows = &p->path;
    const int first = rows->equalities, all = first + rows->margins;
    double middle[p->n], ends[2 * rows->margins + 1];
    evaluate(p, rows, x, 0);
    memcpy(ends, rows->value + first, rows->margins * sizeof *ends);
    evaluate(p, rows, y, 0);
    memcpy(ends + rows->margins, rows->value + first, rows->margins * sizeof *ends);
    along_x(p, x, y, 0.5, middle);
    evaluate(p, rows, middle, 0);
    for (int k = 0; k < first; k++)
        if (!(fabs(rows->value[k]) <= p->drift)) return 0;
    for (int k = first; k < all; k++) {
        const double one = ends[k - first], other = ends[rows->margins + k - first], bend = fabs(rows->value[k] - 0.5 * (one + other));
        if (!(fmin(rows->value[k], fmin(one, other)) >= bend)) return 0;
    }
    return 1;
}

static int edge(plan_t *p, const double *x, const double *y) {
    return proven(p, x, y, 0) == 1.0 && (!has_rows(p) || rows_between(p, x, y));
}

/* From x towards a target, no farther than `range`: configurations behind x that are free with their edges, into `out`, at most
 * `most` of them; how many. The last one is the target where it is reached */
static int walk(plan_t *p, const double *x, const double *target, double range, double *out, int most, int *reached) {
    const double whole = metric(p, x, target);
    const int n = p->n, stepped = has_rows(p);
    const double stride = stepped ? fmin(p->step, range) : range;
    double left = whole, gone = 0.0;
    int count = 0;
    *reached = whole == 0.0;
    while (!*reached && count < most && gone < range) {
        const double *from = count ? out + (count - 1) * n : x;
        double *to = out + count * n;
        const int last = left <= stride;
        if (last) copy_x(p, target, to);
        else along_x(p, from, target, stride / left, to);
        if (stepped && !last && !project(p, &p->path, to)) break;
        const double now = last ? 0.0 : metric(p, to, target), moved = metric(p, from, to);
        /* A projection that leads back, or away, ends the walk */
        if (stepped && (now > left - 0.2 * stride * !last || moved > 2.0 * stride)) break;
        if (!within(p, to) || !edge(p, from, to)) break;
        count++, gone += moved, left = now, *reached = last;
    }
    return count;
}

#endif
