/* What the planner asks thousands of times: laws of swings, points of arms, and whether arms are near each other. */
#include "grips.h"
#include "choice.h"

/* Points of an arm with a base (4 x 4) at n postures of six angles: n x 6 x 3. */
void points_of(const Arm *arm, const double *base, long n, const double *q, double *out)
{
    const Frame frame = frame_of(base);
    for (long i = 0; i < n; ++i)
        arm_points(arm, &frame, q + JOINTS * i, (double (*)[3])(out + 3 * POINTS * i));
}

/* Whether m pairs of arms, given by their points, are nearer than `least` of their links. */
void arms_near(long m, const double *one, const double *other, const double *least, unsigned char *out)
{
    for (long i = 0; i < m; ++i) {
        const long at = 3 * POINTS * i;
        out[i] = (unsigned char)near((const double (*)[3])(one + at), (const double (*)[3])(other + at), least, 0.0);
    }
}

/* Whether the arms of m pairs of grips (m x 2) are near each other at the samples that they share and that are
   multiples of `every`; one flag after the other, `first` and `count` of each pair. `bases` (4 x 4) of the grips' arms,
   m x 2. */
void grips_near(const Arm *arm, const Grips *grips, long m, const long *pairs, const double *bases, long every,
                const long *first, const long *count, const double *least, unsigned char *out)
{
    for (long s = 0; s < m; ++s) {
        const Frame base[2] = { frame_of(bases + 32 * s), frame_of(bases + 32 * s + 16) };
        for (long i = 0; i < count[s]; ++i) {
            double points[2][POINTS][3];
            for (int side = 0; side < 2; ++side) {
                const long grip = pairs[2 * s + side], since = first[s] + every * i - grips->first[grip];
                const long row = grips->offset[grip] + since;
                arm_points(arm, base + side, grips->postures + JOINTS * row, points[side]);
            }
            *out++ = (unsigned char)near((const double (*)[3])points[0], (const double (*)[3])points[1], least, 0.0);
        }
    }
}
