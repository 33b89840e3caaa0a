/* One control cycle: rows from CasADi, QP, solution, certificate. No allocation, no global state.
 *
 * The sizes and tables that this file uses are in "stack.h", which is generated for one stack:
 *   NQ NV NP    configuration, variables of the QP, parameters
 *   DOFS        the first of the variables are velocities; the others are shares of scaled tasks, see soft.py
 *   MT MC NB MH task rows, general constraint rows, bound blocks, margin rows (arrays have at least one entry)
 *   NNZJ NNZA   structural non-zeros of task rows and of general rows
 *   j_start j_col a_start a_end a_col   their positions, row by row
 *   damping     cost of each velocity
 *   CALM        0: the linear model as it is
 *   ELASTIC     1: limits of motion are rows, and they and what is held give way at prices
 *   COMMAND     0: velocities, 1: accelerations, 2: torques; of the last two the variables are accelerations and the
 *               wrenches of contacts
 *   NNZK k_row k_col   entries of the curvature's upper triangle
 *   HANDED HANDED_TO_LOST HANDED_TO_TORQUE   numbers that the rows hand to the curvature, to what bends, and to torques; without
 *               curvature, and with -1, the rows have no such output
 *   REDUCED     rows of loops, and of torques that nothing gives, which are taken out of the QP, see reduced.h; 0 without loops
 *   REDUCED_NV  NV with such rows, else 0
 *   FORCES FORCED_NV FORCE_FIRST row_torque   forces in loops, one a row of them, NV with such, else 0, and the first among the
 *               variables; the joint whose torque each general row is that nothing gives (-1)
 *   give_order late_row   in which order they give velocities or accelerations, and which rows have forces, so that they give after
 *               the others
 *   SPARED spare_first spare_row spare_held   linkages whose rows depend on each other wherever loops are closed: their rows one after
 *               the other, and how many are independent, see spare.h
 *   CLOSING CLOSING_FIRST   rows of couplings and loops of a stack of accelerations whose loops a tick closes, and the first of them
 *               among the general rows; 0 without loops
 *   BENDING bent   general rows whose residual bends within a tick, and which they are: see bend.h
 *   margin_at rate_at   margin of each general row (-1: none), and where its rate is in p
 *   gain_at     where the gain of each task row is in p
 *   force_scale  how much curvature a row of unit error may have
 *   brake_at brake_limit   entry of bound_enabled that limits the acceleration of a velocity (-1: none), and the limit
 *   row_order   class of each general row in the order of sacrifice
 *   PRICES price_at   whether rows are soft at a price; where the price of each general row is in p (-1: it has none)
 *   SOFT_ROWS   how many of them the first level's QP has: none where there are strict levels
 *   KEPT kept_of   whether tasks of the first level keep directions; the row of such a task for each row that does (-1)
 *   slack_reported  violation of a soft row from which on it is reported
 *   row_scale   its unit: the characteristic length for rows in metres
 *   BALLS SEGMENTS   items whose rows are distances between a ball and segments of links, and those segments
 *   ball_pose ball_velocity ball_margin ball_rate   where their inputs are in p
 *   ball_row ball_first   their first general row; their first entry in row_segment and row_reach, and the end
 *   row_segment row_reach   segment of such a row, and its thickness together with the ball's
 *   segment_half segment_row   half a segment's length, and a row whose entries are the joints that move it
 *   SENSED sensed_row sensed_count   items with sensed rows, their first such row, and how many there are
 *   sensed_distance sensed_line sensed_side   where their numbers are in p
 *   LONGEST     the largest unit of velocities and rows, at least 1
 *   FAR         a distance of no pair [m]
 *   LEADING     task rows of the first level, which come first
 *   LEVELS      strict levels, 0 where all is one problem; with them:
 *   level_start row_level   their task rows, and the level of each general row that is minimised (-1: hard)
 *   task_scale  the unit of each task row
 *   LEVEL_NUMBERS LEVEL_MOST SOFT_MAX   numbers reported of each; rows and minimised general rows of one at most
 *   LEFT_FREE DAMPING   singular values below it are left to later levels; damping of one that is 0
 *   SLEWED slewed_at slewed_dof   torques that may change only so fast: where p has the last one, degree of freedom
 *   stop_at stop_q stop_low stop_high   the same for position limits, with the coordinate that is limited
 *   stop_row    the general row of position limits that may give way (-1: none)
 */
#ifndef WBC_TICK_H
#define WBC_TICK_H

#include "stack.h"
#include "daqp/api.h"

