/* What runs before main on the board: the floating-point unit on, and input and output by semihosting. Linked with what
 * steps once and is never run, -DONLY_STEPS, it makes the program whose size is told. */
#include <stdint.h>

extern uint32_t stack_high[], bss_low[], bss_high[];
int main(int argc, char **argv);

#ifdef ONLY_STEPS
#include "wbc_tick.h"
static wbc_memory memory;
int main(int argc, char **argv) {
    wbc_real q[WBC_NQ] = WBC_Q0;
    (void)argc, (void)argv;
    return wbc_step(wbc_init(&memory), q, 0);
}
#else
#include <stdlib.h>
void initialise_monitor_handles(void);
#endif

void reset_handler(void) {
    *(volatile uint32_t *)0xE000ED88 |= 0xFu << 20;
    __asm__ volatile("dsb\n isb");
#ifdef ONLY_STEPS
    main(0, 0);
    for (;;) {}
#else
    for (uint32_t *p = bss_low; p < bss_high; p++) *p = 0;
    initialise_monitor_handles();
    exit(main(0, 0));
#endif
}

static void stopped(void) {
    for (;;) {}
}

__attribute__((section(".vectors"), used)) void *const vectors[16] = {
    stack_high, (void *)reset_handler, (void *)stopped, (void *)stopped, (void *)stopped, (void *)stopped, (void *)stopped,
};
void _init(void) {}
void _fini(void) {}
