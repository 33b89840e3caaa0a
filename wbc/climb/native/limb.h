/* A limb: turns and shifts from the body to a contact frame, with the masses that they carry. */
#ifndef WBC_LIMB_H
#define WBC_LIMB_H

#include "vectors.h"

#define MOST_ANGLES 16
#define MOST_STEPS 32
#define MOST_LIMBS 12

/* A turn or shift by scale angle + offset along an axis, after a pose on the step before; the mass on it and where that is */
typedef struct {
    int shifts, angle;
    double axis[3], scale, offset, place[12], mass, center[3];
} step_t;

/* `rows`: of the contact's pose that are fixed, 3, 5 or 6; `touch`: contact poses in the
 * body's frame at sampled angles, 12 each; `near`, `far`: least and greatest distance from the first step's place of the point that is
 * at `wrist` in the contact's frame */
typedef struct {
    int steps, angles, rows, samples;
    double length, near, far, tip[12], wrist[3];
    const step_t *step;
    const double *lower, *upper, *rest, *sample, *touch;
} limb_t;

typedef struct {
    double tip[12], pose[MOST_STEPS][12], axis[MOST_STEPS][3], at[MOST_STEPS][3], mass[MOST_STEPS], moment[MOST_STEPS][3];
} placed_t;

/* A pose that is that of the body */
static const double AT_BODY[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};

/* Poses at some angles, along the axes of the frame in which the body is at `base` */
static void place_steps(const limb_t *l, const double *base, const double *angle, placed_t *out) {
    double pose[12], next[12], R[9];
    memcpy(pose, base, sizeof pose);
    for (int k = 0; k < l->steps; k++) {
        const step_t *s = l->step + k;
        compose(pose, s->place, next);
        turn(next, s->axis, out->axis[k]);
        const double value = s->scale * angle[s->angle] + s->offset;
        if (s->shifts) {
            along3(next + 9, value, out->axis[k], next + 9);
            memcpy(pose, next, sizeof pose);
        } else {
            axis_angle(s->axis, cos(value), sin(value), R);
            turns(next, R, pose);
            copy3(next + 9, pose + 9);
        }
        copy3(next + 9, out->at[k]);
        memcpy(out->pose[k], pose, sizeof pose);
    }
    compose(pose, l->tip, out->tip);
}

/* The same with masses and moments (mass times place) of a step and all after it */
static void place_limb(const limb_t *l, const double *base, const double *angle, placed_t *out) {
    double by[3];
    place_steps(l, base, angle, out);
    for (int k = 0; k < l->steps; k++) {
        const step_t *s = l->step + k;
        turn(out->pose[k], s->center, by);
        out->mass[k] = s->mass;
        for (int i = 0; i < 3; i++) out->moment[k][i] = s->mass * (by[i] + out->pose[k][9 + i]);
    }
    for (int k = l->steps - 2; k >= 0; k--) {
        out->mass[k] += out->mass[k + 1];
        for (int i = 0; i < 3; i++) out->moment[k][i] += out->moment[k + 1][i];
    }
}

/* Columns (linear, angular) of the contact frame's twist at its origin, by angle */
static void limb_jacobian(const limb_t *l, const placed_t *p, double J[][6]) {
    memset(J, 0, (size_t)l->angles * sizeof *J);
    for (int k = 0; k < l->steps; k++) {
        const step_t *s = l->step + k;
        double arm[3], by[3];
        minus3(p->tip + 9, p->at[k], arm);
        cross3(p->axis[k], arm, by);
        for (int i = 0; i < 3; i++) {
            J[s->angle][i] += s->scale * (s->shifts ? p->axis[k][i] : by[i]);
            if (!s->shifts) J[s->angle][3 + i] += s->scale * p->axis[k][i];
        }
    }
}

/* How the sum of mass times place moves with an angle */
static void moment_jacobian(const limb_t *l, const placed_t *p, double J[][3]) {
    memset(J, 0, (size_t)l->angles * sizeof *J);
    for (int k = 0; k < l->steps; k++) {
        const step_t *s = l->step + k;
        double arm[3], by[3];
        along3(p->moment[k], -p->mass[k], p->at[k], arm);
        cross3(p->axis[k], arm, by);
        for (int i = 0; i < 3; i++) J[s->angle][i] += s->scale * (s->shifts ? p->mass[k] * p->axis[k][i] : by[i]);
    }
}

/* The turn (axis times angle) that takes R* to R, along the axes in which both are given */
static void turn_between(const double *from, const double *to, double *out) {
    double D[9];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) D[3 * i + k] = dot3(to + 3 * i, from + 3 * k);
    const double v[3] = {0.5 * (D[7] - D[5]), 0.5 * (D[2] - D[6]), 0.5 * (D[3] - D[1])};
    const double sine = sqrt(dot3(v, v)), cosine = 0.5 * (D[0] + D[4] + D[8] - 1.0), angle = atan2(sine, cosine);
    if (sine > 1e-9 || cosine > 0.0) {
        const double by = sine > 1e-9 ? angle / sine : 1.0;
        for (int i = 0; i < 3; i++) out[i] = by * v[i];
        return;
    }
    int most = D[0] > D[4] ? 0 : 1; /* half a turn: the axis is the largest column of D + 1 */
    if (D[8] > D[4 * most]) most = 2;
    double u[3] = {D[most], D[3 + most], D[6 + most]};
    u[most] += 1.0;
    const double size = sqrt(dot3(u, u));
    for (int i = 0; i < 3; i++) out[i] = angle * u[i] / size;
}

