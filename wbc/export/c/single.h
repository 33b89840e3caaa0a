/* The tick in single precision: what -DWBC_SINGLE puts before all of it, see docs/export.md.
 *
 * The cycle and the generated rows say `double` throughout, and a build of them in single precision says `float` instead:
 * by the preprocessor, after every header of the C library has been read, so that one text makes both builds and the one in
 * double precision is not touched. So do
 * the functions of libm (newlib has no <tgmath.h> that compiles), and with gcc's -fsingle-precision-constant the constants,
 * which is faster where a processor has no unit for double precision. */
#ifndef WBC_SINGLE_H
#define WBC_SINGLE_H

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

/* Where single precision is not enough */
typedef double wbc_wide;
#define WIDE_EPS (0.5L * __DBL_EPSILON__)

#define double float
#define fabs(x) fabsf(x)
#define sqrt(x) sqrtf(x)
#define sin(x) sinf(x)
#define cos(x) cosf(x)
#define tan(x) tanf(x)
#define asin(x) asinf(x)
#define acos(x) acosf(x)
#define atan(x) atanf(x)
#define sinh(x) sinhf(x)
#define cosh(x) coshf(x)
#define tanh(x) tanhf(x)
#define asinh(x) asinhf(x)
#define acosh(x) acoshf(x)
#define atanh(x) atanhf(x)
#define exp(x) expf(x)
#define log(x) logf(x)
#define log10(x) log10f(x)
#define log1p(x) log1pf(x)
#define expm1(x) expm1f(x)
#define erf(x) erff(x)
#define floor(x) floorf(x)
#define ceil(x) ceilf(x)
#define atan2(x, y) atan2f(x, y)
#define fmin(x, y) fminf(x, y)
#define fmax(x, y) fmaxf(x, y)
#define fmod(x, y) fmodf(x, y)
#define pow(x, y) powf(x, y)
#define hypot(x, y) hypotf(x, y)
#define copysign(x, y) copysignf(x, y)
#undef DBL_MAX
#undef DBL_MIN
#define DBL_MAX FLT_MAX
#define DBL_MIN FLT_MIN
/* DAQP's own word for it; the library must be built with the same */
#ifndef DAQP_SINGLE_PRECISION
#define DAQP_SINGLE_PRECISION
#endif

/* Four numbers are 16 bytes */
typedef int wbc_bits;
#define MOST_BITS INT_MAX

/* Tolerances of the cycle, which tick/settings.h explains: multiples of the rounding of a float. What DAQP leaves of its
 * sides is some hundred roundings of the largest term that was added up; where a tolerance of the build in double precision
 * is far above its rounding, it is the same or the square root of the ratio of both roundings larger. */
#define EPS (0.5f * FLT_EPSILON)
#define DEPENDENT (64.0f * EPS)
#define TIGHT (256.0f * EPS)
#define LOOSE (4096.0f * EPS)
#define DEAD 1e-12f
#define RHO 1e-4f
#define SETTLED (64.0f * EPS)
#define FIRMLY (256.0f * EPS)
#define PUSHING 1e-4f
#define CLEAR_PIVOT 1e-1f
#define PIVOT 1e-2f
#define REDUCES 0
#define QUICK_BOUND 1e-3f
#define GOOD_BOUND 1e-3f
#define GOOD_VIOLATION (256.0f * EPS)
#define UNIT_TOLERANCE 2e-5f
#define TOLERANCE (64.0f * EPS)
#define SOUND (2048.0f * EPS)
#define KNOWN 1e-2f
#define OPTIMAL (1024.0f * EPS)
#define SEEN (1024.0f * EPS)
#define TOO_FAR 1e15f
/* Those of DAQP: violation of a side, sign of a multiplier, zero, pivot, progress */
#define SEARCH_SETTINGS(s) \
    ((s).primal_tol = 32.0f * EPS, (s).dual_tol = 16.0f * EPS, (s).zero_tol = 16.0f * EPS, (s).pivot_tol = 1e-3f, \
     (s).progress_tol = 16.0f * EPS)

#endif
