/* Where along a path an arm can have its hand on holds on which it may roll, as planner/grips/table.py. */
#ifndef WBC_WALKING_GRIPS_H
#define WBC_WALKING_GRIPS_H

#include "world.h"

enum { BRANCHES = 2, LIMITS = 8, FREE = 5 };
/* What a posture meets was not looked at yet */
enum { UNKNOWN = -2 };

/* Margins of reach [m] and angles [rad], largest steps of joints 1 to 5 [rad], least cosine between approach and
   body, samples of a grip at least, reach that hands lean for [m], the part of a tilt that they use, and the least
   [rad]; rounding of reach, and |sin theta5| of aligned axes. */
typedef struct {
    double reach_margin, angle_margin, most[FREE], facing, shortest, lean_for, tilt_part, least_tilt, rounding, aligned;
} Keeping;

/* A stretch of samples on one hold with one branch; `row`: of its first posture. */
typedef struct {
    long hold, branch, first, last, reason, row;
} Stretch;

static double span(const Arm *arm, double theta3)
{
    return sqrt(arm->upper * arm->upper + arm->fore * arm->fore + 2.0 * arm->upper * arm->fore * cos(theta3));
}

/* Signed margin of a wrist from the bounds of the first three joints, see wbc.walking.arms.reach. */
static double wrist_margin(const Arm *arm, const double *p, double longest, double shortest)
{
    const double es = arm->upper, we = arm->fore, across2 = p[0] * p[0] + p[1] * p[1] - arm->offset * arm->offset;
    const double r = sqrt(larger(across2, 0.0)), z = p[2] - arm->neck, distance = hypot(r, z);
    const double bend = -acos(larger(smaller((distance * distance - es * es - we * we) / (2.0 * es * we), 1.0), -1.0));
    const double over = atan2(r, z) - atan2(we * sin(bend), es + we * cos(bend)) + bend / 2.0 - arm->shoulder;
    double cone = over < PI / 2.0 ? distance * sin(larger(over, -PI / 2.0)) : distance;
    if (across2 < 0.0)
        cone = -sqrt(-across2);
    return smaller(smaller(longest - distance, distance - shortest), cone);
}

/* The axis of a hand that leans by no more than it needs, and than it may, see wbc.walking.planner.grips.tilt. */
static void lean(const Arm *arm, const Keeping *keep, double tilt, double lack, const double *wrist, double *axis)
{
    double away[3] = { wrist[0], wrist[1], wrist[2] - arm->neck }, across[3];
    const double far = sqrt(dot(away, away));
    for (int k = 0; k < 3; ++k)
        away[k] /= far;
    const double along = dot(away, axis);
    for (int k = 0; k < 3; ++k)
        across[k] = away[k] - along * axis[k];
    const double size = larger(sqrt(dot(across, across)), 1e-6);
    const double angle = smaller(lack / (arm->hand * size), keep->tilt_part * tilt);
    for (int k = 0; k < 3; ++k)
        axis[k] = cos(angle) * axis[k] + sin(angle) * across[k] / size;
}

static double opposite(double angle)
{
    return angle > 0.0 ? angle - PI : angle + PI;
}

/* Joints 1 to 5 of both wrist branches with the wrist at `w` and the hand along `axis`; whether the wrist is there. */
static int postures(const Arm *arm, const Keeping *keep, const double *w, const double *axis, double q[BRANCHES][FREE])
{
    const double es = arm->upper, we = arm->fore, off = arm->offset, z = w[2] - arm->neck;
    const double rho2 = w[0] * w[0] + w[1] * w[1], r = sqrt(larger(rho2 - off * off, 0.0));
    const double cosine = (r * r + z * z - es * es - we * we) / (2.0 * es * we);
    const double theta1 = wrapped(atan2(w[1], w[0]) - atan2(off, r));
    const double theta3 = -acos(larger(smaller(cosine, 1.0), -1.0));
    const double theta2 = wrapped(atan2(r, z) - atan2(we * sin(theta3), es + we * cos(theta3)));
    const double s1 = sin(theta1), c1 = cos(theta1), s = sin(theta2 + theta3), c = cos(theta2 + theta3);
    const double outward = c1 * axis[0] + s1 * axis[1], zx = c * outward - s * axis[2];
    const double zy = c1 * axis[1] - s1 * axis[0];
    const double sine = hypot(zx, zy), theta5 = atan2(sine, s * outward + c * axis[2]);
    const double theta4 = sine <= keep->aligned ? 0.0 : atan2(zy, zx);
    for (int b = 0; b < BRANCHES; ++b) {
        q[b][0] = theta1;
        q[b][1] = theta2;
        q[b][2] = theta3;
        q[b][3] = b && sine > keep->aligned ? opposite(theta4) : theta4;
        q[b][4] = b ? -theta5 : theta5;
    }
    return fabs(cosine) <= 1.0 + keep->rounding && rho2 >= off * off * (1.0 - keep->rounding);
}

