/* A pose as a run-time input. Targets are set every tick, and in Python their check would cost more than the tick */
#ifndef WBC_POSE_H
#define WBC_POSE_H

#include "tick.h"

/* Largest Frobenius norm of R'R - I of a rotation, as in wbc/validation.py */
#define ROTATION_TOLERANCE 1e-6

/* Take `given` over as the 12 numbers from p[start] on, rotation by columns, then position; 0 and no change where it is
 * not a pose */
EXPORT int wbc_tick_pose(wbc_tick *t, int start) {
    const double *m = t->given;
    double square = 0.0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const double dot = m[i] * m[j] + m[4 + i] * m[4 + j] + m[8 + i] * m[8 + j] - (i == j);
            square += dot * dot;
        }
    const double determinant = m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
                               m[2] * (m[4] * m[9] - m[5] * m[8]);
    /* Written so that NaN is refused */
    if (!(square <= ROTATION_TOLERANCE * ROTATION_TOLERANCE && determinant > 0.0)) return 0;
    if (!(isfinite(m[3]) && isfinite(m[7]) && isfinite(m[11]))) return 0;
    if (!(m[12] == 0.0 && m[13] == 0.0 && m[14] == 0.0 && m[15] == 1.0)) return 0;
    for (int column = 0; column < 4; column++)
        for (int row = 0; row < 3; row++) t->p[start + 3 * column + row] = m[4 * row + column];
    return 1;
}

#endif
