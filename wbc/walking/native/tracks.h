/* Laws of swings: the least time along curves of hands while the body moves, and where the arm is meanwhile. */
#ifndef WBC_WALKING_TRACKS_H
#define WBC_WALKING_TRACKS_H

#include "speeds.h"

/* Grips: postures of grip g are `postures` (6 numbers each) from row offset[g], for samples first[g] to last[g]. */
typedef struct {
    const double *postures;
    const long *offset, *first, *last;
} Grips;

/* The posture of a grip at a fractional sample, by straight lines, clipped to the grip: angles from `begin` on. */
static void posture_at(const Grips *grips, long grip, double sample, int begin, int end, double *out)
{
    const double since = sample - (double)grips->first[grip], last = (double)(grips->last[grip] - grips->first[grip]);
    const double at = since < 0.0 ? 0.0 : since > last ? last : since;
    const long most = (long)last - 1 > 0 ? (long)last - 1 : 0, low = (long)at < most ? (long)at : most;
    const double *q = grips->postures + JOINTS * (grips->offset[grip] + low);
    for (int k = begin; k < end; ++k)
        out[k - begin] = q[k] + (at - (double)low) * (q[JOINTS + k] - q[k]);
}

/* Laws of m swings over n points each, see planner/swings/least_time.py. `bases` (4 x 4) are of the swings' arms, and
   `path` has `count` poses, `spacing` apart. `place` m x n x 3, `wrists` m x n x guided, `samples` m x n; `angles`
   m x n x (3 + guided), `rate` and `time` m x n. Returns 1 where n is too large. */
int swing_speeds(const Arm *arm, const Rules *rules, long m, long n, int guided, const double *bases,
                 const double *path, long count, double spacing, const double *place, const double *wrists,
                 const double *samples, unsigned char *possible, double *angles, double *rate, double *time)
{
    const int joints = 3 + guided;
    const double gap = 1.0 / (double)(n - 1);
    if (n > MOST || n < 3 || guided > 3)
        return 1;
    for (long s = 0; s < m; ++s) {
        const double *at = samples + s * n, *hand = place + s * n * 3, *bent = wrists + s * n * guided;
        double here[MOST][JOINTS], further[MOST][JOINTS], first[MOST][JOINTS], second[MOST][JOINTS], most[MOST];
        double walked[MOST], slope[MOST][3], allowed[JOINTS], square[MOST];
        /* The same hand on a body that is a little further */
        const double *base = bases + 16 * s;
        possible[s] = (unsigned char)joint_path(arm, rules, base, path, count, n, guided, hand, bent, at, 0.0, here);
        joint_path(arm, rules, base, path, count, n, guided, hand, bent, at, rules->step, further);
        gradient(at, n, 1, gap, 0, walked, 1);
        for (int k = 0; k < 3; ++k)
            gradient(hand + k, n, 3, gap, 0, &slope[0][k], 3);
        for (int k = 0; k < joints; ++k) {
            allowed[k] = rules->acceleration_part * arm->accelerations[k];
            gradient(&here[0][k], n, JOINTS, gap, 1, &first[0][k], JOINTS);
            for (long i = 0; i < n; ++i)
                first[i][k] -= (further[i][k] - here[i][k]) / rules->step * walked[i];
            gradient(&first[0][k], n, JOINTS, gap, 0, &second[0][k], JOINTS);
        }
        for (long i = 0; i < n; ++i) {
            double top = rules->fastest / larger(sqrt(dot(slope[i], slope[i])), rules->least);
            for (int k = 0; k < joints; ++k) {
                /* Where the body goes where the hand does, the hand may go faster */
                const double bias = (further[i][k] - here[i][k]) / rules->step, d = first[i][k];
                const double with = (double)((d > 0.0) - (d < 0.0)) * bias / spacing;
                const double most_rate = larger(rules->rate_part * arm->rates[k] - with, 0.1 * arm->rates[k]);
                top = smaller(top, most_rate / larger(fabs(d), rules->least));
            }
            most[i] = i == 0 || i == n - 1 ? 0.0 : top * top;
        }
        squares((const double (*)[JOINTS])first, (const double (*)[JOINTS])second, allowed, joints, n, gap,
                rules->least, most, square);
        for (long i = 0; i < n; ++i) {
            memcpy(angles + (s * n + i) * joints, here[i], sizeof(double) * (size_t)joints);
            rate[s * n + i] = sqrt(square[i]);
        }
        time[s * n] = 0.0;
        for (long i = 1; i < n; ++i)
            time[s * n + i] = time[s * n + i - 1] + 2.0 * gap / larger(rate[s * n + i] + rate[s * n + i - 1], 1e-6);
    }
    return 0;
}

/* Swings as the search has them: laws of m swings over n points, made `passes` times, each time with the body where the
   last law has it: at begin + time / spacing, and at most at `last`; and once more where a swing is to take longer, at
   least `least`, so that the hand comes when the next grip begins. `duration` is the law's. Wrists go from grips
   `source` to grips `target` by the parts `blend`. `samples` m x n, `points` m x n x 6 x 3 of the arms in the body's
   frame; the rest as above. */
int swing_tracks(const Arm *arm, const Rules *rules, const Grips *grips, long m, long n, int guided, long passes,
                 const double *bases, const double *path, long count, double spacing, const double *place,
                 const double *blend, const long *source, const long *target, const double *begin, const long *last,
                 const double *least, unsigned char *possible, double *duration, double *samples, double *points)
{
    double wrists[3 * MOST], angles[JOINTS * MOST], rate[MOST], time[MOST];
    if (n > MOST || n < 3 || guided > 3)
        return 1;
    for (long s = 0; s < m; ++s) {
        double *at = samples + s * n;
        const Frame base = frame_of(bases + 16 * s);
        for (long i = 0; i < n; ++i)
            time[i] = (double)i / (double)(n - 1);
        for (long pass = 0; pass < passes || (pass == passes && duration[s] < least[s]); ++pass) {
            for (long i = 0; i < n && pass == passes; ++i)
                time[i] *= least[s] / duration[s];
            for (long i = 0; i < n; ++i) {
                double first[3], second[3];
                at[i] = smaller(begin[s] + time[i] / spacing, (double)last[s]);
                posture_at(grips, source[s], at[i], 3, 3 + guided, first);
                posture_at(grips, target[s], at[i], 3, 3 + guided, second);
                for (int k = 0; k < guided; ++k)
                    wrists[guided * i + k] = first[k] + blend[i] * (second[k] - first[k]);
            }
            swing_speeds(arm, rules, 1, n, guided, bases + 16 * s, path, count, spacing, place + 3 * n * s, wrists, at,
                         possible + s, angles, rate, time);
            if (pass < passes)
                duration[s] = time[n - 1];
        }
        for (long i = 0; i < n; ++i) {
            double q[JOINTS] = { 0.0 };
            memcpy(q, angles + (3 + guided) * i, sizeof(double) * 5);
            arm_points(arm, &base, q, (double (*)[3])(points + 3 * POINTS * (s * n + i)));
        }
    }
    return 0;
}

#endif