/* The limit that a posture is nearest to, or beyond; joint 6 has none. */
static int nearest_limit(const Arm *arm, const double *q, double *least)
{
    const double margins[LIMITS] = {
        arm->limits[0] - fabs(q[0]), arm->limits[1] - fabs(q[1]), arm->limits[2] - fabs(q[2]),
        arm->limits[3] - fabs(q[3]), arm->limits[4] - fabs(q[4]), INFINITY,
        arm->elbow - q[2], q[1] + q[2] / 2.0 - arm->shoulder,
    };
    int out = 0;
    for (int k = 1; k < LIMITS; ++k)
        if (margins[k] < margins[out])
            out = k;
    *least = margins[out];
    return out;
}

/* The joint that moves most beyond `most` from q to p, -1 where none does. */
static int too_fast(const double *most, const double *q, const double *p)
{
    int out = -1;
    double worst = 1.0;
    for (int k = 0; k < FREE; ++k) {
        const double used = fabs(p[k] - q[k]) / most[k];
        if (used > worst) {
            worst = used;
            out = k;
        }
    }
    return out;
}

/* Where the wrist of a hand on a hold is in the frame of the arm's base, the hand's axis, and how much reach is left;
   whether it is in reach. `spans`: the shoulder's largest and least distance from the wrist. */
static int wrist_on(const Arm *arm, const Keeping *keep, const double *spans, const double *frame, const double *place,
                    const double *normal, double tilt, double *w, double *axis, double *left)
{
    const double whole = arm->offset + arm->upper + arm->fore + arm->hand, *f = frame;
    const double from[3] = { place[0] - f[3], place[1] - f[7], place[2] - f[11] };
    double p[3];
    p[2] = f[2] * from[0] + f[6] * from[1] + f[10] * from[2];
    /* Most holds are too far away: from the neck's end */
    if (dot(from, from) + arm->neck * (arm->neck - 2.0 * p[2]) >= whole * whole)
        return 0;
    axis[2] = f[2] * normal[0] + f[6] * normal[1] + f[10] * normal[2];
    if (axis[2] <= keep->facing)
        return 0;
    w[2] = p[2] - arm->hand * axis[2];
    for (int k = 0; k < 2; ++k) {
        p[k] = f[k] * from[0] + f[4 + k] * from[1] + f[8 + k] * from[2];
        axis[k] = f[k] * normal[0] + f[4 + k] * normal[1] + f[8 + k] * normal[2];
        w[k] = p[k] - arm->hand * axis[k];
    }
    const double z = w[2] - arm->neck, far = w[0] * w[0] + w[1] * w[1] - arm->offset * arm->offset + z * z;
    if (tilt < keep->least_tilt && far > spans[0] * spans[0])
        return 0;
    double reach = wrist_margin(arm, w, spans[0], spans[1]);
    if (tilt >= keep->least_tilt && keep->lean_for > reach) {
        lean(arm, keep, tilt, keep->lean_for - reach, w, axis);
        for (int k = 0; k < 3; ++k)
            w[k] = p[k] - arm->hand * axis[k];
        reach = wrist_margin(arm, w, spans[0], spans[1]);
    }
    *left = reach;
    return reach > keep->reach_margin;
}

/* Grips of an arm on m holds along n frames of its base (4 x 4): `stretches`, and their postures of six angles, joint 6
   at 0; both are long enough for all. They end where arm `row` meets something of the world, if there is one, of which
   the holds are the rows `holds`, or the body does, `blocked` of each frame. `work`: 2 n x 6. Returns the number of stretches. */
