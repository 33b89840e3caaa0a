/* The tick together with inverse kinematics, which needs a clock */
#include "library.c"

#include "converge.h"
