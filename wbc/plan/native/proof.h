/* Whether all pairs of bodies are far enough apart while every coordinate goes evenly from one end to the other: proven.
 *
 * In the middle of a piece of the motion a direction n parts both bodies of a pair: no point of A is above a, none of B below b.
 * With v the motion of a point x until the ends of the piece as far as it is linear, |n v(x)| is how much that may change, and
 *
 *     |x(t) - x - v(x)| <= 1/2 sum_j o_j r_j (o_j + 2 sum_i o_i),     i: the turning joints that carry joint j
 *
 * for joints that go by o_j, with x at most r_j away from the axis (1 of joints that shift). Bodies that slide along each other
 * are so proven in few pieces. Where it is not enough, both halves are looked at. */
#ifndef WBC_PROOF_H
#define WBC_PROOF_H

#include "plan.h"

/* Pieces are not halved more often */
#define PIECES 40
/* Beyond so large a turn the linear part says nothing [rad] */
#define TURNED 1.5

/* What the joints from a body's on do to it within half a piece: as a screw, and the sums of the bound above */
static void place_drift(plan_t *p, int b) {
    const sweep_t *s = p->sweep;
    const double *moved = s->moved + 2 * (s->depth + 1) * b;
    drift_t *d = p->drifts + (s->depth + 1) * b;
    memset(d, 0, sizeof *d);
    for (int k = 0; k < s->chain_length[b]; k++, d++) {
        const int f = s->chain[s->depth * b + k], turning = s->kind[f] == TURNING, c = s->coordinate[f];
        const double *axis = s->axis + 5 * f, *pose = s->pose + 12 * f, off = s->deviation[4 * f + turning];
        const double way = axis[3] * (p->control[2 * c + 1] - p->control[2 * c]) * p->half, far = moved[2 * k + 2] - moved[2 * k];
        double a[3], u[3];
        turn(pose, axis, a);
        d[1] = d[0];
        if (turning) {
            cross3(pose + 9, a, u);
            along3(d->angular, way, a, d[1].angular);
            along3(d->linear, way, u, d[1].linear);
        } else {
            along3(d->linear, way, a, d[1].linear);
        }
        const double reached = turning ? far + off * moved[2 * k] : far;
        d[1].reached += reached;
        d[1].turned += turning * off;
        d[1].bent += reached * (turning * off - 2.0 * d[1].turned);
    }
    p->drifted[b] = s->node;
}

/* No point of a body is farther along n, at any instant of the piece; the first `stop` joints of its chain move it */
static double top(plan_t *p, int b, int stop, const double *n) {
    const sweep_t *s = p->sweep;
    const shape_t *shape = s->shape + b;
    const double *pose = s->body_pose + 12 * b, *ends = s->world_line + 6 * b, *line = s->line + 8 * b;
    double local[3], rate[2] = {0.0, 0.0}, bend = 0.0, side = 0.0;
    if (stop && p->half > 0.0) {
        if (p->drifted[b] != s->node) place_drift(p, b);
        const drift_t *d = p->drifts + (s->depth + 1) * b + stop;
        double across[3];
        if (d->turned > TURNED) return INFINITY;
        cross3(n, d->angular, across);
        for (int e = 0; e < 2; e++) rate[e] = fabs(dot3(n, d->linear) + dot3(across, ends + 3 * e));
        bend = 0.5 * d->bent + d->turned * d->reached;
        side = line[7] * sqrt(dot3(across, across));
    }
    if (is_round(shape)) return fmax(dot3(n, ends) + rate[0], dot3(n, ends + 3) + rate[1]) + line[6] + bend;
    turn_back(pose, n, local);
    return dot3(n, pose + 9) + reach(shape, local) + shape->size[4] + fmax(rate[0], rate[1]) + side + bend;
}

/* How far a pair is apart along n at least */
static double parted(plan_t *p, int k, const double *n) {
    const sweep_t *s = p->sweep;
    const double back[3] = {-n[0], -n[1], -n[2]};
    return -top(p, s->first[k], s->stop_first[k], n) - top(p, s->second[k], s->stop_second[k], back);
}

/* The same where one of the two is a half-space, whose normal counts; -INFINITY where a shape has no support */
static double parted_any(plan_t *p, int k) {
    const sweep_t *s = p->sweep;
    const int i = s->first[k], j = s->second[k], other = s->shape[j].kind == PLANE ? i : j, wall = other == i ? j : i;
    if (convex(s->shape + i) && convex(s->shape + j)) return parted(p, k, p->normals + 3 * k);
    if (s->shape[wall].kind != PLANE || !convex(s->shape + other)) return -INFINITY;
    const double *W = s->body_pose + 12 * wall, down[3] = {-W[2], -W[5], -W[8]};
    return dot3(down, W + 9) - top(p, other, other == i ? s->stop_first[k] : s->stop_second[k], down);
}