#define M_ALL (NV + MC)
#define WIDE ((NV + 7) / 8 * 8)
#define TALL ((NV + 3) / 4 * 4)
/* Rows of loops that a tick closes, in groups of four */
#define CLOSING_ROOM ((CLOSING + 3) / 4 * 4)
#define PACKED (NV * (NV + 1) / 2)
#define WBC_INF 1e30

#include "memory.h"

/* Flags of a tick. Negative: the inputs were refused and nothing was changed. */
#define WBC_SOLVED 0
#define WBC_RELAXED 1
#define WBC_BRAKED 2
#define WBC_CAPPED 3
/* Of wbc_tick_safe_step: what the step led to had no certificate, and a search from no active set led to one that has, or
 * had none either and every joint brakes */
#define WBC_RECOVERED 4
#define WBC_UNCERTIFIED 8
/* Added to what wbc_tick_step returns: the certificate fails, or there is no answer although all numbers are fit */
#define WBC_UNSOUND 4
#define WBC_BAD_Q (-1)
#define WBC_BAD_UNIT (-2)
#define WBC_BAD_V (-3)

#if LEVELS > 0
/* What the levels of a tick work with; vectors are of v / dof_scale, rows per unit */
typedef struct {
    double x[NV], reached[(LEVELS + 1) * NV];   /* the point, and that of every level */
    double low[M_ALL], high[M_ALL], given_low[M_ALL], given_high[M_ALL], general[MC * NV + 1];
    int on[M_ALL], soft[M_ALL];                 /* rows that hold; rows that are minimised */
    double space[NV * NV];                      /* what is left: `width` orthonormal vectors */
    double basis[NV * NV], direction[NV * NV];  /* the same turned: the `rank` that the level takes come first */
    double row[LEVEL_MOST * NV], weight[LEVEL_MOST], wanted[NV], scale;
    double give[M_ALL];                         /* of rows that are minimised: by how much they give way per multiplier */
    double column[NV * LEVEL_MOST], damped[NV], least; /* rows along the directions */
    double H[NV * NV], inverse[NV * NV], right[NV], plain[NV], lambda[M_ALL], length[M_ALL];
    double force[M_ALL];                        /* multipliers, those in it that do not count as pushing */
    double curvature[NV * NV];                  /* of the first level */
    int curved, seen;                           /* whether there is any; directions that the rows take */
    int width, rank, count, order[LEVEL_MOST];
    int keep[(LEVELS + 1) * M_ALL], warm[LEVELS + 1];
    DAQPWorkspace daqp;
    DAQPProblem problem;
    double M[M_ALL * NV], dupper[M_ALL], dlower[M_ALL], shift[NV], scaling[M_ALL], soft_scaling[M_ALL];
    double z[NV], old[NV], u[NV];
    double lam[NV + SOFT_MAX + 2], lam_star[NV + SOFT_MAX + 2];
    double factor[(NV + SOFT_MAX + 2) * (NV + SOFT_MAX + 3) / 2], pivot[NV + SOFT_MAX + 2];
    double xldl[NV + SOFT_MAX + 2], zldl[NV + SOFT_MAX + 2];
    int WS[NV + SOFT_MAX + 2], sense[M_ALL];
} wbc_levels;
#endif

