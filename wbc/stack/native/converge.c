/* The tick together with inverse kinematics, which needs a clock */
#include "tick.c"

#include "converge.h"