/* A body and the ball about it at the middle of the piece */
static void stand(plan_t *p, int b) {
    sweep_t *s = p->sweep;
    if (s->stamp[b] == s->node || (s->body_frame[b] < 0 && p->drifted[b] < 0)) return;
    double span[3], *ball = p->balls + 4 * b;
    const double *ends = s->world_line + 6 * b;
    place_body(s, b);
    minus3(ends + 3, ends, span);
    along3(ends, 0.5, span, ball);
    ball[3] = endless(s->shape[b].kind) ? INFINITY : 0.5 * sqrt(dot3(span, span)) + s->line[8 * b + 6];
    if (s->body_frame[b] < 0) p->drifted[b] = -1;
}

/* One pair over one piece: 1 where both halves must be looked at */
static int examine(plan_t *p, int k, int last) {
    sweep_t *s = p->sweep;
    const int i = s->first[k], j = s->second[k];
    stand(p, i);
    stand(p, j);
    const double *a = s->moved + 2 * ((s->depth + 1) * i + s->stop_first[k]);
    const double *b = s->moved + 2 * ((s->depth + 1) * j + s->stop_second[k]), off = a[0] + b[0], required = s->required[k];
    const double *one = p->balls + 4 * i, *other = p->balls + 4 * j, reach_ = one[3] + other[3] + off + required;
    double *n = p->normals + 3 * k, d[3];
    minus3(one, other, d);
    if (reach_ < INFINITY ? reach_ <= 0.0 || dot3(d, d) >= reach_ * reach_ : bound_of(s, i, j) - off >= required) return 0;
    if (dot3(n, n) > 0.0 && parted_any(p, k) >= required) return 0;
    answer_t found;
    distance_of(s, i, j, &found);
    p->measured++;
    copy3(found.normal, n);
    if (found.gap < required) {
        s->stopped = k;
        return 0;
    }
    return !(last || off <= p->open || found.gap - off >= required - p->open || parted_any(p, k) >= required - p->open);
}

static void halve(plan_t *p, double low, double high, const int *pairs, int count, int depth, int *room) {
    sweep_t *s = p->sweep;
    const piece_t piece = {0, 1, low, high};
    int left = 0;
    s->node++;
    p->half = 0.5 * (high - low);
    place_frames(s, &piece);
    for (int k = 0; k < count && s->stopped < 0; k++)
        if (examine(p, pairs[k], depth >= PIECES)) room[left++] = pairs[k];
    if (!left || s->stopped >= 0) return;
    halve(p, low, 0.5 * (low + high), room, left, depth + 1, room + left);
    if (s->stopped < 0) halve(p, 0.5 * (low + high), high, room, left, depth + 1, room + left);
}

/* Straight from x to y, which may be x; where a pair is too near it is looked at first the next time */
static int clear(plan_t *p, const double *x, const double *y) {
    sweep_t *s = p->sweep;
    if (!p->pairs) return 1;
    for (int k = 0; k < p->n; k++) {
        p->control[2 * k] = x[k], p->control[2 * k + 1] = y[k];
        p->rate[k] = fabs(y[k] - x[k]);
    }
    s->stopped = -1;
    halve(p, 0.0, x == y ? 0.0 : 1.0, s->chosen, p->pairs, 0, s->list);
    if (s->stopped < 0) return 1;
    for (int k = 0; k < p->pairs; k++)
        if (s->chosen[k] == s->stopped) {
            memmove(s->chosen + 1, s->chosen, k * sizeof *s->chosen);
            s->chosen[0] = s->stopped;
            break;
        }
    return 0;
}

/* The least distance of all pairs at x, less what each keeps; which pair it is */
static double least_margin(plan_t *p, const double *x, int *pair) {
    sweep_t *s = p->sweep;
    const piece_t piece = {0, 1, 0.0, 0.0};
    double least = INFINITY;
    for (int k = 0; k < p->n; k++) p->control[2 * k] = p->control[2 * k + 1] = x[k], p->rate[k] = 0.0;
    s->node++;
    p->half = 0.0;
    place_frames(s, &piece);
    for (int k = 0; k < p->pairs; k++) {
        const int i = s->first[k], j = s->second[k];
        answer_t found;
        stand(p, i);
        stand(p, j);
        if (bound_of(s, i, j) - s->required[k] >= least) continue;
        if (convex(s->shape + i) && convex(s->shape + j) && capsules_of(s, i, j) - s->required[k] >= least) continue;
        distance_of(s, i, j, &found);
        if (found.gap - s->required[k] < least) least = found.gap - s->required[k], *pair = k;
    }
    return least;
}

#endif
