/* One control cycle of a robot: configuration in, joint velocities out. Generated; the robot, its tasks and constraints
 * and their initial values are below.
 *
 *     static wbc_memory memory;
 *     wbc_controller *c = wbc_init(&memory);
 *     ...
 *     if (wbc_step(c, q, NULL) >= 0) send(wbc_last(c)->v);
 *
 * SI units: m, rad, s. Nothing here allocates memory or keeps state outside of `memory`: two controllers are two of
 * these, and different threads may use different ones at once. Link with the daqp library and -lm.
 */
#ifndef WBC_PUBLIC_TICK_H
#define WBC_PUBLIC_TICK_H

#ifdef __cplusplus
extern "C" {
#endif

/* The numbers of this interface; with WBC_SINGLE, which all parts of a build must share, float */
#ifdef WBC_SINGLE
typedef float wbc_real;
#else
typedef double wbc_real;
#endif

@SIZES@

/* Status of a step. Negative: the arguments were refused and nothing was changed. */
#define WBC_SOLVED 0      /* every constraint row holds, v is the optimum */
#define WBC_RELAXED 1     /* rows could not all hold: some gave way in the declared order, see `slack` */
#define WBC_BRAKED 2      /* numbers are not finite, or bounds leave no interval: v brings joints to rest as bounds allow */
#define WBC_CAPPED 3      /* wbc_set_iteration_cap ended the search: v keeps the bounds, between braking and the best */
#define WBC_RECOVERED 4   /* the first answer had no certificate, that of a search from no active set has: constraints
                           * hold or have given way as `slack` says */
#define WBC_UNCERTIFIED 8 /* neither had one: v brings every joint to rest as fast as its bounds allow */
#define WBC_BAD_Q (-1)    /* q holds NaN or infinity */
#define WBC_BAD_UNIT (-2) /* a quaternion or a (cos, sin) pair in q is not of unit length */
#define WBC_BAD_V (-3)    /* v holds NaN or infinity */
#define WBC_BAD_VALUE (-4) /* of a function that sets a value: out of its range, nothing was changed */

@ROBOT@

/* Places of the run-time values
 *
 *     WBC_P_ITEM_INPUT   first number of an input in wbc_inputs()
 *     WBC_TASK_ITEM      first row of a task in wbc_weights(), `error` and `factor`; WBC_TASK_ITEM_ROWS of them
 *     WBC_ROW_ITEM       first row of a constraint in wbc_rows_enabled(), `slack`, and behind the bounds in `lambda`
 *     WBC_MARGIN_ITEM    its first row in `margin`, `margin_factor` and `ahead`
 *     WBC_BOUND_ITEM     first entry of a bound in wbc_bounds_enabled(), one for each degree of freedom
 *
 * Inputs marked SENSED describe the nearest points of pairs of bodies that no formula states (meshes): for pair r
 *     distance[r]        signed distance of bodies A and B [m]; 1000 where there is no pair
 *     drift[r]           its rate by what moves without the robot [m/s]
 *     line[6 r ... ]     (n, p x n): n the unit normal from A to B, p a point of the line through both nearest points, in
 *                        the world
 *     side[WBC_NV r ...] 1 where a degree of freedom moves B only, -1 where A only, else 0
 * Without a measurement they stay as they were at the export.
 */
@PLACES@

/* What the last step reports */
typedef struct {
@RESULT@
} wbc_result;

/* Memory of one controller; its contents are private */
typedef union {
    double number;
    long long whole;
    void *place;
    unsigned char bytes[WBC_BYTES];
} wbc_memory;

typedef struct wbc_controller wbc_controller;

/* Make a controller in `memory`, with the values of the export and at rest */
wbc_controller *wbc_init(wbc_memory *memory);

/* Start anew: the last command becomes v (NULL: zero), and the solver forgets what it knows */
void wbc_reset(wbc_controller *c, const wbc_real *v);

/* One cycle at configuration q. v: a measured velocity that acceleration bounds are counted from, or NULL for the last
 * command. Returns the status; a command is certified unless it is WBC_BRAKED, WBC_CAPPED or WBC_UNCERTIFIED. Takes about
 * twice as long where the first answer has no certificate. */
int wbc_step(wbc_controller *c, const wbc_real *q, const wbc_real *v);

/* The report of the last step; it lies in the controller and changes with the next one */
const wbc_result *wbc_last(wbc_controller *c);

/* Run-time inputs, WBC_NP numbers that may be written between steps. They are not checked: a rotation must be one, and
 * a rate times dt lies in (0, 1]. Numbers that are not finite make the step brake. */
wbc_real *wbc_inputs(wbc_controller *c);

/* Weight of every task row >= 0, scales of rows and units included; 0 switches a row off */
wbc_real *wbc_weights(wbc_controller *c);

/* The same for a task: weight is what the stack calls so. 0 or WBC_BAD_VALUE. */
int wbc_set_weight(wbc_controller *c, int first, int rows, wbc_real weight);

/* 1 or 0 for every constraint row, and for every degree of freedom of every bound */
wbc_real *wbc_rows_enabled(wbc_controller *c);
wbc_real *wbc_bounds_enabled(wbc_controller *c);

/* Time between this command and the next [s]. 0 or WBC_BAD_VALUE. */
int wbc_set_dt(wbc_controller *c, wbc_real dt);

/* Iterations of the QP solver a step may take, 0 for as many as it needs: keeps a deadline. 0 or WBC_BAD_VALUE. */
int wbc_set_iteration_cap(wbc_controller *c, int cap);

/* out = q (+) v dt, the configuration after v has been held for dt; out may be q. For simulations. */
void wbc_integrate(wbc_controller *c, const wbc_real *q, const wbc_real *v, wbc_real dt, wbc_real *out);

#ifdef __cplusplus
}
#endif

#endif
