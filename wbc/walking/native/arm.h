/* One arm with its first joints, forearm and bent hand in closed form, as arms/puma.py. */
#ifndef WBC_WALKING_ARM_H
#define WBC_WALKING_ARM_H

#include <math.h>
#include <string.h>

#define PI 3.14159265358979323846
enum { JOINTS = 6, POINTS = 6 };

/* Lengths [m], limits of joints [rad], their rates and accelerations, limits of elbow and shoulder [rad]. */
typedef struct {
    double neck, offset, upper, fore, hand;
    double limits[JOINTS], rates[JOINTS], accelerations[JOINTS];
    double elbow, shoulder;
} Arm;

/* A rigid transform, or one between two of them: rows of a 3 x 4 matrix. */
typedef struct {
    double row[3][4];
} Frame;

static double dot(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double larger(double a, double b)
{
    return a > b ? a : b;
}

static double smaller(double a, double b)
{
    return a < b ? a : b;
}

static Frame frame_of(const double *matrix)
{
    Frame out;
    memcpy(out.row, matrix, sizeof out.row);
    return out;
}

static Frame product(const Frame *a, const double *b)
{
    Frame out;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 4; ++j)
            out.row[i][j] = a->row[i][0] * b[j] + a->row[i][1] * b[4 + j] + a->row[i][2] * b[8 + j]
                            + (j == 3 ? a->row[i][3] : 0.0);
    return out;
}

/* The pose at a fractional sample of a path of `count` poses (4 x 4 each), by straight lines between entries. */
static Frame blended(const double *poses, long count, double sample)
{
    const double last = (double)count - 1.0, at = sample < 0.0 ? 0.0 : sample > last ? last : sample;
    const long low = (long)at < count - 2 ? (long)at : count - 2;
    const double part = at - (double)low, *first = poses + 16 * low, *second = first + 16;
    Frame out;
    for (int k = 0; k < 12; ++k)
        out.row[k / 4][k % 4] = first[k] * (1.0 - part) + second[k] * part;
    return out;
}

/* An angle in (-pi, pi]. */
static double wrapped(double angle)
{
    double rest = fmod(PI - angle, 2.0 * PI);
    if (rest < 0.0)
        rest += 2.0 * PI;
    return PI - rest;
}

/* Base, neck, shoulder, elbow, wrist and hand of an arm at six angles, in the frame that `base` is given in. */
static void arm_points(const Arm *arm, const Frame *base, const double *q, double out[POINTS][3])
{
    const double s1 = sin(q[0]), c1 = cos(q[0]), s2 = sin(q[1]), c2 = cos(q[1]);
    const double s = sin(q[1] + q[2]), c = cos(q[1] + q[2]);
    const double s4 = sin(q[3]), c4 = cos(q[3]), s5 = sin(q[4]), c5 = cos(q[4]);
    const double r = s2 * arm->upper + s * arm->fore;
    const double outward = c * c4 * s5 + s * c5, sideways = s4 * s5;
    double local[POINTS][3] = { { 0.0, 0.0, 0.0 }, { 0.0, 0.0, arm->neck } };
    local[2][0] = -arm->offset * s1;
    local[2][1] = arm->offset * c1;
    local[2][2] = arm->neck;
    local[3][0] = local[2][0] + arm->upper * (c1 * s2);
    local[3][1] = local[2][1] + arm->upper * (s1 * s2);
    local[3][2] = local[2][2] + arm->upper * c2;
    local[4][0] = c1 * r - s1 * arm->offset;
    local[4][1] = s1 * r + c1 * arm->offset;
    local[4][2] = arm->neck + c2 * arm->upper + c * arm->fore;
    local[5][0] = (c1 * outward - s1 * sideways) * arm->hand + local[4][0];
    local[5][1] = (s1 * outward + c1 * sideways) * arm->hand + local[4][1];
    local[5][2] = (c * c5 - s * c4 * s5) * arm->hand + local[4][2];
    for (int p = 0; p < POINTS; ++p)
        for (int i = 0; i < 3; ++i)
            out[p][i] = base->row[i][0] * local[p][0] + base->row[i][1] * local[p][1] + base->row[i][2] * local[p][2]
                        + base->row[i][3];
}

#endif
