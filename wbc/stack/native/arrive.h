/* Where accelerations lead until the next tick: loops are closed there, and the velocity keeps them closed. docs/robots.md */
#ifndef WBC_ARRIVE_H
#define WBC_ARRIVE_H

#include "bend.h"

#if COMMAND != VELOCITY

/* Newton steps at most, and how often joints are left out of them as they would pass their bounds */
#define CLOSING_STEPS 8
#define CLOSING_TRIES 4
/* What corrections of configurations within a tick come to at most [characteristic lengths or rad per second], with a share of the
 * fastest joint's way: linkages near dead points bend fast. Loops open by more are closed by their rows */
#define CLOSING_SPEED 0.1
#define CLOSING_SHARE 0.1
/* Torques are off by what loops are open by, more so where forces in loops are so many times their units: near dead points of
 * motors. A last correction closes them to rounding there, but where loops branch and it opens them */
#define LARGE_FORCE 10.0
/* Loops that were closed where a tick begins that is not solved are closed by as much as the fastest joint's way */
#define WHOLE_SHARE 1.0
/* And those of velocities */
#define BENT_SPEED 1.0
/* Rows whose square without those before is below this share of it depend on them: where loops branch */
#define DEPENDENT_SQUARE 1e-12
/* How often accelerations are looked for whose velocities keep loops closed within the bounds */
#define ARRIVALS 8
/* Velocities are made to keep loops closed to so much [rad, or characteristic lengths, per second], by so many corrections at most: the
 * squares of rows lose half of the digits */
#define ROUNDED_RATE 1e-13
#define PROJECTIONS 3
/* Velocities that open loops by more do not keep them closed [rad, or characteristic lengths, per second] */
#define OPEN_RATE 1e-9
/* The share of a bound that accelerations may pass it by, by rounding */
#define ROUNDED_BOUND 1e-9

/* The velocity at the end of the tick, and the mean one until then, of accelerations that are held */
static void follow(wbc_tick *t, double *way) {
    for (int i = 0; i < DOFS; i++) {
        t->report.next_v[i] = t->v_last[i] + t->dt * t->report.v[i];
        way[i] = t->v_last[i] + 0.5 * t->dt * t->report.v[i];
    }
}

#if CLOSING > 0

/* Groups of four numbers of a column of the loops' rows: all of them, as their number is known to the compiler */
#define EACH_FOUR(at) for (int at = 0; at < CLOSING_ROOM; at += 4)

/* J W J' = L D L': L by columns, then by rows, and 1 / D, which is 0 of rows that are left out, or depend on those before. W is `ease` */
static void factor_closing(wbc_tick *t, const double *ease) {
    double *columns = t->closing_factor, *rows = columns + CLOSING * CLOSING_ROOM, square[CLOSING + 1];
    for (int c = 0; c < CLOSING; c++) {
        four sums[CLOSING_ROOM / 4 + 1];
        EACH_FOUR(at) sums[at / 4] = (four){0};
        /* The row has entries of its own linkage alone */
        const int first = a_start[CLOSING_FIRST + c], end = a_end[CLOSING_FIRST + c];
        for (int e = first; e < end; e++) {
            const double *joint = t->closing_columns + a_col[e] * CLOSING_ROOM;
            const four each = EACH(ease[a_col[e]] * joint[c]);
            EACH_FOUR(at) sums[at / 4] = MADD(each, GIVEN_FOUR(joint + at), sums[at / 4]);
        }
        EACH_FOUR(at) FOUR(columns + c * CLOSING_ROOM + at) = sums[at / 4];
        EACH_FOUR(at) FOUR(rows + c * CLOSING_ROOM + at) = (four){0};
        square[c] = columns[c * CLOSING_ROOM + c];
    }
    for (int c = 0; c < CLOSING; c++) {
        double *own = columns + c * CLOSING_ROOM;
        const int counts = own[c] > DEPENDENT_SQUARE * square[c] && !t->left_out[CLOSING_FIRST + c];
        const double inverse = t->closing_inverse[c] = counts ? 1.0 / own[c] : 0.0;
        for (int r = c + 1; r < CLOSING; r++) {
            const double share = rows[r * CLOSING_ROOM + c] = own[r] * inverse;
            double *other = columns + r * CLOSING_ROOM;
            if (share == 0.0) continue;
            EACH_FOUR(at) FOUR(other + at) -= EACH(share) * GIVEN_FOUR(own + at);
        }
        EACH_FOUR(at) {
            const four_bits behind = PLACES(at) > (four_bits){c, c, c, c};
            FOUR(own + at) = (four)((four_bits)(EACH(inverse) * GIVEN_FOUR(own + at)) & behind);
        }
    }
}

