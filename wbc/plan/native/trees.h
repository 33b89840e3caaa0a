/* Two trees that grow towards each other (Kuffner and LaValle, RRT-Connect, 2000), from the start and from all goals. */
#ifndef WBC_TREES_H
#define WBC_TREES_H

#include "edges.h"

/* Steps of one edge with rows */
#define WALK 64
/* Edges of which less than this share is free are none */
#define SLIGHT 0.1
/* Samples are drawn so often until one lies on no longer path */
#define INFORMED 20
/* and these so often until one is near enough to a node */
#define DRAWN 10

/* A node; beside its row in `node` it stands in `lanes`, where coordinates of LANES nodes are together, weighted */
static int add(plan_t *p, int tree, const double *x, int parent) {
    const int at = p->count[tree], n = p->n;
    if (at == p->capacity) return -1;
    copy_x(p, x, p->node[tree] + n * at);
    double *lane = p->lanes[tree] + (long)LANES * n * (at / LANES) + at % LANES;
    for (int m = 0; at % LANES == 0 && m < LANES * n; m++) lane[m] = INFINITY;
    for (int k = 0; k < n; k++) lane[LANES * k] = p->scale[k] * x[k];
    p->parent[tree][at] = parent;
    p->domain[tree][at] = INFINITY;
    return p->count[tree]++;
}

static int nearest_node(const plan_t *p, int tree, const double *x) {
    const int n = p->n, blocks = (p->count[tree] + LANES - 1) / LANES;
    const lanes_t *y = (const lanes_t *)p->lanes[tree];
    lanes_t nearest = {0}, at = {0}, z[n];
    nearest += INFINITY;
    for (int k = 0; k < n; k++) z[k] = (lanes_t){0} + p->scale[k] * x[k];
    for (int b = 0; b < blocks; b++) {
        lanes_t sum = {0};
        for (int k = 0; k < n; k++, y++) sum += (*y - z[k]) * (*y - z[k]);
        const mask_t nearer = sum < nearest;
        nearest = chosen(nearer, sum, nearest), at = chosen(nearer, (lanes_t){0} + b, at);
    }
    int best = 0;
    for (int l = 1; l < LANES; l++)
        if (nearest[l] < nearest[best]) best = l;
    return LANES * (int)at[best] + best;
}

/* From node `from` towards a target, no farther than `range`; the last node that was added, or -1. `reached`: the target, 1; not yet,
 * 0; it is not to be reached so, -1 */
static int extend(plan_t *p, int tree, int from, const double *target, double range, int *reached) {
    double out[WALK * p->n];
    const double *x = p->node[tree] + p->n * from;
    int count, last = -1;
    if (has_rows(p)) {
        count = walk(p, x, target, range, out, WALK, reached);
        if (!count && *reached) return from;
    } else {
        const double whole = metric(p, x, target), share = fmin(1.0, range / whole);
        if (whole == 0.0) return *reached = 1, from;
        along_x(p, x, target, share, out);
        const double part = proven(p, x, out, 1);
        *reached = part < 1.0 ? -1 : share == 1.0;
        if (part < SLIGHT) return -1;
        if (part < 1.0) along_x(p, x, target, part * share, out);
        else if (*reached) copy_x(p, target, out);
        count = 1;
    }
    for (int k = 0; k < count; k++) {
        last = add(p, tree, out + k * p->n, last < 0 ? from : last);
        if (last < 0) *reached = 0;
    }
    return last;
}

/* A sample within limits that lies on a path no longer than the best one, as far as that can be told */
static void draw(plan_t *p, double *x) {
    for (int again = 0; again < INFORMED; again++) {
        for (int k = 0; k < p->n; k++) x[k] = p->sample_low[k] + uniform(p) * (p->sample_high[k] - p->sample_low[k]);
        if (p->longest == INFINITY) return;
        double goal = INFINITY;
        for (int k = 0; k < p->seeds; k++) goal = fmin(goal, metric(p, x, p->node[1] + k * p->n));
        if (metric(p, x, p->node[0]) + goal < p->longest) return;
    }
}

/* `samples` more, or until the trees meet: 1. A node from which an edge was not free is drawn by near samples only (Yershova, Jaillet,
 * Simeon and LaValle, Dynamic-domain RRTs, 2005) */
static int grow(plan_t *p, int samples) {
    double x[p->n];
    for (int k = 0; k < samples; k++) {
        const int tree = p->count[0] > p->count[1];
        int reached, from = 0, again = 0;
        do {
            draw(p, x);
            from = nearest_node(p, tree, x);
        } while (metric(p, p->node[tree] + p->n * from, x) > p->domain[tree][from] && ++again < DRAWN);
        if (again == DRAWN) continue;
        const int node = extend(p, tree, from, x, p->range, &reached);
        if (p->count[tree] == p->capacity) return -1;
        if (reached != 1 && (node < 0 || reached < 0)) p->domain[tree][from] = p->near_enough;
        if (node < 0) continue;
        const double *target = p->node[tree] + p->n * node;
        int other = nearest_node(p, !tree, target);
        do {
            other = extend(p, !tree, other, target, p->range, &reached);
        } while (other >= 0 && !reached);
        if (reached != 1) continue;
        p->meet[tree] = node, p->meet[!tree] = other;
        return 1;
    }
    return 0;
}

#endif
