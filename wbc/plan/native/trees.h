/* Two trees that grow towards each other (Kuffner and LaValle, RRT-Connect, 2000), from the start and from all goals. */
#pragma once

#include "edges.h"

/* Steps of one edge with rows */
#define WALK 64
/* Edges of which less than this share is free are none */
#define SLIGHT 0.2
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

/* The nearest node to x, which becomes the one nearest to that node of those that are the same configuration */
static int nearest_node(const plan_t *p, int tree, double *x) {
    const int n = p->n, blocks = (p->count[tree] + LANES - 1) / LANES;
    const lanes_t *y = (const lanes_t *)p->lanes[tree];
    lanes_t nearest = {0}, at = {0}, z[n];
    nearest += INFINITY;
    for (int k = 0; k < n; k++) z[k] = (lanes_t){0} + p->scale[k] * x[k];
    for (int b = 0; b < blocks; b++) {
        lanes_t sum = {0};
        for (int k = 0; k < n; k++, y++) {
            const double period = p->scale[k] * p->period[k];
            lanes_t off = *y - z[k];
            for (int l = 0; period > 0.0 && l < LANES; l++) off[l] -= period * rint(off[l] / period);
            sum += off * off;
        }
        const mask_t nearer = sum < nearest;
        nearest = chosen(nearer, sum, nearest), at = chosen(nearer, (lanes_t){0} + b, at);
    }
    int best = 0;
    for (int l = 1; l < LANES; l++)
        if (nearest[l] < nearest[best]) best = l;
    best += LANES * (int)at[best];
    bring(p, p->node[tree] + n * best, x);
    return best;
}

/* From node `from` towards a target, by the pieces of the way of a base that rolls, and no farther than `range` along each; the last node
 * that was added, or -1. `reached`: the target, 1; not yet, 0; it is not to be reached so, -1 */
static int extend(plan_t *p, int tree, int from, const double *target, double range, int *reached) {
    const int n = p->n;
    double out[WALK * n], ends[WAY * n];
    const double *x = p->node[tree] + n * from;
    int count = 0;
    if (has_rows(p)) {
        count = walk(p, x, target, range, out, WALK, reached);
    } else {
        const int pieces = steer(p, x, target, ends);
        *reached = 1;
        for (int k = 0; k < pieces && *reached == 1; k++) {
            const double *end = ends + k * n, whole = metric(p, x, end), share = fmin(1.0, range / whole);
            double *to = out + count * n;
            if (whole == 0.0) continue;
            along_x(p, x, end, share, to);
            const double part = proven(p, (const double *[]){x, to}, 2, FIRST);
            *reached = part < 1.0 ? -1 : share == 1.0;
            if (part < SLIGHT) break;
            if (part < 1.0) along_x(p, x, end, part * share, to);
            else if (*reached) copy_x(p, end, to);
            count++, x = to;
        }
    }
    if (!count && *reached != 1) return -1;
    for (int k = 0; k < count && from >= 0; k++) from = add(p, tree, out + k * n, from);
    if (from < 0) *reached = 0;
    return from;
}

/* The box about the places on paths no longer than the best one, within limits */
static void box_of_samples(const plan_t *p, double *low, double *high) {
    const int n = p->n;
    const double *start = p->node[0];
    copy_x(p, p->sample_low, low);
    copy_x(p, p->sample_high, high);
    for (int k = 0; k < n && p->longest < INFINITY; k++) {
        if (p->weight[k] <= 0.0 || p->period[k] > 0.0) continue;
        double least = INFINITY, most = -INFINITY;
        for (const double *goal = p->node[1]; goal < p->node[1] + p->seeds * n; goal += n) {
            const double way = metric_round(p, start, goal), middle = 0.5 * (start[k] + goal[k]), off = middle - start[k];
            const double half = sqrt(0.25 * fmax(p->longest * p->longest - way * way, 0.0) / p->weight[k] + off * off);
            least = fmin(least, middle - half), most = fmax(most, middle + half);
        }
        low[k] = fmax(low[k], least), high[k] = fmin(high[k], most);
    }
}

/* A sample of that box, where there is one on no longer path such (Gammell et al., Informed RRT*, 2014) */
static void draw_of(plan_t *p, const double *low, const double *high, double *x) {
    const int n = p->n;
    for (int again = 0; again < INFORMED; again++) {
        for (int k = 0; k < n; k++) x[k] = low[k] + uniform(p) * (high[k] - low[k]);
        if (p->longest == INFINITY) return;
        const double gone = metric_round(p, x, p->node[0]);
        for (int g = 0; g < p->seeds && gone < p->longest; g++)
            if (gone + metric_round(p, x, p->node[1] + g * n) < p->longest) return;
    }
}

void wbc_plan_draw(plan_t *p, double *x) { draw_of(p, p->sample_low, p->sample_high, x); }

/* `samples` more, or until the trees meet: 1. The first pieces of edges to some of them are looked at together. A node from which an edge was
 * not free is drawn by near samples only (Yershova, Jaillet, Simeon and LaValle, Dynamic-domain RRTs, 2005). -1: a tree is full */
int wbc_plan_grow(plan_t *p, int samples) {
    const int n = p->n, single = has_rows(p) || p->rolls || !p->pairs;
    double x[LANES * n], ends[LANES * n], low[n], high[n], target[n];
    stretch_t parts[LANES];
    box_of_samples(p, low, high);
    for (int k = 0; k < samples;) {
        const int tree = p->count[0] > p->count[1];
        int reached, from[LANES], count = 0;
        for (int again = 0; count < (single ? 1 : LANES) && k < samples; again = 0, k++) {
            double *to = x + count * n, off;
            do {
                draw_of(p, low, high, to);
                from[count] = nearest_node(p, tree, to);
                off = metric(p, p->node[tree] + n * from[count], to);
            } while (off > p->domain[tree][from[count]] && ++again < DRAWN);
            if (again == DRAWN || off == 0.0) continue;
            const double *node = p->node[tree] + n * from[count];
            along_x(p, node, to, fmin(1.0, p->range / off), ends + count * n);
            parts[count] = (stretch_t){node, ends + count * n, 0.0, fmax(SLIGHT, 1.0 / pieces_of(fmin(p->range, off)))};
            count++;
        }
        p->counts = EACH, p->sweep->stopped = -1;
        const unsigned first = single ? ~0u : count ? look_along(p, parts, count, 0, p->pairs, 0, p->sweep->list) : 0;
        for (int m = 0; m < count; m++) {
            const int node = first >> m & 1 ? extend(p, tree, from[m], x + m * n, p->range, &reached) : -1;
            if (p->count[tree] == p->capacity) return -1;
            if (node < 0 || reached < 0) p->domain[tree][from[m]] = p->near_enough;
            if (node < 0) continue;
            copy_x(p, p->node[tree] + n * node, target);
            int other = nearest_node(p, !tree, target);
            do {
                other = extend(p, !tree, other, target, p->range, &reached);
            } while (other >= 0 && !reached);
            if (reached != 1) continue;
            p->meet[tree] = node, p->meet[!tree] = other;
            return 1;
        }
    }
    return 0;
}
