/* Plans between configurations: Python calls what is named wbc_plan. No memory is allocated. */
#include "shorten.h"

long long wbc_plan_size(void) { return (long long)sizeof(plan_t); }

/* The least distance of a pair at x less what it keeps, pads counted; infinite where there is none */
double wbc_plan_margin(plan_t *p, const double *x) { return least_margin(p, x, -INFINITY); }

/* The way from x to y: ends of its pieces, into `out` with room for `most`; how many, or 0 where it is not free */
int wbc_plan_walk(plan_t *p, const double *x, const double *y, double *out, int most) {
    int reached;
    const int count = walk(p, x, y, INFINITY, out, most, &reached);
    return reached ? count : 0;
}

int wbc_plan_project(plan_t *p, double *x) { return project(p, &p->path, x); }

/* From x to a configuration that meets the goal's rows: 0: none; 1: it is not free; 2: it is, and x is it */
int wbc_plan_reach(plan_t *p, double *x) {
    return project(p, &p->goal, x) ? 1 + wbc_plan_free(p, x) : 0;
}

/* A root of a tree; its number, or -1 */
int wbc_plan_root(plan_t *p, int tree, const double *x) {
    if (tree) p->seeds++;
    return add(p, tree, x, -1);
}

/* From x to a configuration near it with `room` on all sides, which is reached from it straight: how far it may be [rad, m], and
 * how often it is tried; x, of which `most` is the margin, where it has that room, or where there is none. Its margin */
double wbc_plan_away(plan_t *p, double *x, double room, double most) {
    const int n = p->n;
    double best[n], y[n];
    copy_x(p, x, best);
    for (double radius = 0.02; radius < 0.5 && most < room; radius *= 2.0)
        for (int again = 0; again < 20 && most < room; again++) {
            for (int k = 0; k < n; k++) {
                const double off = p->weight[k] > 0.0 ? radius * (2.0 * uniform(p) - 1.0) / sqrt(p->weight[k]) : 0.0;
                y[k] = fmin(fmax(x[k] + off, p->low[k]), p->high[k]);
            }
            roll_near(p, x, y, again % 2);
            if (has_rows(p) && !project(p, &p->path, y)) continue;
            const double margin = least_margin(p, y, most);
            if (margin > most && wbc_plan_free(p, y) && wbc_plan_edge(p, x, y)) copy_x(p, y, best), most = margin;
        }
    copy_x(p, best, x);
    return most;
}

/* The path through where the trees met, to a goal or the same configuration; the number of points, or -1 where there is no room */
int wbc_plan_path(const plan_t *p, double *x, int room) {
    const double *one = p->node[0] + p->meet[0] * p->n, *other = p->node[1] + p->meet[1] * p->n;
    int count = 0;
    for (int k = p->meet[0]; k >= 0; k = p->parent[0][k]) count++;
    if (count > room) return -1;
    for (int k = p->meet[0], at = count; k >= 0; k = p->parent[0][k]) copy_x(p, p->node[0] + k * p->n, x + --at * p->n);
    for (int k = p->parent[1][p->meet[1]]; k >= 0; k = p->parent[1][k]) {
        if (count == room) return -1;
        double *to = x + count++ * p->n;
        copy_x(p, p->node[1] + k * p->n, to);
        for (int m = 0; m < p->n; m++)
            if (p->period[m] > 0.0) to[m] += p->period[m] * rint((one[m] - other[m]) / p->period[m]);
    }
    return count;
}
