/* Forward kinematics: every joint is a row of turns and shifts after its placement on the joint before. */
#ifndef WBC_STEPS_H
#define WBC_STEPS_H

#include "scene.h"

/* Numbers of a step: axis, scale, offset; of PLACE a pose. CIRCLE reads (cos, sin), FOLLOW the angle of such a
 * pair. wbc/symbolic/joint_steps.py has the same numbers */
enum { TURN, SHIFT, CIRCLE, FOLLOW, QUATERNION, PLACE };

static void quaternion(const double *q, double *R) {
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    R[0] = 1 - 2 * (y * y + z * z), R[1] = 2 * (x * y - w * z), R[2] = 2 * (x * z + w * y);
    R[3] = 2 * (x * y + w * z), R[4] = 1 - 2 * (x * x + z * z), R[5] = 2 * (y * z - w * x);
    R[6] = 2 * (x * z - w * y), R[7] = 2 * (y * z + w * x), R[8] = 1 - 2 * (x * x + y * y);
}

/* One step, in place */
static void take_step(int kind, const double *number, const double *q, double *pose) {
    double next[12], R[9], shift[3];
    if (kind == PLACE) {
        compose(pose, number, next);
        memcpy(pose, next, sizeof next);
        return;
    }
    const double by = number[3] * (kind == FOLLOW ? atan2(q[1], q[0]) : q[0]) + number[4];
    if (kind == SHIFT) {
        turn(pose, number, shift);
        along3(pose + 9, by, shift, pose + 9);
        return;
    }
    if (kind == QUATERNION) {
        quaternion(q, R);
    } else if (kind == CIRCLE) {
        axis_angle(number, q[0], q[1], R);
    } else {
        axis_angle(number, cos(by), sin(by), R);
    }
    turns(pose, R, next);
    memcpy(pose, next, sizeof R);
}

/* All joints and bodies at a configuration and the present pose */
static void place_bodies(scene_t *s, const double *q) {
    if (s->has_pose) {
        double *outside = s->joint_pose + 12 * s->joints;
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++) outside[3 * i + k] = s->pose[3 * k + i];
        copy3(s->pose + 9, outside + 9);
    }
    for (int j = 1; j < s->joints; j++) {
        if (s->joint_parent[j] < 0) continue; /* carries no body */
        double *pose = s->joint_pose + 12 * j;
        compose(s->joint_pose + 12 * s->joint_parent[j], s->joint_place + 12 * j, pose);
        for (int k = s->joint_steps[j]; k < s->joint_steps[j + 1]; k++)
            take_step(s->step_kind[k], s->step_number + 12 * k, q + s->step_q[k], pose);
    }
    for (int b = 0; b < s->bodies; b++)
        compose(s->joint_pose + 12 * s->body_joint[b], s->body_place + 12 * b, s->body_pose + 12 * b);
}

#endif
