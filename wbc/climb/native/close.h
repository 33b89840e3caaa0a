/* Contacts brought to where they hold, with the least change of body and angles. */
#ifndef WBC_CLOSE_H
#define WBC_CLOSE_H

#include "posture.h"

#define MOST_ROWS (6 * MOST_LIMBS)

/* Largest error of contacts [m, rad] */
static double largest_error(const limb_t *limb, const double *r) {
    double most = 0.0;
    for (int i = 0; i < limb->rows; i++) most = fmax(most, fabs(r[i]) / (i < 3 ? 1.0 : limb->length));
    return most;
}

/* One of Newton's steps, of the least change: 1 rad of an angle weighs as much as `body` of the body [m, rad]; the largest error
 * before it [m, rad]. No step is made where that is below `enough`, or beyond all that a step could mend */
static double close_once(const limb_t *limbs, const int *offset, int contacts, const int *which, const double *wanted, int turned,
                         double body, double enough, double *state) {
    placed_t placed;
    double r[MOST_ROWS], B[MOST_ROWS][6], A[MOST_ROWS][MOST_ANGLES], S[MOST_ROWS * MOST_ROWS], E[6][6];
    double error = 0.0, trace = 0.0, twist[6] = {0}, step[MOST_LIMBS][MOST_ANGLES], longest = 0.0;
    int start[MOST_LIMBS + 1] = {0};
    for (int c = 0; c < contacts; c++) {
        limb_t limb = limbs[which[c]];
        if (!turned) limb.rows = 3;
        const int first = start[c];
        start[c + 1] = first + limb.rows;
        place_steps(&limb, state, state + 12 + offset[which[c]], &placed);
        contact_rows(&limb, &placed, wanted + 12 * c, r + first, E, A + first);
        error = fmax(error, largest_error(&limb, r + first));
        double arm[3];
        minus3(placed.tip + 9, state + 9, arm);
        for (int i = 0; i < limb.rows; i++) {
            cross3(arm, E[i], B[first + i] + 3);
            for (int k = 0; k < 3; k++) B[first + i][k] = body * E[i][k], B[first + i][3 + k] = body * (B[first + i][3 + k] + E[i][3 + k]);
        }
    }
    if (!(error >= enough) || !(error < 1e3)) return error;
    const int rows = start[contacts];
    for (int c = 0; c < contacts; c++)
        for (int i = start[c]; i < start[c + 1]; i++)
            for (int j = 0; j <= i; j++) {
                double sum = 0.0;
                for (int k = 0; k < 6; k++) sum += B[i][k] * B[j][k];
                if (j >= start[c])
                    for (int k = 0; k < limbs[which[c]].angles; k++) sum += A[i][k] * A[j][k];
                S[i * rows + j] = sum;
            }
    for (int i = 0; i < rows; i++) trace += S[i * rows + i], r[i] = -r[i];
    for (int i = 0; i < rows; i++) S[i * rows + i] += 1e-14 + 1e-12 * trace / rows;
    if (!solve_positive(rows, S, r)) return error;
    for (int c = 0; c < contacts; c++)
        for (int k = 0; k < limbs[which[c]].angles; k++) {
            step[c][k] = 0.0;
            for (int i = start[c]; i < start[c + 1]; i++) step[c][k] += A[i][k] * r[i];
            longest = fmax(longest, fabs(step[c][k]));
        }
    const double by = longest > 1.0 ? 1.0 / longest : 1.0; /* more than a radian is beyond what the rows say */
    for (int k = 0; k < 6; k++)
        for (int i = 0; i < rows; i++) twist[k] += by * body * B[i][k] * r[i];
    move_body(state, twist);
    for (int c = 0; c < contacts; c++)
        for (int k = 0; k < limbs[which[c]].angles; k++) state[12 + offset[which[c]] + k] += by * step[c][k];
    return error;
}

#endif
