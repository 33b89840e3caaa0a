/* Plans between configurations: what Python calls. No memory is allocated. */
#include "shorten.h"

long long wbc_plan_size(void) { return (long long)sizeof(plan_t); }

/* After bodies or limits have changed */
void wbc_plan_prepare(plan_t *p) { prepare(p); }

/* 1: free; 0: not */
int wbc_plan_free(plan_t *p, const double *x) { return is_free(p, x); }

/* The least distance of a pair at x less what it keeps, pads counted; infinite where there is none */
double wbc_plan_margin(plan_t *p, const double *x) { return least_margin(p, x, -INFINITY); }

int wbc_plan_edge(plan_t *p, const double *x, const double *y) { return edge(p, x, y); }

int wbc_plan_project(plan_t *p, double *x) { return project(p, &p->path, x); }

/* Rows of the path at x, into path.value; how far they are broken */
double wbc_plan_broken(plan_t *p, const double *x) {
    evaluate(p, &p->path, x, 0);
    return broken(&p->path);
}

/* From x to a configuration that meets the goal's rows: 0: none; 1: it is not free; 2: it is, and x is it */
int wbc_plan_reach(plan_t *p, double *x) {
    if (!project(p, &p->goal, x)) return 0;
    return is_free(p, x) ? 2 : 1;
}

void wbc_plan_draw(plan_t *p, double *x) { draw(p, x); }

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
        for (int again = 0; again < 20; again++) {
            for (int k = 0; k < n; k++) {
                const double off = radius * (2.0 * uniform(p) - 1.0) / sqrt(p->weight[k]);
                y[k] = fmin(fmax(x[k] + off, p->low[k]), p->high[k]);
            }
            if (has_rows(p) && !project(p, &p->path, y)) continue;
            const double margin = least_margin(p, y, most);
            if (margin > most && is_free(p, y) && edge(p, x, y)) copy_x(p, y, best), most = margin;
        }
    copy_x(p, best, x);
    return most;
}

int wbc_plan_grow(plan_t *p, int samples) { return grow(p, samples); }

/* The path through where the trees met; the number of points, or -1 where there is no room */
int wbc_plan_path(const plan_t *p, double *x, int room) {
    int count = 0;
    for (int k = p->meet[0]; k >= 0; k = p->parent[0][k]) count++;
    const int behind = count;
    for (int k = p->parent[1][p->meet[1]]; k >= 0; k = p->parent[1][k]) count++;
    if (count > room) return -1;
    int at = behind;
    for (int k = p->meet[0]; k >= 0; k = p->parent[0][k]) copy_x(p, p->node[0] + k * p->n, x + --at * p->n);
    at = behind;
    for (int k = p->parent[1][p->meet[1]]; k >= 0; k = p->parent[1][k]) copy_x(p, p->node[1] + k * p->n, x + at++ * p->n);
    return count;
}

int wbc_plan_shorten(plan_t *p, double *x, int points, int room, int cuts, int rounds, double *others, int most) {
    return shorten(p, x, points, room, cuts, rounds, others, most);
}

double wbc_plan_length(const plan_t *p, const double *x, int points) { return length_of(p, x, points); }
