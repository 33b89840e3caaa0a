/* What a process loads: the tick, and many ticks in one call */
#include "tick.c"

#include "many.h"
