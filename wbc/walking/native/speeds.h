/* The least time along a curve under the limits of joints 1 to 5, as arms/puma.py and planner/swings/least_time.py. */
#ifndef WBC_WALKING_SPEEDS_H
#define WBC_WALKING_SPEEDS_H

#include "arm.h"

/* Points of a curve at most; joints that limit */
enum { MOST = 128, FIVE = 5 };

/* Parts of rates and accelerations, the fastest hand [m/s], the least derivative [rad], samples between which the
   body's part of the rates is taken; margins of reach [m], angles, elbow [rad] and from the axis of joint 1 [m]. */
typedef struct {
    double rate_part, acceleration_part, fastest, least, step;
    double reach_margin, angle_margin, elbow_margin, axis_margin;
} Rules;

/* np.unwrap, from a first angle in (-pi, pi]. */
static void unwrap(double (*angles)[JOINTS], long n)
{
    double before = angles[0][0], turned = 0.0;
    const double first = wrapped(before) - before;
    for (long i = 1; i < n; ++i) {
        const double here = angles[i][0], change = here - before;
        before = here;
        if (fabs(change) >= PI) {
            double rest = fmod(change + PI, 2.0 * PI);
            rest = (rest < 0.0 ? rest + 2.0 * PI : rest) - PI;
            if (rest == -PI && change > 0.0)
                rest = PI;
            turned += rest - change;
        }
        angles[i][0] = here + turned;
    }
    for (long i = 0; i < n; ++i)
        angles[i][0] += first;
}

/* Angles of a hand at `place` with the wrist bent by `wrists` (`guided` numbers a point), the body at `samples` + step.
   Returns whether the whole swing is within reach and limits. */
static int joint_path(const Arm *arm, const Rules *rules, const double *base, const double *poses, long count, long n,
                      int guided, const double *place, const double *wrists, const double *samples, double step,
                      double (*angles)[JOINTS])
{
    int possible = 1;
    for (long i = 0; i < n; ++i) {
        const Frame body = blended(poses, count, samples[i] + step), frame = product(&body, base);
        double offset[3], p[3], *q = angles[i];
        for (int k = 0; k < 3; ++k)
            offset[k] = place[3 * i + k] - frame.row[k][3];
        for (int k = 0; k < 3; ++k)
            p[k] = frame.row[0][k] * offset[0] + frame.row[1][k] * offset[1] + frame.row[2][k] * offset[2];
        const double *w = wrists + guided * i, s4 = sin(w[0]), c4 = cos(w[0]), s5 = sin(w[1]), c5 = cos(w[1]);
        /* Forearm and bent hand are one link from the elbow */
        const double along = arm->fore + arm->hand * c5, across = arm->hand * c4 * s5;
        const double out = arm->offset + arm->hand * s4 * s5;
        const double reach = hypot(along, across), tilt = atan2(across, along), z = p[2] - arm->neck;
        const double square = p[0] * p[0] + p[1] * p[1] - out * out;
        const double r = sqrt(larger(square, rules->axis_margin * rules->axis_margin)), distance = hypot(r, z);
        const double es = arm->upper, cosine = (distance * distance - es * es - reach * reach) / (2.0 * es * reach);
        const double bend = acos(larger(smaller(cosine, 1.0), -1.0));
        q[0] = atan2(p[1], p[0]) - atan2(out, r);
        q[1] = atan2(r, z) + atan2(reach * sin(bend), arm->upper + reach * cos(bend));
        q[2] = -bend - tilt;
        for (int k = 0; k < guided; ++k)
            q[3 + k] = w[k];
        possible &= square > rules->axis_margin * rules->axis_margin;
        possible &= arm->upper + reach - distance > rules->reach_margin;
        possible &= q[1] + q[2] / 2.0 - arm->shoulder > rules->angle_margin && arm->elbow - q[2] > rules->elbow_margin;
    }
    unwrap(angles, n);
    for (long i = 0; i < n && possible; ++i)
        for (int k = 0; k < 3 + guided; ++k)
            possible &= arm->limits[k] - fabs(angles[i][k]) > rules->angle_margin;
    return possible;
}

/* Derivatives of values that lie `stride` apart: central, and at the ends of second order where `second`. */
static void gradient(const double *f, long n, long stride, double gap, int second, double *out, long apart)
{
    for (long i = 1; i < n - 1; ++i)
        out[i * apart] = (f[(i + 1) * stride] - f[(i - 1) * stride]) / (2.0 * gap);
    const double *e = f + (n - 1) * stride;
    if (second) {
        out[0] = -1.5 / gap * f[0] + 2.0 / gap * f[stride] - 0.5 / gap * f[2 * stride];
        out[(n - 1) * apart] = 0.5 / gap * e[-2 * stride] - 2.0 / gap * e[-stride] + 1.5 / gap * e[0];
    } else {
        out[0] = (f[stride] - f[0]) / gap;
        out[(n - 1) * apart] = (e[0] - e[-stride]) / gap;
    }
}

/* The largest squares of dx/dt under `most`, which is made smaller, with |a u + b s| <= limit; see least_time.py. */
static void squares(const double (*first)[JOINTS], const double (*second)[JOINTS], const double *limits, int joints,
                    long n, double gap, double least, double *most, double *out)
{
    static const double NO_LIMIT = INFINITY;
    double c[MOST][JOINTS], e[MOST][JOINTS];
    const double step = 2.0 * gap;
    for (long i = 0; i < n; ++i) {
        for (int k = 0; k < joints; ++k) {
            const double a = fabs(first[i][k]) < least ? least : first[i][k];
            c[i][k] = second[i][k] / a;
            e[i][k] = limits[k] / fabs(a);
        }
        /* Some u is left between all joints, and one with which s stays above 0 */
        for (int j = 0; j < joints; ++j) {
            for (int k = 0; k < joints; ++k)
                if (k != j)
                    most[i] = smaller(most[i], (e[i][j] + e[i][k]) / larger(c[i][k] - c[i][j], least));
            most[i] = smaller(most[i], step * e[i][j] / larger(step * c[i][j] - 1.0, least));
        }
    }
    /* From point to point by the limit where the step begins, and by the same where it ends */
    for (long i = n - 2; i >= 0; --i)
        for (int k = 0; k < joints; ++k) {
            const double after = most[i + 1], here = (after + step * e[i][k]) / larger(1.0 - step * c[i][k], least);
            const double there = step * e[i + 1][k] + after * larger(1.0 + step * c[i + 1][k], 0.0);
            most[i] = smaller(most[i], smaller(here, there));
        }
    out[0] = 0.0;
    for (long i = 0; i < n - 1; ++i) {
        double u = NO_LIMIT;
        for (int k = 0; k < joints; ++k) {
            const double rise = 1.0 + step * c[i + 1][k];
            const double end = (e[i + 1][k] - c[i + 1][k] * out[i]) / larger(rise, least);
            u = smaller(u, e[i][k] - c[i][k] * out[i]);
            if (rise > least)
                u = smaller(u, end);
        }
        out[i + 1] = smaller(most[i + 1], larger(out[i] + step * u, 0.0));
    }
}

#endif
