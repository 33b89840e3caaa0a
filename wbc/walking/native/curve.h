/* Curves of hands, as planner/swings/curve.py: arcs about the axis of an arm's first joint, raised along the normals. */
#ifndef WBC_WALKING_CURVE_H
#define WBC_WALKING_CURVE_H

#include "world.h"

/* m curves between `begin` and `end` (m x 3), with the normals -leave and -arrive, `rise` m x 2 and `lift` m, about the
   z axes of `frames` (4 x 4), joint 1 turning by about `turn`; the part `part` from chord to arc. At n points: `across`
   from 0 to 1, and `raised` the part of the rise. Out: m x n x 3. */
void curves_at(long m, long n, const double *begin, const double *end, const double *leave, const double *arrive,
               const double *rise, const double *lift, const double *frames, const double *turn, double part,
               const double *across, const double *raised, double *out)
{
    for (long s = 0; s < m; ++s) {
        const double *a = begin + 3 * s, *b = end + 3 * s, *f = frames + 16 * s;
        double first[3], last[3];
        for (int k = 0; k < 3; ++k) {
            first[k] = f[k] * (a[0] - f[3]) + f[4 + k] * (a[1] - f[7]) + f[8 + k] * (a[2] - f[11]);
            last[k] = f[k] * (b[0] - f[3]) + f[4 + k] * (b[1] - f[7]) + f[8 + k] * (b[2] - f[11]);
        }
        const double angle = atan2(first[1], first[0]), far[2] = { hypot(first[0], first[1]), hypot(last[0], last[1]) };
        double change = atan2(last[1], last[0]) - angle;
        /* The direction in which joint 1 turns */
        change += 2.0 * PI * rint((turn[s] - change) / (2.0 * PI));
        for (long i = 0; i < n; ++i) {
            const double y = across[i], r = raised[i], at = angle + change * y;
            const double distance = far[0] * (1.0 - y) + far[1] * y;
            const double arc[3] = { distance * cos(at), distance * sin(at), first[2] * (1.0 - y) + last[2] * y };
            const double height = r * (rise[2 * s] * (1.0 - y) + rise[2 * s + 1] * y) + 4.0 * y * (1.0 - y) * lift[s];
            for (int k = 0; k < 3; ++k) {
                const double chord = a[k] * (1.0 - y) + b[k] * y;
                const double round = f[4 * k] * arc[0] + f[4 * k + 1] * arc[1] + f[4 * k + 2] * arc[2] + f[4 * k + 3];
                const double up = leave[3 * s + k] * (y - 1.0) - arrive[3 * s + k] * y;
                out[3 * (s * n + i) + k] = chord + part * (round - chord) + height * up;
            }
        }
    }
}

/* What lifts m flat curves over what stands around: `rise` m x 2, with which hands are `height` up where they have come `aside`,
   and `lift` m, what is lacking then at places in between, `places` of them: how far across, and the part of the rise.
   `span`: the same of n places at which their length is measured; `half`: x over the first half of a curve, and `steps`
   the parts across there, `count` each. `upright`: the part of a curve that does not go across, at either end. */
void raise_curves(const World *world, long m, const double *begin, const double *end, const double *leave,
                  const double *arrive, const double *frames, const double *turn, double part, double height,
                  double aside, double upright, long n, const double *span, long places, const double *across,
                  const double *raised, long count, const double *steps, const double *half, double *rise, double *lift)
{
    for (long s = 0; s < m; ++s) {
        const double none[2] = { 0.0, 0.0 }, flat = 0.0;
        double points[3 * 64], length = 0.0, most = 0.0;
        const double *a = begin + 3 * s, *b = end + 3 * s, *up = leave + 3 * s, *down = arrive + 3 * s;
        curves_at(1, n, a, b, up, down, none, &flat, frames + 16 * s, turn + s, part, span, span, points);
        for (long i = 1; i < n; ++i) {
            double gap[3];
            for (int k = 0; k < 3; ++k)
                gap[k] = points[3 * i + k] - points[3 * i - 3 + k];
            length += sqrt(dot(gap, gap));
        }
        const double wanted = smaller(aside / larger(length, 1e-9), 0.5);
        long low = 0;
        while (low < count - 2 && steps[low + 1] <= wanted)
            ++low;
        const double since = (wanted - steps[low]) / (steps[low + 1] - steps[low]);
        const double x = upright + (1.0 - 2.0 * upright) * (half[low] + since * (half[low + 1] - half[low]));
        rise[2 * s] = rise[2 * s + 1] = height / (1.0 - (1.0 - 2.0 * x) * (1.0 - 2.0 * x));
        curves_at(1, places, a, b, up, down, rise + 2 * s, &flat, frames + 16 * s, turn + s, part, across, raised,
                  points);
        for (long i = 0; i < places; ++i) {
            const double y = across[i];
            most = larger(most, (height - clearance_at(world, points + 3 * i)) / (4.0 * y * (1.0 - y)));
        }
        lift[s] = most;
    }
}

#endif
