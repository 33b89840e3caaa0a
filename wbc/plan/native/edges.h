/* Whether configurations and edges are free: bodies are proven clear between samples; rows at the ends and in the middle. */
#pragma once

#include "proof.h"
#include "project.h"
#include "rolling.h"

static int within(const plan_t *p, const double *x) {
    for (int k = 0; k < p->n; k++)
        if (!(x[k] >= p->low[k] && x[k] <= p->high[k])) return 0;
    return 1;
}

int wbc_plan_free(plan_t *p, const double *x) { return within(p, x) && (!has_rows(p) || keeps(p, &p->path, x)) && is_clear(p, x); }

/* Rows between two configurations that keep them: in the middle equalities may drift, and what the margins bend by there they
 * may bend by anywhere */
static int rows_between(plan_t *p, const double *x, const double *y) {
    kept_rows_t *rows = &p->path;
    const int all = rows->equalities + rows->margins;
    double middle[p->n], at_x[all + 1], at_y[all + 1];
    evaluate(p, rows, x, 0);
    memcpy(at_x, rows->value, all * sizeof *at_x);
    evaluate(p, rows, y, 0);
    memcpy(at_y, rows->value, all * sizeof *at_y);
    along_x(p, x, y, 0.5, middle);
    evaluate(p, rows, middle, 0);
    for (int k = 0; k < all; k++) {
        const double here = rows->value[k], bend = fabs(here - 0.5 * (at_x[k] + at_y[k]));
        if (!(k < rows->equalities ? fabs(here) <= p->drift : fmin(here, fmin(at_x[k], at_y[k])) >= bend)) return 0;
    }
    return 1;
}

/* The way straight through some points */
static int way(plan_t *p, const double *const *point, int count) {
    for (int k = 0; k < count - 1; k++)
        if (!rolls(p, point[k], point[k + 1])) return 0;
    if (proven(p, point, count, 0) < 1.0) return 0;
    for (int k = 0; has_rows(p) && k < count - 1; k++)
        if (!rows_between(p, point[k], point[k + 1])) return 0;
    return 1;
}

int wbc_plan_edge(plan_t *p, const double *x, const double *y) { return way(p, (const double *[]){x, y}, 2); }

/* From x towards a target, by the pieces of the way of a base that rolls, and no farther than `range` along each: configurations behind x
 * that are free with their edges, into `out`, at most `most` of them; how many. The last one is the target where it is reached */
static int walk(plan_t *p, const double *x, const double *target, double range, double *out, int most, int *reached) {
    const int n = p->n, stepped = has_rows(p);
    const double stride = stepped ? fmin(p->step, range) : range, *from = x;
    double ends[WAY * n];
    const int pieces = steer(p, x, target, ends);
    int count = 0;
    *reached = 1;
    for (int k = 0; k < pieces && *reached; k++) {
        double *end = ends + k * n, gone = 0.0;
        if (k < pieces - 1 && stepped && !project(p, &p->path, end)) return *reached = 0, count;
        double left = metric(p, from, end);
        *reached = left == 0.0;
        while (!*reached && count < most && gone < range) {
            double *to = out + count * n;
            const int last = left <= stride;
            if (last) copy_x(p, end, to);
            else along_x(p, from, end, stride / left, to);
            if (stepped && !last && !project(p, &p->path, to)) break;
            const double now = last ? 0.0 : metric(p, to, end), moved = metric(p, from, to);
            /* A projection that leads back, or away, ends the walk */
            if (stepped && (now > left - 0.2 * stride * !last || moved > 2.0 * stride)) break;
            if (!within(p, to) || !wbc_plan_edge(p, from, to)) break;
            count++, from = to, gone += moved, left = now, *reached = last;
        }
    }
    return count;
}
