/* Two trees that grow towards each other (Kuffner and LaValle, RRT-Connect, 2000), from the start and from all goals. */
#ifndef WBC_TREES_H
#define WBC_TREES_H

#include "edges.h"

/* Steps of one edge with rows */
#define WALK 64
/* Edges that lead to samples are tried as long as their range, then shorter, to this share of it */
#define SHORTEST 0.05
/* while a tree has no more nodes than this */
#define FEW 20
/* Samples are drawn so often until one lies on no longer path */
#define INFORMED 20

static int add(plan_t *p, int tree, const double *x, int parent) {
    if (p->count[tree] == p->capacity) return -1;
    copy_x(p, x, p->node[tree] + p->n * p->count[tree]);
    p->parent[tree][p->count[tree]] = parent;
    return p->count[tree]++;
}

static int nearest_node(const plan_t *p, int tree, const double *x) {
    const double *y = p->node[tree];
    double least = INFINITY;
    int best = 0;
    for (int k = 0; k < p->count[tree]; k++, y += p->n) {
        double sum = 0.0;
        for (int i = 0; i < p->n && sum < least; i++) sum += p->weight[i] * (x[i] - y[i]) * (x[i] - y[i]);
        if (sum < least) least = sum, best = k;
    }
    return best;
}

/* From node `from` towards a target, no farther than `range`; the last node that was added, or -1 */
static int extend(plan_t *p, int tree, int from, const double *target, double range, int *reached) {
    double out[WALK * p->n];
    const int count = walk(p, p->node[tree] + p->n * from, target, range, out, has_rows(p) ? WALK : 1, reached);
    int last = -1;
    for (int k = 0; k < count; k++) {
        last = add(p, tree, out + k * p->n, last < 0 ? from : last);
        if (last < 0) *reached = 0;
    }
    return last < 0 && *reached ? from : last;
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

/* `samples` more, or until the trees meet: 1 */
static int grow(plan_t *p, int samples) {
    double x[p->n];
    for (int k = 0; k < samples; k++) {
        int reached;
        draw(p, x);
        const int tree = p->count[0] > p->count[1];
        const int from = nearest_node(p, tree, x);
        int node = extend(p, tree, from, x, p->range, &reached);
        /* Out of narrow places only short edges lead */
        for (double range = p->range; node < 0 && p->count[tree] < FEW && range > SHORTEST * p->range;)
            node = extend(p, tree, from, x, range *= 0.25, &reached);
        if (p->count[tree] == p->capacity) return -1;
        if (node < 0) continue;
        const double *target = p->node[tree] + p->n * node;
        int other = nearest_node(p, !tree, target);
        do {
            other = extend(p, !tree, other, target, p->range, &reached);
        } while (other >= 0 && !reached);
        if (!reached) continue;
        p->meet[tree] = node, p->meet[!tree] = other;
        return 1;
    }
    return 0;
}

#endif