/* The shortest change of joints that changes the rows by -e, which is changed */
static void shortest_change(const wbc_tick *t, const double *ease, double *e, double *change) {
    const double *columns = t->closing_factor, *rows = columns + CLOSING * CLOSING_ROOM;
    for (int c = 0; c < CLOSING; c++)
        EACH_FOUR(at) FOUR(e + at) -= EACH(e[c]) * GIVEN_FOUR(columns + c * CLOSING_ROOM + at);
    for (int c = 0; c < CLOSING; c++) e[c] *= t->closing_inverse[c];
    for (int c = CLOSING - 1; c > 0; c--)
        EACH_FOUR(at) FOUR(e + at) -= EACH(e[c]) * GIVEN_FOUR(rows + c * CLOSING_ROOM + at);
    for (int j = 0; j < DOFS; j++) {
        four sum = {0};
        EACH_FOUR(at) sum = MADD(GIVEN_FOUR(t->closing_columns + j * CLOSING_ROOM + at), GIVEN_FOUR(e + at), sum);
        change[j] = -ease[j] * SUM_OF_FOUR(sum);
    }
}

/* e = J v; the largest of rows that corrections have, in units of rows */
static double open_rate(const wbc_tick *t, const double *v, double *e) {
    double most = 0.0;
    EACH_FOUR(at) {
        four sum = {0};
        for (int j = 0; j < DOFS; j++) sum = MADD(GIVEN_FOUR(t->closing_columns + j * CLOSING_ROOM + at), EACH(v[j]), sum);
        FOUR(e + at) = sum;
    }
    for (int k = 0; k < CLOSING; k++)
        if (t->closing_inverse[k] != 0.0) most = larger(most, fabs(e[k]) / row_scale[CLOSING_FIRST + k]);
    return most;
}

/* Where `way` leads from a configuration, what the loops are open by there, and their rows; the largest that they are open by */
static double arrive_at(wbc_tick *t, const double *from, const double *way) {
    const double *arg[4] = {from, way, t->p, &t->dt};
    double *res[3] = {t->report.next_q, t->opened, t->closing_columns}, most = 0.0;
    arrival(arg, res, t->work_iw, t->work_w, 0);
    for (int k = 0; k < CLOSING; k++) {
        t->report.lost[CLOSING_FIRST + k] = t->opened[k];
        most = larger(most, fabs(t->opened[k]) / row_scale[CLOSING_FIRST + k]);
        if (!isfinite(t->opened[k])) return WBC_INF;
    }
    return most;
}

/* Adds a change to their sum; whether that stays below `most` of each */
static int adds(const double *change, double *sum, double most) {
    int within = 1;
    for (int i = 0; i < DOFS; i++) {
        sum[i] += change[i];
        within &= fabs(sum[i]) <= most * dof_scale[i];
    }
    return within;
}

/* The change of joints that closes what loops are open by, within the tick as a velocity; its sum with those before is within `most` */
static int closing_way(wbc_tick *t, const double *ease, double *sum, double most, double *way) {
    double e[CLOSING_ROOM + 1] = {0};
    memcpy(e, t->opened, CLOSING * sizeof(double));
    shortest_change(t, ease, e, way);
    const int within = adds(way, sum, most * t->dt);
    for (int i = 0; i < DOFS; i++) way[i] /= t->dt;
    return within;
}

/* Whether forces in loops, or of contacts, are large */
static int forces_large(const wbc_tick *t) {
    int large = 0;
    for (int i = DOFS; i < NV; i++) large |= fabs(t->report.v[i]) > LARGE_FORCE * dof_scale[i];
    return large;
}

/* Closes loops to EXACT by the shortest change of joints in the metric `ease`, 0 of joints that are held; where some are held, loops may
 * stay open by 2 EASED. Then `v` becomes the nearest velocity that keeps them closed. 0 where that takes larger corrections than there
 * may be. The factor is that of the rows before the last step: what that leaves is of second order. */
