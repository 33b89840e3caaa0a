/* What a planner works on: all arrays are Python's, which keeps them as long as this is used; wbc/plan/native.py fills it,
 * and reads its structures here. Configurations are n coordinates x; distances |x - y| are weighted. */
#pragma once

#include "sweep.c"
#include "vector_lanes.h"

/* So many pairs that were too near last are looked at first */
#define RECENT 3

/* Straight-line code of rows, as CasADi writes it: (x, p) -> (values, their derivatives by x, column by column) */
typedef int (*rows_function)(const double **in, double **out, long long *iw, double *w, int memory);

/* Rows that a path keeps: equalities, which come first, at 0, and margins at 0 or above */
typedef struct {
    rows_function function;
    int equalities, margins;
    const double *p;
    double *value, *slope, *w;
    long long *iw;
} kept_rows_t;

/* Numbers of the motion of a core: of both ends as far as it is linear, the rest of the bound, how far points go at most, the turn */
#define WAYS 11
/* Beyond so large a turn the linear part says nothing [rad] */
#define TURNED 1.5

/* A piece of what is straight from x to y, from one share of it to another */
typedef struct {
    const double *x, *y;
    double low, high;
} stretch_t;

/* What counts where not all is free: nothing; what is before it; every lane for itself */
enum { WHOLE, FIRST, EACH };

/* How a pair is seen to be far apart: by the balls about both, by a ball and a box in the world, or not so */
enum { BALLS, BALL_BOX, UNSEEN };

/* `ball` moves; `radii`: of the balls about both; `core`: of both about their cores; where in `offs` it stands how far
 * both may be off; `round`: places are looked at together; `exact`: what stands is no less than the box about it */
typedef struct {
    double radii, core;
    int form, ball, other, ball_off, other_off, round, exact;
} outline_t;

typedef struct {
    sweep_t *sweep;
    double *gone;     /* frames x LANES: how far joints go within half a piece */
    double *normals;  /* pairs x 3: the directions that parted them last, or 0 */
    double open;      /* what a proof may leave open of what is required [m] */
    double *boxes;       /* bodies x 15: pose and half sides of the box about what stands in the world */
    double *reaches;     /* bodies x depth: how far points can be from the joints of a chain */
    double *offs;        /* bodies x (depth + 1) x LANES: how far the first joints of it may take them within half a piece */
    double *lane_pose;   /* frames x 12 x LANES: places that are looked at at once */
    double *lane_centre; /* bodies x 3 x LANES: of the balls there */
    double *lane_ends;   /* bodies x 6 x LANES: of the cores of bodies there */
    double *lane_ways;   /* bodies x (depth + 1) x WAYS x LANES: what joints do to these within half a piece: see lanes.h */
    int *lane_stamp;     /* bodies: whether both are of the places at hand */
    int *ball_stamp;     /* bodies: whether centre and offs are */
    outline_t *outlines; /* pairs, then the blocks that they are in */
    int *block_end;      /* blocks: the pair behind the last one of each */
    int recent[RECENT];
    const double *low, *high;               /* n: limits */
    const double *sample_low, *sample_high; /* n: where samples are drawn */
    const double *weight, *scale;           /* n: what a coordinate counts, its square and itself */
    const double *period;                   /* n: x and x + period are one configuration; 0: no others are */
    int n, pairs, blocks, capacity, seeds, count[2];
    double range;     /* an edge is no longer */
    double step;      /* of edges with rows: between two projections */
    double tolerance; /* of equalities at a configuration */
    double drift;     /* of equalities between two of them */
    double near_enough; /* samples draw a node from which an edge was not free no farther */
    double longest;   /* paths through samples are shorter */
    unsigned long long random;
    kept_rows_t path, goal; /* rows of all configurations; with those of the goal's tasks */
    double *node[2];        /* capacity x n: trees from the start and from the goals */
    double *lanes[2];       /* of these, blocks of n x LANES, times `scale`; infinite behind the last */
    double *domain[2];      /* samples farther from a node do not draw it */
    int *parent[2];         /* -1: a root */
    double *work;           /* for one projection: see project.h */
    int meet[2];            /* nodes at which the trees met */
    double heading;   /* of a base that rolls: the angle in it along which it drives */
    int rolls;        /* the first coordinates are x, y and angle of a base that does not slip: 1; that drives along any direction, 2 */
    int struck;       /* the pair that was too near last */
    int counts;       /* of what is not free: WHOLE, FIRST, EACH */
    unsigned alive;   /* places that are looked at together and still count */
    int lane_node; /* counts the places that were looked at together */
    int lane;      /* the one at hand */
} plan_t;

static double metric(const plan_t *p, const double *x, const double *y) {
    double sum = 0.0;
    for (int k = 0; k < p->n; k++) sum += p->weight[k] * (x[k] - y[k]) * (x[k] - y[k]);
    return sqrt(sum);
}

/* y becomes the one nearest to x of those that are the same configuration */
static void bring(const plan_t *p, const double *x, double *y) {
    for (int k = 0; k < p->n; k++)
        if (p->period[k] > 0.0) y[k] -= p->period[k] * rint((y[k] - x[k]) / p->period[k]);
}

static void copy_x(const plan_t *p, const double *from, double *to) { memcpy(to, from, p->n * sizeof *to); }

/* The distance of x from the nearest of those that are the configuration y */
static double metric_round(const plan_t *p, const double *x, const double *y) {
    double near[p->n];
    copy_x(p, y, near);
    bring(p, x, near);
    return metric(p, x, near);
}

/* z = x + t (y - x) */
static void along_x(const plan_t *p, const double *x, const double *y, double t, double *z) {
    for (int k = 0; k < p->n; k++) z[k] = x[k] + t * (y[k] - x[k]);
}

/* Uniform in [0, 1): xorshift64* (Vigna, An experimental exploration of Marsaglia's xorshift generators, 2016) */
static double uniform(plan_t *p) {
    p->random ^= p->random >> 12;
    p->random ^= p->random << 25;
    p->random ^= p->random >> 27;
    return (double)((p->random * 2685821657736338717ULL) >> 11) * 0x1.0p-53;
}

static int has_rows(const plan_t *p) { return p->path.equalities + p->path.margins > 0; }
