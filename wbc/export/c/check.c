/* Compares this build with the commands that were computed where it was exported:  ./check [check.bin]
 *
 * check.bin holds numbers of 8 bytes: a mark that tells the byte order, the number of states, NQ, NV, NP and how far
 * commands may be apart [rad/s, m/s]; then for each state q, v measured, the run-time inputs, the status and v commanded. Exit status 0 where all agree. */
#include "wbc_tick.h"

#include <math.h>
#include <stdio.h>

#define MARK 1234567.0

static int numbers(FILE *file, wbc_real *to, int count) {
    for (int i = 0; i < count; i++) {
        double number;
        if (fread(&number, 8, 1, file) != 1) return 0;
        to[i] = (wbc_real)number;
    }
    return 1;
}

int main(int argc, char **argv) {
    static wbc_memory memory;
    static wbc_real q[WBC_NQ + 1], v[WBC_NV], expected[1 + WBC_NV];
    wbc_real head[6], largest = 0;
    int differ = 0, others = 0, seen[4] = {0, 0, 0, 0};
    const char *name = argc > 1 ? argv[1] : "check.bin";
    FILE *file = fopen(name, "rb");
    if (!file || !numbers(file, head, 6)) {
        printf("%s cannot be read\n", name);
        return 2;
    }
    if (head[0] != MARK || head[2] != WBC_NQ || head[3] != WBC_NV || head[4] != WBC_NP) {
        printf("%s is of another export or of another byte order\n", name);
        return 2;
    }
    wbc_controller *c = wbc_init(&memory);
    const int states = (int)head[1];
    for (int k = 0; k < states; k++) {
        if (!numbers(file, q, WBC_NQ) || !numbers(file, v, WBC_NV) || !numbers(file, wbc_inputs(c), WBC_NP) ||
            !numbers(file, expected, 1 + WBC_NV)) {
            printf("%s ends early\n", name);
            return 2;
        }
        const int status = wbc_step(c, q, v);
        int same = status == (int)expected[0];
        for (int i = 0; i < WBC_NV; i++) {
            const wbc_real difference = (wbc_real)fabs(wbc_last(c)->v[i] - expected[1 + i]);
            if (!(difference <= largest)) largest = difference;
            same = same && difference <= head[5];
        }
        differ += !same;
        if (status >= 0 && status < 4) seen[status]++;
        else others++;
    }
    fclose(file);
    printf("%d states: %d solved, %d relaxed, %d braked, %d recovered or uncertified, %d capped; %d differ, by %.3g at most\n",
           states, seen[0], seen[1], seen[2], others, seen[3], differ, largest);
    return differ != 0;
}
