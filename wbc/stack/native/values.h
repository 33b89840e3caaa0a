/* Run-time values that are set every tick: in Python their check would cost more than the tick. */
#ifndef WBC_VALUES_H
#define WBC_VALUES_H

#include "tick.h"

/* Largest Frobenius norm of R'R - I of a rotation, and largest size of a number, as in wbc/validation.py */
#define ROTATION_TOLERANCE 1e-6
#define LARGEST_VALUE 1e60

/* What a value is, see wbc/controller/together.py */
#define VALUE_NUMBERS 0
#define VALUE_POSE 1
#define VALUE_CONFIGURATION 2

/* A homogeneous matrix, row by row. Written so that NaN is refused. */
static int is_pose(const double *m) {
    double square = 0.0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const double dot = m[i] * m[j] + m[4 + i] * m[4 + j] + m[8 + i] * m[8 + j] - (i == j);
            square += dot * dot;
        }
    const double determinant = m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
                               m[2] * (m[4] * m[9] - m[5] * m[8]);
    if (!(square <= ROTATION_TOLERANCE * ROTATION_TOLERANCE && determinant > 0.0)) return 0;
    if (!(isfinite(m[3]) && isfinite(m[7]) && isfinite(m[11]))) return 0;
    return m[12] == 0.0 && m[13] == 0.0 && m[14] == 0.0 && m[15] == 1.0;
}

static int is_configuration(const double *q) {
    for (int k = 0; k < UNITS; k++) {
        double square = 0.0;
        for (int i = unit_start[k]; i < unit_start[k] + unit_size[k]; i++) square += q[i] * q[i];
        if (!(fabs(square - 1.0) <= ROTATION_TOLERANCE)) return 0;
    }
    return 1;
}

/* Whether `size` numbers are a value of this kind */
INLINE int is_value(int kind, int size, const double *x) {
    if (kind == VALUE_POSE) return is_pose(x);
    for (int i = 0; i < size; i++)
        if (!(fabs(x[i]) < LARGEST_VALUE)) return 0;
    return kind != VALUE_CONFIGURATION || is_configuration(x);
}

INLINE void put_value(int kind, int size, const double *x, double *to) {
    /* Of a pose: the rotation by columns, then the position */
    for (int i = 0; kind == VALUE_POSE && i < 12; i++) to[i] = x[4 * (i % 3) + i / 3];
    if (kind != VALUE_POSE) memcpy(to, x, (size_t)size * sizeof(double));
}

/* Take values over that stand in `from`, one after the other; 0, and no change, where one of them is refused.
 * `plan` has of each: what it is, where it goes in p, how many numbers it has. */
EXPORT int wbc_tick_take(wbc_tick *t, const double *from, const int *plan, int count) {
    const double *x = from;
    for (int k = 0; k < count; x += plan[3 * k++ + 2])
        if (!is_value(plan[3 * k], plan[3 * k + 2], x)) return 0;
    x = from;
    for (int k = 0; k < count; x += plan[3 * k++ + 2]) put_value(plan[3 * k], plan[3 * k + 2], x, t->p + plan[3 * k + 1]);
    return 1;
}

#endif
