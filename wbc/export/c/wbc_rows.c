/* The rows that CasADi wrote. Its functions share one signature, of which some use a part. */
#include "names.h"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#include "tick/rows.c"