static int close_there(wbc_tick *t, const double *way, const double *ease, double share, double *v) {
    double from[NQ + 1], e[CLOSING_ROOM + 1] = {0}, change[NV], sum[NV] = {0};
    double fastest = 0.0, off = arrive_at(t, t->q, way);
    int held = 0;
    for (int i = 0; i < DOFS; i++) {
        fastest = larger(fastest, fabs(way[i]) / dof_scale[i]);
        held |= ease[i] == 0.0;
    }
    const double most = CLOSING_SPEED + share * fastest;
    const double most_open = held ? 2.0 * EASED : EXACT;
    const double most_rate = held ? larger(OPEN_RATE, 2.0 * room_of(t, EASED) * t->dt) : OPEN_RATE;
    factor_closing(t, ease);
    for (int n = 0; n < CLOSING_STEPS && off > EXACT; n++) {
        if (n > 0) factor_closing(t, ease);
        if (!closing_way(t, ease, sum, most, change)) return 0;
        memcpy(from, t->report.next_q, NQ * sizeof(double));
        off = arrive_at(t, from, change);
    }
    if (!(off <= most_open)) return 0;
    if (forces_large(t) && closing_way(t, ease, sum, most, change)) {
        const double rest[NV] = {0};
        memcpy(from, t->report.next_q, NQ * sizeof(double));
        if (!(arrive_at(t, from, change) <= most_open)) arrive_at(t, from, rest);
    }
    for (int i = 0; i < DOFS; i++) sum[i] = 0.0;
    double rate = open_rate(t, v, e);
    for (int n = 0; n <= PROJECTIONS && rate > (n < PROJECTIONS ? ROUNDED_RATE : most_rate); n++) {
        /* Next to where loops branch rows turn so fast that those before the last step are too far off */
        if (n == PROJECTIONS) factor_closing(t, ease);
        shortest_change(t, ease, e, change);
        if (!adds(change, sum, larger(BENT_SPEED, share < WHOLE_SHARE ? 0.0 : fastest))) return 0;
        for (int i = 0; i < DOFS; i++) v[i] += change[i];
        rate = open_rate(t, v, e);
    }
    return rate <= most_rate;
}

/* By how much a number passes an end that the command keeps, or passes it by more than the command; 0 by rounding */
INLINE double passes(double low, double high, double command, double number, double rounding) {
    const double over = larger(number - larger(high, command), smaller(low, command) - number);
    return over > rounding ? over : 0.0;
}

/* By how much an acceleration, or what a row makes of it, passes bounds that are so large */
INLINE double passes_bounds(double low, double high, double command, double number) {
    return passes(low, high, command, number, ROUNDED_BOUND * (1.0 + fabs(command)));
}

/* By how much joint i has another acceleration than its bounds allow, and is beyond its limits of position by more than `rounding`:
 * the acceleration that leads there within a tick */
static double joint_passes(const wbc_tick *t, const double *v, int i, double rounding) {
    const double command = t->report.v[i], over = passes_bounds(t->low[i], t->high[i], command, (v[i] - t->v_last[i]) / t->dt);
    const int bound = stop_at[i] >= 0 && t->bound_enabled[stop_at[i]] != 0.0;
    const int row = stop_row[i] >= 0 && t->enabled[stop_row[i]] != 0.0;
    if (!bound && !row) return over;
    const double place = t->q[stop_q[i]] + t->dt * (t->v_last[i] + 0.5 * t->dt * command);
    const double beyond = passes(stop_low[i], stop_high[i], place, t->report.next_q[stop_q[i]], rounding);
    return larger(over, 2.0 * beyond / (t->dt * t->dt));
}

/* By how much a row of one joint alone is passed */
static double row_passes(const wbc_tick *t, const double *v, int k) {
    const int i = a_col[a_start[k]];
    if (a_end[k] - a_start[k] != 1 || i >= DOFS) return 0.0;
    const double factor = t->at[a_start[k]], a = (v[i] - t->v_last[i]) / t->dt;
    return passes_bounds(t->free_low[k], t->free_high[k], factor * t->report.v[i], factor * a);
}

/* Joints that would pass bounds of acceleration, rows of them alone, or limits of position are held from now on; whether there are
 * any */
static int hold_beyond(const wbc_tick *t, const double *v, double *ease) {
    int more = 0, held[DOFS];
    for (int i = 0; i < DOFS; i++) held[i] = joint_passes(t, v, i, 0.0) > 0.0;
    for (int k = 0; k < MC; k++)
        if (row_passes(t, v, k) > 0.0) held[a_col[a_start[k]]] = 1;
    for (int i = 0; i < DOFS; i++) {
        more |= held[i] && ease[i] != 0.0;
        if (held[i]) ease[i] = 0.0;
    }
    return more;
}

