/* Where frames and bodies are in the middle of a piece of the motion, and how far they may be off it. */
#ifndef WBC_MOTION_H
#define WBC_MOTION_H

#include "sweep.h"

/* From knot i to knot j, or a part of what is between knot i and i + 1 */
typedef struct {
    int i, j;
    double low, high;
} piece_t;

static int whole(const piece_t *p) { return p->j - p->i > 1; }

/* De Casteljau's value */
static double bernstein(const double *c, int degree, double s) {
    double b[8];
    for (int k = 0; k <= degree; k++) b[k] = c[k];
    for (int d = degree; d > 0; d--)
        for (int k = 0; k < d; k++) b[k] += s * (b[k + 1] - b[k]);
    return b[0];
}

/* Change within half a piece at the rate of its middle, and by how much a scalar may stray from that: h^2 |q''| / 2 */
static double even_part(const sweep_t *s, const piece_t *p, int c, double *stray) {
    const double *b = s->control + (p->i * s->scalars + c) * (s->degree + 1), half = 0.5 * (p->high - p->low);
    double rates[8], bend = 0.0;
    for (int k = 0; k < s->degree; k++) rates[k] = s->degree * (b[k + 1] - b[k]);
    for (int k = 0; k + 1 < s->degree; k++) bend = fmax(bend, fabs(rates[k + 1] - rates[k]));
    *stray = 0.5 * half * half * (s->degree - 1) * bend;
    return half * bernstein(rates, s->degree - 1, 0.5 * (p->low + p->high));
}

/* Value in the middle, and by how much it may deviate */
static double scalar_at(const sweep_t *s, const piece_t *p, int c, double *off) {
    const int m = s->scalars, middle = (p->i + p->j) / 2;
    if (whole(p)) {
        const double here = s->variation[middle * m + c];
        *off = fmax(here - s->variation[p->i * m + c], s->variation[p->j * m + c] - here);
        return bernstein(s->control + (middle * m + c) * (s->degree + 1), s->degree, 0.0);
    }
    *off = s->rate[p->i * m + c] * 0.5 * (p->high - p->low);
    return bernstein(s->control + (p->i * m + c) * (s->degree + 1), s->degree, 0.5 * (p->low + p->high));
}

/* Pose of a free frame in the middle; shift and angle by which it may deviate; its even shift and turn within half a piece */
static void free_at(const sweep_t *s, const piece_t *p, int f, double *pose, double *off, double *even) {
    const int middle = whole(p) ? (p->i + p->j) / 2 : p->i;
    const double *from = s->free_pose + 12 * (f * s->knots + middle);
    if (whole(p)) {
        const double *way = s->free_variation + 2 * f * s->knots;
        for (int k = 0; k < 2; k++)
            off[k] = fmax(way[2 * middle + k] - way[2 * p->i + k], way[2 * p->j + k] - way[2 * middle + k]);
        memcpy(pose, from, 12 * sizeof *pose);
        return;
    }
    const double part = 0.5 * (p->low + p->high), half = 0.5 * (p->high - p->low);
    const double *turn_ = s->free_turn + 3 * (f * (s->knots - 1) + p->i), *to = from + 12;
    const double angle = sqrt(dot3(turn_, turn_));
    double shift[3], R[9], u[3] = {1.0, 0.0, 0.0};
    minus3(to + 9, from + 9, shift);
    for (int k = 0; k < 3 && angle > 0.0; k++) u[k] = turn_[k] / angle;
    axis_angle(u, cos(part * angle), sin(part * angle), R);
    turns(from, R, pose);
    along3(from + 9, part, shift, pose + 9);
    off[0] = half * sqrt(dot3(shift, shift));
    off[1] = half * angle;
    turn(from, turn_, even + 3);
    for (int k = 0; k < 3; k++) even[k] = half * shift[k], even[3 + k] *= half;
}

