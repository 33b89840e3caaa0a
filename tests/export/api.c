/* Uses every function of the header and prints commands and statuses for the test to compare. */
#include "wbc_tick.h"

#include <math.h>
#include <stdio.h>

static void report(const char *name, int status, const wbc_controller *c, const double *v) {
    (void)c;
    printf("%s %d", name, status);
    for (int i = 0; i < WBC_NV; i++) printf(" %.17g", v[i]);
    printf("\n");
}

int main(void) {
    static wbc_memory one, two;
    wbc_controller *c = wbc_init(&one), *d = wbc_init(&two);
    double q[WBC_NQ] = WBC_Q0, v[WBC_NV] = {0}, bad[WBC_NQ] = WBC_Q0;
    int status = wbc_step(c, q, NULL);
    report("first", status, c, wbc_last(c)->v);
    status = wbc_set_weight(c, WBC_TASK_POSTURE, WBC_TASK_POSTURE_ROWS, 0.25);
    wbc_inputs(c)[WBC_P_HAND_TARGET + 9] += 0.05;
    wbc_rows_enabled(c)[WBC_ROW_BALL] = 0.0;
    wbc_bounds_enabled(c)[WBC_BOUND_LIMITS + 1] = 0.0;
    status |= wbc_set_dt(c, 0.004) | wbc_set_iteration_cap(c, 0);
    wbc_reset(c, NULL);
    v[0] = 0.1;
    status |= wbc_step(c, q, v);
    report("changed", status, c, wbc_last(c)->v);
    wbc_integrate(c, q, wbc_last(c)->v, 0.5, q);
    report("moved", 0, c, q);
    status = wbc_step(d, (const double[])WBC_Q0, NULL);
    report("other", status, d, wbc_last(d)->v);
    bad[2] = NAN;
    printf("refused %d %d %d %d %d\n", wbc_step(d, bad, NULL), wbc_set_dt(c, 1.0), wbc_set_dt(c, NAN),
           wbc_set_iteration_cap(c, -1), wbc_set_weight(c, WBC_TASK_POSTURE, WBC_TASK_ROWS, 1.0));
    printf("weights %d %.17g\n", wbc_set_weight(c, 0, 1, -1.0), wbc_weights(c)[WBC_TASK_POSTURE]);
    return 0;
}
