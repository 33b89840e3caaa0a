/* What a sweep works on: all arrays are Python's, which keeps them as long as this is used; wbc/clearance/native.py fills it,
 * and reads its structure here. */
#ifndef WBC_SWEEP_H
#define WBC_SWEEP_H

#include "measure.h"

/* What is looked for: the least of every pair, of all pairs, or any that is below what is required */
enum { EVERY, LEAST, ANY };
/* Joints of frames */
enum { FIXED, TURNING, SHIFTING, FREE };

typedef struct {
    int knots, degree, scalars, frees, frames, bodies, pairs, depth, aim;
    double tolerance, far, least;
    /* motion between the knots k and k + 1: s from 0 to 1 */
    const double *control;        /* knots - 1 x scalars x (degree + 1): Bernstein coefficients */
    const double *variation;      /* knots x scalars: no less than the way from the first knot on */
    const double *rate;           /* knots - 1 x scalars: no less than any |dq/ds| */
    const double *slack;          /* scalars: how far the truth may be off the coefficients */
    const double *free_pose;      /* frees x knots x 12 */
    const double *free_turn;      /* frees x (knots - 1) x 3: the turn to the next knot, in the frame's axes */
    const double *free_variation; /* frees x knots x 2: way and angle from the first knot on */
    const double *free_slack;     /* frees x 2 */
    /* frames, parents before children */
    const int *parent, *kind, *coordinate;
    const double *place; /* 12 each, on the parent */
    const double *axis;  /* axis, scale, offset: 5 each */
    double *pose;        /* 12 each, in the world */
    double *deviation;   /* 4 each: shift and turn by which a frame may deviate, and the slack in them */
    double *drift;       /* 7 each, within half a piece between two knots: shift and turn of a frame along the world's axes as far as
                            they are even, and by how much its scalar may stray from that */
    /* bodies */
    const int *body_frame; /* -1: the world */
    const double *body_place;
    double *body_pose;
    const double *line; /* 8 each: ends of a capsule about the body in its frame, its radius, and that of what turns beside its core */
    double *world_line; /* 6 each */
    const shape_t *shape;
    const int *chain, *chain_length; /* depth each: frames with joints, from the body's on */
    double *moved;                   /* 2 (depth + 1) each: how far points may be off the middle, and the slack in it */
    int *stamp;
    /* pairs */
    const int *first, *second;
    const int *stop_first, *stop_second; /* how far up the chains the two move apart */
    const double *required;
    /* where less is allowed: from exempt_start[k] to exempt_start[k + 1] of pair k */
    const int *exempt_start, *exempt_from, *exempt_to, *exempt_side;
    const double *exempt_point; /* point on the one, point on the other, slope, depth: 8 each */
    double *low, *high, *when;
    int *chosen, *list;
    /* the node at hand; `even`: whether `drift` says something */
    int node, stopped, measured, nodes, even;
} sweep_t;

#endif