/* Limits that closed loops pass give way */
static void report_passed(wbc_tick *t) {
    int gave_way = 0;
    for (int i = 0; i < DOFS; i++) {
        const double over = joint_passes(t, t->report.next_v, i, OPENED);
        t->report.beyond[i] = larger(t->report.beyond[i], over);
        gave_way |= over > 0.0;
    }
    for (int k = 0; k < MC; k++) {
        const double over = row_passes(t, t->report.next_v, k);
        t->report.slack[k] = larger(t->report.slack[k], over);
        gave_way |= over > 0.0;
    }
    if (gave_way) t->report.flag = WBC_RELAXED;
}

/* The same, where `within`, with joints at their bounds held; 0 where the loops cannot be closed so */
static int closes(wbc_tick *t, const double *way, double share, int within) {
    double v[NV], ease[NV];
    for (int i = 0; i < DOFS; i++) ease[i] = dof_scale[i] * dof_scale[i];
    for (int n = 0; n < CLOSING_TRIES; n++) {
        memcpy(v, t->report.next_v, DOFS * sizeof(double));
        if (!close_there(t, way, ease, share, v)) return 0;
        if (within && hold_beyond(t, v, ease)) continue;
        memcpy(t->report.next_v, v, DOFS * sizeof(double));
        return 1;
    }
    return 0;
}

/* What corrections may come to as a share of the way: for loops that are closed where the tick begins */
static double closing_share(wbc_tick *t) {
    double rest[NV] = {0};
    return arrive_at(t, t->q, rest) <= 10.0 * EXACT ? CLOSING_SHARE : 0.0;
}

/* Whether the command leads to where loops are closed within the bounds */
static int arrives_within(wbc_tick *t) {
    double way[NV];
    follow(t, way);
    if (closes(t, way, 0.0, 1)) return 1;
    const double share = closing_share(t);
    return share > 0.0 && closes(t, way, share, 1);
}

/* Rows of loops that were closed where the tick begins and are not where it leads give way, by accelerations */
static void report_open(wbc_tick *t) {
    for (int k = 0; k < CLOSING; k++) {
        if (fabs(t->opened[k]) <= 10.0 * EXACT * row_scale[CLOSING_FIRST + k]) continue;
        t->report.slack[CLOSING_FIRST + k] = 2.0 * fabs(t->opened[k]) / (t->dt * t->dt);
        t->report.flag = WBC_RELAXED;
    }
}

/* Sides of the rows of loops that are held, moved so that the velocity at the end of the tick keeps loops closed where the command
 * leads; 0 where it does not lead there */
static int bend_arrival(wbc_tick *t) {
    double way[NV], v[NV], rate[CLOSING_ROOM + 1];
    follow(t, way);
    memcpy(v, t->report.next_v, DOFS * sizeof(double));
    if (!closes(t, way, closing_share(t), 0)) return 0;
#if SOFT_ROWS > 0
    unmelt(t);
#endif
    open_rate(t, v, rate);
    for (int k = 0; k < CLOSING; k++) {
        if (t->free_low[CLOSING_FIRST + k] != t->free_high[CLOSING_FIRST + k]) continue;
        t->free_low[CLOSING_FIRST + k] -= rate[k] / t->dt;
        t->free_high[CLOSING_FIRST + k] = t->free_low[CLOSING_FIRST + k];
    }
    t->prepared = 0;
    memset(t->report.slack, 0, sizeof t->report.slack);
    own_sides(t);
    return 1;
}

#endif

/* The velocity that the next tick counts from, and where loops are closed until then. Where that takes more than limits allow these
 * give way, and loops that stay open. */
EXPORT void wbc_tick_arrive(wbc_tick *t) {
    double way[NV];
    if (!t->arrived) follow(t, way);
#if CLOSING > 0
    if (!t->arrived && !arrives_within(t)) {
        follow(t, way);
        /* Those that are open where it begins are left to their rows */
        const double share = closing_share(t);
        const int whole = t->report.flag != WBC_SOLVED;
        const int closed = share > 0.0 && (closes(t, way, share, 0) || (whole && closes(t, way, WHOLE_SHARE, 0)));
        if (!closed) arrive_at(t, t->q, way);
        if (closed && t->report.flag <= WBC_RELAXED) report_passed(t);
        else if (t->report.flag == WBC_SOLVED && share > 0.0) report_open(t);
    }
#endif
    t->arrived = 0;
    memcpy(t->v_last, t->report.next_v, DOFS * sizeof(double));
}

#endif

#endif
