/* Contacts brought to where they hold, with the least change of body and angles. */
#ifndef WBC_CLOSE_H
#define WBC_CLOSE_H

#include "posture.h"

/* Weight of a change of 1 rad of an angle beside errors of contacts: what Newton's steps are short of, as a share */
#define LEAST_CHANGE 1e-6

/* One of Newton's steps, of the least change: 1 rad of an angle weighs as much as `body` of the body [m, rad], which stays where that
 * is 0; the largest error of a contact before it [m], turns times the limb's length. No step is made where that is below `enough`, or
 * beyond all that a step could mend */
static double close_once(const climb_t *c, int n, int contacts, const int *which, const double *wanted, double body, double enough,
                         double *state) {
    placed_t placed;
    double H[MOST_VARIABLES * MOST_VARIABLES] = {0}, g[MOST_VARIABLES] = {0}, left = 0.0, longest = 0.0;
    for (int k = 0; k < contacts; k++) {
        const int l = which[k];
        place_steps(c->limb + l, state, state + 12 + c->offset[l], &placed);
        left = fmax(left, add_contact(c, l, &placed, wanted + 12 * k, state, 6 + c->offset[l], n, H, g));
    }
    const double error = sqrt(left);
    if (!(error >= enough) || !(error < 1e3)) return error;
    for (int k = 0; k < n; k++) H[k * (n + 1)] += LEAST_CHANGE / (k < 6 && body > 0.0 ? body * body : 1.0);
    for (int i = 0; i < n && body == 0.0; i++)
        for (int k = 0; k <= i && k < 6; k++) H[i * n + k] = i == k;
    for (int k = 0; k < 6 && body == 0.0; k++) g[k] = 0.0;
    if (!solve_positive(n, H, g)) return error;
    for (int k = 6; k < n; k++) longest = fmax(longest, fabs(g[k]));
    const double by = longest > 1.0 ? 1.0 / longest : 1.0; /* more than a radian is beyond what the rows say */
    for (int k = 0; k < n; k++) g[k] *= by;
    move_body(state, g);
    for (int k = 6; k < n; k++) state[6 + k] += g[k];
    return error;
}

#endif