long grips_along(const Arm *arm, const Keeping *keep, const World *world, long row, long n, const double *frames,
                 long m, const double *positions, const double *axes, const double *tilts, const long *holds, const long *blocked,
                 double *work, Stretch *stretches, double *rows)
{
    const double spans[2] = { span(arm, arm->elbow), span(arm, -arm->limits[2]) };
    long found = 0, used = 0;
    for (long h = 0; h < m; ++h) {
        /* Samples at which the stretches that are going on began */
        long since[BRANCHES] = { -1, -1 };
        for (long i = 0; i <= n; ++i) {
            double axis[3], w[3], left, q[BRANCHES][FREE];
            const double *f = frames + 16 * i;
            const double *place = positions + 3 * h, *normal = axes + 3 * h;
            const int there = i < n && wrist_on(arm, keep, spans, f, place, normal, tilts[h], w, axis, &left);
            const int solved = there && postures(arm, keep, w, axis, q);
            long met = UNKNOWN;
            for (int b = 0; b < BRANCHES; ++b) {
                double *mine = work + JOINTS * n * b, least = 0.0;
                const int limit = there ? nearest_limit(arm, q[b], &least) : 0;
                int fits = solved && least > keep->angle_margin;
                long meets = fits && world ? blocked[i] : NOTHING;
                fits &= meets == NOTHING;
                if (fits && world) {
                    /* With either branch of the wrist the links are at the same places */
                    if (met == UNKNOWN) {
                        const double posture[JOINTS] = { q[b][0], q[b][1], q[b][2], q[b][3], q[b][4] };
                        const long own[2] = { holds[h], -1 };
                        const Frame frame = frame_of(f);
                        met = posture_meets(world, arm, row, &frame, posture, own);
                    }
                    meets = met;
                    fits = meets == NOTHING;
                }
                const int fast = there && since[b] >= 0 ? too_fast(keep->most, mine + JOINTS * (i - 1), q[b]) : -1;
                if (since[b] >= 0 && (!fits || fast >= 0)) {
                    const long length = i - since[b], slow = fast >= 0 ? LIMITS + 1 + fast : limit;
                    const long touched = meets == NOTHING ? slow : LIMITS + 8 + meets;
                    const long reason = i == n ? LIMITS + 7 : there ? touched : LIMITS;
                    if ((double)length >= keep->shortest) {
                        stretches[found++] = (Stretch){ h, b, since[b], i - 1, reason, used };
                        memcpy(rows + JOINTS * used, mine + JOINTS * since[b], sizeof(double) * JOINTS * (size_t)length);
                        used += length;
                    }
                    since[b] = -1;
                }
                if (fits) {
                    if (since[b] < 0)
                        since[b] = i;
                    memcpy(mine + JOINTS * i, q[b], sizeof q[b]);
                    mine[JOINTS * i + FREE] = 0.0;
                }
            }
        }
    }
    return found;
}

/* Postures of an arm on m holds at n frames of its base (4 x 4), straight along the holds' axes and clear of the world:
   `table`, long enough for all, three numbers each: frame, hold and branch; |sin theta5| is larger than `wrist`.
   Returns how many there are. */
long grips_at(const Arm *arm, const Keeping *keep, double wrist, const World *world, long row, long n,
              const double *frames, long m, const double *positions, const double *axes, const long *holds, int *table)
{
    const double spans[2] = { span(arm, arm->elbow), span(arm, -arm->limits[2]) };
    long found = 0;
    for (long i = 0; i < n; ++i) {
        const Frame frame = frame_of(frames + 16 * i);
        for (long h = 0; h < m; ++h) {
            double axis[3], w[3], left, q[BRANCHES][FREE], least;
            if (!wrist_on(arm, keep, spans, frames + 16 * i, positions + 3 * h, axes + 3 * h, 0.0, w, axis, &left)
                || !postures(arm, keep, w, axis, q))
                continue;
            const long own[2] = { holds[h], -1 };
            int clear = -1;
            for (int b = 0; b < BRANCHES; ++b) {
                double mine[JOINTS] = { 0.0 };
                nearest_limit(arm, q[b], &least);
                if (!(least > keep->angle_margin && fabs(sin(q[b][4])) > wrist))
                    continue;
                memcpy(mine, q[b], sizeof q[b]);
                /* With either branch of the wrist the links are at the same places */
                if (clear < 0)
                    clear = posture_meets(world, arm, row, &frame, mine, own) == NOTHING;
                if (!clear)
                    break;
                const int where[3] = { (int)i, (int)h, b };
                memcpy(table + 3 * found++, where, sizeof where);
            }
        }
    }
    return found;
}

#endif
