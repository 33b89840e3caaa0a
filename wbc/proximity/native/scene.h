/* What the sensor of the closest pairs works on: all arrays are Python's, which keeps them as long as this is used. */
#ifndef WBC_SCENE_H
#define WBC_SCENE_H

#include "measure.h"

/* See wbc/proximity/native.py, which fills it: the order of the fields is the same there */
typedef struct {
    int joints, steps, bodies, pairs, rows, corners, width, nv, has_pose, has_velocity;
    /* rows further than `far` are without a pair [m] */
    double far;
    tolerance_t how;
    double keep_share, keep_length, off, near;
    /* kinematics */
    const int *joint_parent, *joint_steps; /* steps of joint k: joint_steps[k] to joint_steps[k + 1] */
    const double *joint_place;             /* 12 each */
    const int *step_kind, *step_q;
    const double *step_number; /* 12 each */
    double *joint_pose;        /* 12 each; the last one is what moves from outside */
    /* bodies */
    const int *body_joint;
    const double *body_place; /* 12 each, on the joint */
    double *body_pose;        /* 12 each, in the world */
    const shape_t *shape;
    const double *corner;     /* width x 3 each */
    const int *corner_count;
    /* pairs */
    const int *first, *second;
    const double *outward; /* 1: only B moves from outside, -1: only A */
    const double *pair_side; /* nv each */
    const double *most;      /* of the margin that a pair keeps [m] */
    double *answer;          /* distance, normal, point: 7 each */
    signed char *doubtful, *has_row, *is_measured, *urgent;
    double *score, *least; /* a bound of the distance, of pairs without a row [m] */
    /* rows */
    int *row_pair, *heap;
    signed char *row_near, *row_fresh;
    double *distance, *drift, *line, *side;
    const double *pose, *velocity, *margin, *rate;
    /* a command, while it is looked at: screws 6 a velocity, v, what each brakes with */
    const double *screws, *v, *braking;
    /* velocities of a joint: the first, and how many */
    const int *joint_v;
    double *joint_twist; /* 6 each; 0 for what moves from outside */
    double *speed;       /* of the fastest point of a body, at most */
    int measured;        /* how many pairs the last call measured */
} scene_t;

#endif