typedef struct {
    WBC_BUFFERS                  /* what the caller knows: see memory.h, which is generated */
    int lost_known;              /* `lost_there` is what rows lose at the velocity `lost_of` */
    double lost_of[NV], lost_there[MC + 1];
    int prepared;                /* R is the factor of H, and y its right-hand side */
    int curved;                  /* H contains curvature */
    double eased;                /* room that exact rows have, see ease.h */
    int firm;                    /* rows that keep directions, or bend, are firm in R */
    double stiffness;            /* what fixed variables add to the Hessian, in units of dof_scale */
    double curvature_entries[NNZK + 1]; /* of its upper triangle */
    int idle[MC + 1];            /* rows that no velocity within the bounds violates */
    int left_out[MC + 1];        /* rows of linkages that depend on others, and their sides */
    double left_side[MC + 1];
    int far[MC + 1];             /* rows of balls and sensed pairs that are left out of this tick */
    double segment[6 * SEGMENTS + 1], screw[6 * NV], segment_ahead[6 * SEGMENTS + 1];
    double q_good[NQ + 1];       /* q of the last tick that was not refused, put back by one that is */
    /* outputs of the generated rows; `handed` is for the curvature, the others for what bends, and torques */
    double handed[HANDED + 1], handed_to_lost[HANDED_TO_LOST + 2], handed_to_torque[HANDED_TO_TORQUE + 2];
    double jt[NNZJ + 1], at[NNZA + 1], bound_low[NB * NV + 1], bound_high[NB * NV + 1];
    /* factorisation */
    double R[TALL * WIDE], inverse[TALL * WIDE], inverse_diagonal[TALL], y[WIDE];
    double scratch[WIDE], product[WIDE];
    double strength[MC + 1];                    /* what equality rows and soft rows add to the factor, per a a' */
#if SOFT_ROWS > 0
    double loose[MC + 1];                       /* the same of what `strength` leaves of its price */
    double soft_scaling[M_ALL], own_H[NV * WIDE], own_g[WIDE];
    int held[MC + 1], melted[MC + 1];           /* soft rows that are violated, and those in H: see soft.h */
    int later[MC + 1];                          /* soft rows that are held from the next tick on */
    int settled;                                /* `strength` is that of the search, not that of the curvature */
#endif
    double work_w[WORK_W + 1];
    long long work_iw[WORK_IW + 1];
    int warm;                    /* the sense array holds the active set of the last tick */
    int spent;                   /* the cap has ended a search of this tick */
    double met[NV];              /* where the classes of a relaxation met */
    double spring[MC + 1];       /* price of an equality row that a relaxation has made a part of H; 0 for the others */
    double elastic[MC + 1];      /* by how much a relaxation lets a row give way per multiplier; 0 for the others */
    double firm_missed;          /* the largest violation of a row that never gives way */
    int proven;                  /* nothing within the bounds keeps the rows that never give way */
    int brief;                   /* iterations of a search that may fail; 0: as many as it takes */
    int alone;                   /* no row binds: R^-1 is all that a refinement needs */
    int factored;                /* R inverse and M of the last tick are in the workspace */
    /* The problem without its equality rows, see reduced.h */
    int reduced;                 /* how many rows there are; 0 where all variables are those of the problem */
    int whole;                   /* it has been tried, and the problem is one for all variables */
    int width;                   /* variables that are left */
    int equal_row[NV], given[NV], left[NV], is_given[NV]; /* rows, the variables that they give, the others */
    /* The same where forces in loops follow by the transposed of the loops' rows, see mirrored.h: slots of rows of torques by joint,
     * those of joints that were not given, and what they give of the motions that rows of loops leave */
    int mirrored, torque_slot[NV], rest, rest_slot[NV], moved[NV], is_moved[NV];
    double second[FORCED_NV * WIDE + 1], lifted[FORCED_NV * WIDE + 1];
    double missed[NV], missed_size[NV]; /* by how much the command misses the rows, and the size of what was added up */
    double equal[REDUCED_NV * WIDE + 1], equal_scale[NV];
    double basis[REDUCED_NV * WIDE + 1], product_of_basis[REDUCED_NV * WIDE + 1], through[REDUCED_NV * WIDE + 1];
    /* Loops at the end of the tick, see arrive.h: by how much they are open, their rows by columns, and the factor of these */
    int arrived;                 /* `next_q` and `next_v` are those of the command */
    double opened[CLOSING + 1], closing_columns[NV * CLOSING_ROOM + 1];
    double closing_factor[2 * CLOSING * CLOSING_ROOM + 1], closing_inverse[CLOSING + 1];
    double gram[REDUCED_NV * WIDE + 1], reduced_R[REDUCED_NV * WIDE + 1], reduced_inverse[REDUCED_NV * WIDE + 1];
    double seen[REDUCED_NV * M_ALL + 1];
    /* DAQP workspace on our own memory */
    DAQPWorkspace daqp;
    DAQPProblem problem;
    DAQPSettings settings;
    double Rinv[PACKED], M[MC * NV + 1], dupper[M_ALL], dlower[M_ALL], ldp_v[WIDE], scaling[M_ALL];
    double x[WIDE], xold[NV], lam[ACTIVE_MAX], lam_star[ACTIVE_MAX], u[NV];
    double L[ACTIVE_MAX * (ACTIVE_MAX + 1) / 2], D[ACTIVE_MAX], xldl[ACTIVE_MAX], zldl[ACTIVE_MAX];
    int WS[ACTIVE_MAX], sense[M_ALL], keep[M_ALL];
#if LEVELS > 0
    double straight[NV * WIDE];  /* H without curvature */
    double curvature[NV * NV];   /* and the curvature, before anything made H positive definite */
    wbc_levels levels;
#endif
} wbc_tick;

#endif
