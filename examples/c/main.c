/* Closes the loop on a simulated Panda: the hand moves by 0.1 m to the side, through the exported tick.
 *
 *     wbc export panda --out panda_tick && make -C panda_tick
 *     gcc -std=c99 -Ipanda_tick main.c panda_tick/libwbc_tick.a panda_tick/daqp/libdaqp.a -lm -o main && ./main
 */
#include "wbc_tick.h"

#include <stdio.h>

int main(void) {
    static wbc_memory memory;
    wbc_controller *c = wbc_init(&memory);
    double q[WBC_NQ] = WBC_Q0;
    wbc_inputs(c)[WBC_P_HAND_TARGET + 10] += 0.1; /* y of the position, behind the 9 numbers of the rotation */
    for (int k = 0; k < 400; k++) {
        if (wbc_step(c, q, NULL) != WBC_SOLVED) return 1;
        wbc_integrate(c, q, wbc_last(c)->v, WBC_DT, q); /* a robot would be sent v, and asked for q */
    }
    if (wbc_step(c, q, NULL) < 0) return 1;
    printf("after 2 s the hand is %.3f mm off along y\n", 1e3 * wbc_last(c)->error[WBC_TASK_HAND + 1]);
    return 0;
}
