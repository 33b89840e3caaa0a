/* Steps the exported tick through the states of a file that is written like check.bin, here or on a Cortex-M7:
 *
 *     states FILE    a line a state: status, instructions, command; then a line of sizes
 *
 * Instructions are those between two looks at SysTick, which qemu's -icount drives: with `shift=0` an instruction takes a
 * nanosecond, and the 25 MHz of the board's processor make 40 instructions a count. 0 on a host. */
#include "wbc_tick.h"

#include <stdint.h>
#include <stdio.h>

#ifdef __arm__
#define SYSTICK ((volatile uint32_t *)0xE000E010)
#define COUNT_OF 40
#define PAINT 0x5AFEC0DEu
extern uint32_t stack_low[], stack_high[];
static void begin(void) {
    SYSTICK[1] = 0xFFFFFF;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5;
}
static uint32_t now(void) { return SYSTICK[2]; }
static uint32_t between(uint32_t from, uint32_t to) { return ((from - to) & 0xFFFFFF) * COUNT_OF; }
/* What lies below this function's own frame is free */
static void __attribute__((noinline)) paint(void) {
    uint32_t *here = (uint32_t *)__builtin_frame_address(0) - 64;
    for (uint32_t *p = stack_low; p < here; p++) *p = PAINT;
}
static uint32_t deepest(void) {
    const uint32_t *p = stack_low;
    while (p < stack_high && *p == PAINT) p++;
    return (uint32_t)((uintptr_t)__builtin_frame_address(0) - (uintptr_t)p);
}
/* Two instructions a turn */
static void __attribute__((noinline)) turns(uint32_t count) {
    __asm__ volatile("1: subs %0, %0, #1\n bne 1b" : "+r"(count) : : "cc");
}
#else
static void begin(void) {}
static uint32_t now(void) { return 0; }
static uint32_t between(uint32_t from, uint32_t to) { return from - to; }
static void paint(void) {}
static uint32_t deepest(void) { return 0; }
static void turns(uint32_t count) { (void)count; }
#endif

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
    static wbc_real q[WBC_NQ + 1], v[WBC_NV], expected[1 + WBC_NV], head[6];
    FILE *file = fopen(argc > 1 ? argv[1] : "check.bin", "rb");
    if (!file || !numbers(file, head, 6)) return 2;
    wbc_controller *c = wbc_init(&memory);
    begin();
    uint32_t from = now(), deep = 0;
    turns(100000);
    printf("loop %lu\n", (unsigned long)between(from, now()));
    const int states = (int)head[1];
    for (int k = 0; k < states; k++) {
        if (!numbers(file, q, WBC_NQ) || !numbers(file, v, WBC_NV) || !numbers(file, wbc_inputs(c), WBC_NP) ||
            !numbers(file, expected, 1 + WBC_NV))
            return 2;
        paint();
        from = now();
        const int status = wbc_step(c, q, v);
        const uint32_t spent = between(from, now()), used = deepest();
        if (used > deep) deep = used;
        printf("%d %lu", status, (unsigned long)spent);
        for (int i = 0; i < WBC_NV; i++) printf(" %.17g", (double)wbc_last(c)->v[i]);
        printf("\n");
    }
    printf("memory %lu stack %lu\n", (unsigned long)sizeof memory, (unsigned long)deep);
    fclose(file);
    return 0;
}