/* All frames in the middle of a piece */
static void place_frames(sweep_t *s, const piece_t *p) {
    static const double still[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    s->even = s->drift && !whole(p);
    for (int f = 0; f < s->frames; f++) {
        double *pose = s->pose + 12 * f, *off = s->deviation + 4 * f, *drift = s->drift + 7 * f, here[12], R[9];
        const double *axis = s->axis + 5 * f;
        compose(s->parent[f] < 0 ? still : s->pose + 12 * s->parent[f], s->place + 12 * f, here);
        memset(off, 0, 4 * sizeof *off);
        if (s->kind[f] == FREE) {
            double moved[12], even[6] = {0};
            const double *slack = s->free_slack + 2 * s->coordinate[f];
            free_at(s, p, s->coordinate[f], moved, off, even);
            compose(here, moved, pose);
            if (s->even) turn(here, even, drift), turn(here, even + 3, drift + 3), drift[6] = 0.0;
            for (int k = 0; k < 2; k++) off[2 + k] = slack[k], off[k] += slack[k];
            continue;
        }
        memcpy(pose, here, sizeof here);
        if (s->kind[f] == FIXED) continue;
        const int turning = s->kind[f] == TURNING;
        const double q = axis[3] * scalar_at(s, p, s->coordinate[f], off + turning) + axis[4];
        off[2 + turning] = fabs(axis[3]) * s->slack[s->coordinate[f]];
        off[turning] = fabs(axis[3]) * off[turning] + off[2 + turning];
        if (turning) {
            axis_angle(axis, cos(q), sin(q), R);
            turns(here, R, pose);
        } else {
            double shift[3];
            turn(here, axis, shift);
            along3(here + 9, q, shift, pose + 9);
        }
        if (s->even) {
            double stray, way = axis[3] * even_part(s, p, s->coordinate[f], &stray), along[3];
            turn(pose, axis, along);
            memset(drift, 0, 6 * sizeof *drift);
            for (int k = 0; k < 3; k++) drift[3 * turning + k] = way * along[k];
            drift[6] = fabs(axis[3]) * stray;
        }
    }
}

/* No point of a capsule is farther from a frame's axis, or from its origin */
static double farthest_from(const double *pose, const double *axis, const double *ends, double radius) {
    double most = 0.0, direction[3], d[3];
    if (axis) turn(pose, axis, direction);
    for (int e = 0; e < 2; e++) {
        minus3(ends + 3 * e, pose + 9, d);
        if (axis) along3(d, -dot3(d, direction), direction, d);
        most = fmax(most, dot3(d, d));
    }
    return sqrt(most) + radius;
}

/* How far points at `reach` may go: no chord is longer than its arc, or than twice the reach */
static double gone(double shift, double angle, double reach) { return shift + fmin(angle, 2.0) * reach; }

/* A body and the ends of its core at the place of its frame */
static void place_core(sweep_t *s, int b) {
    static const double still[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    const double *frame = s->body_frame[b] < 0 ? still : s->pose + 12 * s->body_frame[b], *line = s->line + 8 * b;
    double *ends = s->world_line + 6 * b;
    compose(frame, s->body_place + 12 * b, s->body_pose + 12 * b);
    for (int e = 0; e < 2; e++) {
        turn(frame, line + 3 * e, ends + 3 * e);
        for (int k = 0; k < 3; k++) ends[3 * e + k] += frame[9 + k];
    }
}

/* A body in the middle, and how far its points may be off it, frame by frame up its chain.
 *
 * Joints are taken to where they are from the last to the first: what is before a joint is then still in the middle. With g the
 * rigid motion about the axis there, a point x of the middle that is at y so far gets to g(y), and |g(y) - x| is no more than
 * |g(y) - g(x)| + |g(x) - x| = |y - x| + the way of x about the axis. The ball of a capsule has no turn: its core counts.
 *
 * Within half a piece between two knots the motion of x is linear but for what scalars stray, times their reach r, and
 *
 *     1/2 sum_j o_j r_j (o_j + 2 sum_i o_i),     i: the turning joints that carry joint j, which goes by o_j
 *
 * with r_j as large as joints beyond j may make it (1 where j shifts). So of a link that rests, as one that holds something while
 * all others move, little is left. */
static void place_body(sweep_t *s, int b) {
    const double *ends = s->world_line + 6 * b, *line = s->line + 8 * b;
    double *moved = s->moved + 2 * (s->depth + 1) * b, reach_;
    place_core(s, b);
    moved[0] = moved[1] = 0.0;
    double even[2][3] = {{0}}, turned[3] = {0}, carried = 0.0, bent = 0.0;
    for (int k = 0; k < s->chain_length[b]; k++, moved += 2) {
        const int f = s->chain[s->depth * b + k];
        const double *off = s->deviation + 4 * f, *drift = s->drift + 7 * f;
        if (off[0] == 0.0 && off[1] == 0.0 && off[2] == 0.0 && off[3] == 0.0) {
            moved[2] = moved[0], moved[3] = moved[1];
            continue;
        }
        reach_ = farthest_from(s->pose + 12 * f, s->kind[f] == FREE ? 0 : s->axis + 5 * f, ends, line[7]);
        moved[2] = moved[0] + gone(off[0], off[1], reach_);
        moved[3] = moved[1] + gone(off[2], off[3], reach_);
        if (!s->even) continue;
        const double far = reach_ + moved[0], by = off[1] * far;
        bent += off[1] * (0.5 * by + carried) + drift[6] * (s->kind[f] == TURNING ? reach_ : 1.0);
        carried += by + off[0];
        for (int e = 0; e < 2; e++) {
            double arm[3], way[3];
            minus3(ends + 3 * e, s->pose + 12 * f + 9, arm);
            cross3(drift + 3, arm, way);
            for (int i = 0; i < 3; i++) even[e][i] += drift[i] + way[i];
        }
        for (int i = 0; i < 3; i++) turned[i] += drift[3 + i];
        const double linear = sqrt(fmax(dot3(even[0], even[0]), dot3(even[1], even[1]))) + line[7] * sqrt(dot3(turned, turned));
        moved[2] = fmin(moved[2], linear + bent + moved[3]);
    }
    s->stamp[b] = s->node;
}

#endif