/* Rows of how far a contact is from where it is wanted [m], turns times a length; and the rows of the frame's twist that change
 * them: E, rows x 6 */
static void contact_error(const limb_t *l, const double *pose, const double *wanted, double *r, double E[][6]) {
    double by[3], x[3], y[3];
    memset(E, 0, (size_t)l->rows * sizeof *E);
    for (int i = 0; i < 3; i++) r[i] = pose[9 + i] - wanted[9 + i], E[i][i] = 1.0;
    if (l->rows == 3) return;
    if (l->rows == 6) {
        turn_between(wanted, pose, by);
        for (int i = 0; i < 3; i++) r[3 + i] = l->length * by[i], E[3 + i][3 + i] = l->length;
        return;
    }
    const double z[3] = {pose[2], pose[5], pose[8]}, goal[3] = {wanted[2], wanted[5], wanted[8]};
    for (int i = 0; i < 3; i++) x[i] = wanted[3 * i], y[i] = wanted[3 * i + 1];
    cross3(goal, z, by);
    const double sine = sqrt(dot3(by, by)), angle = atan2(sine, dot3(goal, z));
    double size = sine > 1e-9 ? angle / sine : 1.0;
    if (sine <= 1e-9 && angle > 1.0) copy3(x, by), size = angle; /* upside down: any way round */
    r[3] = l->length * size * dot3(x, by), r[4] = l->length * size * dot3(y, by);
    for (int i = 0; i < 3; i++) E[3][3 + i] = l->length * x[i], E[4][3 + i] = l->length * y[i];
}

/* The same errors, and how their rows change with the angles: A, rows x angles */
static void contact_rows(const limb_t *l, const placed_t *p, const double *wanted, double *r, double E[][6], double A[][MOST_ANGLES]) {
    double J[MOST_ANGLES][6];
    contact_error(l, p->tip, wanted, r, E);
    limb_jacobian(l, p, J);
    for (int i = 0; i < l->rows; i++)
        for (int k = 0; k < l->angles; k++) {
            double sum = 0.0;
            for (int j = 0; j < 6; j++) sum += E[i][j] * J[k][j];
            A[i][k] = sum;
        }
}

/* Solves H x = g, n x n and positive, in place by H = L L'; 0: it is not positive */
static int solve_positive(int n, double *H, double *g) {
    double column[n];
    for (int k = 0; k < n; k++) {
        if (!(H[k * (n + 1)] > 0.0)) return 0;
        const double root = sqrt(H[k * (n + 1)]);
        H[k * (n + 1)] = root, g[k] /= root;
        for (int i = k + 1; i < n; i++) column[i] = H[i * n + k] /= root, g[i] -= column[i] * g[k];
        for (int i = k + 1; i < n; i++)
            for (int j = k + 1; j <= i; j++) H[i * n + j] -= column[i] * column[j];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int j = i + 1; j < n; j++) g[i] -= H[j * n + i] * g[j];
        g[i] /= H[i * n + i];
    }
    return 1;
}

/* The step nearest to that from `angle` to `near` (0: to none) with A step = y, damped; its largest part, below 0 where there is none.
 * Angles at a limit that it would cross take no part in it and are `out`, sought in so many rounds */
static double damped_step(const limb_t *l, int rows, double A[][MOST_ANGLES], const double *y, double damping, const double *near,
                          const double *angle, int rounds, double *step, char *out) {
    const int n = l->angles;
    double H[36], x[6], longest = 0.0;
    memset(out, 0, (size_t)n);
    for (int changed = 1; changed && rounds; rounds--) {
        for (int i = 0; i < rows; i++) {
            x[i] = y[i];
            for (int k = 0; near && k < n; k++) x[i] -= out[k] ? 0.0 : A[i][k] * (near[k] - angle[k]);
            for (int k = 0; k <= i; k++) {
                double sum = i == k ? damping : 0.0;
                for (int j = 0; j < n; j++)
                    if (!out[j]) sum += A[i][j] * A[k][j];
                H[i * rows + k] = sum;
            }
        }
        if (!solve_positive(rows, H, x)) return -1.0;
        changed = 0, longest = 0.0;
        for (int k = 0; k < n; k++) {
            step[k] = near && !out[k] ? near[k] - angle[k] : 0.0;
            if (out[k]) continue;
            for (int i = 0; i < rows; i++) step[k] += A[i][k] * x[i];
            if ((angle[k] <= l->lower[k] && step[k] < 0.0) || (angle[k] >= l->upper[k] && step[k] > 0.0)) out[k] = 1, changed = 1;
            longest = fmax(longest, fabs(step[k]));
        }
    }
    return longest;
}

#endif
