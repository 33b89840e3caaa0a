/* What a process loads: the tick, values from Python, and many ticks in one call */
#include "tick.c"

#include "builtins.h"
#include "many.h"
