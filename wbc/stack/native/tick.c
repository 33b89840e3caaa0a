/* The entry points of one stack's tick */
#include "assemble.h"
#include "levels.h"
#include "arrive.h"

static int refused(const wbc_tick *t) {
    for (int i = 0; i < NQ; i++)
        if (!isfinite(t->q[i])) return WBC_BAD_Q;
    for (int k = 0; k < UNITS; k++) {
        double square = 0.0;
        for (int i = unit_start[k]; i < unit_start[k] + unit_size[k]; i++) square += t->q[i] * t->q[i];
        if (fabs(square - 1.0) > UNIT_TOLERANCE) return WBC_BAD_UNIT;
    }
    if (t->use_v != 0.0)
        for (int i = 0; i < NV; i++)
            if (!isfinite(t->v_in[i])) return WBC_BAD_V;
    return 0;
}

/* Refuse bad inputs, or take over a measured velocity */
EXPORT int wbc_tick_check(wbc_tick *t) {
    const int bad = refused(t);
    if (!bad && t->use_v != 0.0) memcpy(t->v_last, t->v_in, sizeof t->v_in);
#if SLEWED > 0
    for (int k = 0; !bad && k < SLEWED; k++) t->p[slewed_at[k]] = t->kept[slewed_dof[k]];
#endif
    t->use_v = 0.0;
    if (!bad) unbend(t);
    memcpy(bad ? t->q : t->q_good, bad ? t->q_good : t->q, NQ * sizeof(double));
    return bad;
}

static int unsound(const wbc_tick *t, int flag) {
    if (flag == WBC_CAPPED) return 0;
    if (flag == WBC_BRAKED) return t->unusable == 0.0 && !t->proven;
    const int optimal = t->report.stationarity <= OPTIMAL && t->report.complementarity <= OPTIMAL;
    const int met = t->report.violation <= SOUND * LONGEST && t->firm_missed <= FIRMLY * LONGEST;
    return !((optimal || t->report.error_bound <= KNOWN * LONGEST) && met);
}

#if LEVELS == 0
/* After a relaxation at prices: the same problem, whose rows have not been frozen where its search met them */
static int again_at_prices(wbc_tick *t, int flag) {
    int any = 0;
    for (int k = 0; ELASTIC && flag == WBC_RELAXED && k < MC; k++) {
        if (!(t->elastic[k] > 0.0)) continue;
        any = 1;
        t->low[NV + k] = t->free_low[k];
        t->high[NV + k] = t->free_high[k];
    }
    const int found = any && primal(t);
    if (any) widen(t, t->report.v);
    memset(t->elastic, 0, sizeof t->elastic);
    return found;
}

/* After a relaxation: from the point that its classes met at */
static int primal_of_the_rest(wbc_tick *t, int flag) {
    if (flag != WBC_RELAXED || LAST_ORDER == 0) return 0;
    for (int i = 0; i < NV; i++) t->report.v[i] = clamp(t->met[i], t->low[i], t->high[i]);
    return primal(t);
}
#endif

#if LEVELS == 0
/* After a relaxation that nothing gave way in, as rows contradicted each other by rounding only: their own sides */
static int primal_of_all(wbc_tick *t) {
    if (ELASTIC) return 0;
    own_sides(t);
    return primal(t);
}
#endif

/* By how much soft rows are violated; the slack of those that give way by more than is worth a report */
static void report_soft_rows(wbc_tick *t) {
    for (int k = 0; k < MC; k++) {
        if (price_at[k] < 0) continue;
        const double value = row_at(t, k, t->report.v);
        const double missed = fmax(t->free_low[k] - value, value - t->free_high[k]);
        t->report.slack[k] = t->report.flag != WBC_BRAKED && missed > slack_reported[k] ? missed : 0.0;
#if SOFT_ROWS > 0
        const int optimal = t->report.flag == WBC_SOLVED || t->report.flag == WBC_RELAXED;
        if (optimal && t->melted[k]) t->report.lambda[NV + k] = (value - met_side(t, k)) / t->give[k];
#endif
    }
}

#if COMMAND == TORQUE
/* Torques of the joints for the command, within their limits */
EXPORT void wbc_tick_torques(wbc_tick *t) {
    const double *arg[7] = {t->q, t->v_last, t->p, &t->dt, t->report.v, t->enabled, t->handed_to_torque};
    double *res[1] = {t->report.torque};
    torque(arg, res, t->work_iw, t->work_w, 0);
    for (int i = 0; i < DOFS; i++) {
        if (!isfinite(t->report.torque[i])) t->report.torque[i] = 0.0;
        t->kept[i] = t->report.torque[i];
    }
}
#endif

/* What follows from the command: torques, and the velocity that the next tick counts from */
static void commanded(wbc_tick *t, int sound) {
#if COMMAND == VELOCITY
    (void)sound;
    memcpy(t->v_last, t->report.v, NV * sizeof(double));
#else
#if COMMAND == TORQUE
    /* What no motion may cost, and the command of a tick without an answer lacks */
    for (int k = 0; t->report.flag == WBC_BRAKED && k < MC; k++) {
        const double value = row_at(t, k, t->report.v), missed = fmax(t->free_low[k] - value, value - t->free_high[k]);
        t->report.slack[k] = row_order[k] == 0 && missed > 2.0 * TOLERANCE * row_scale[k] ? missed : 0.0;
    }
    wbc_tick_torques(t);
#endif
    wbc_tick_arrive(t);
    for (int i = DOFS; sound && i < NV; i++) t->kept[i] = t->report.v[i];
#endif
}

/* The tick again: accelerations and torques count from where they did */
static void rewind_tick(wbc_tick *t) {
    memcpy(t->v_last, t->v_in, sizeof t->v_in);
    unbend(t);
#if SLEWED > 0
    for (int k = 0; k < SLEWED; k++) t->kept[slewed_dof[k]] = t->p[slewed_at[k]];
#endif
}

/* The answer to the rows as they stand, certified; `nameless`: rows contradict each other by rounding only */
static int answer(wbc_tick *t, int *nameless) {
    int flag = wbc_tick_solve(t);
    *nameless = 0;
#if LEVELS > 0
    if (t->cap == 0.0 && unsound(t, flag) && flag == WBC_BRAKED && primal(t)) flag = (int)(t->report.flag = WBC_SOLVED);
    flag = all_levels(t, flag);
#else
#if BENDING > 0
    for (int n = 0; n < REFINED && flag == WBC_SOLVED && !make_up(t, n < IN_FULL ? 1.0 : 0.5); n++) flag = wbc_tick_solve(t);
#endif
    wbc_tick_certify(t);
    if (REDUCES && t->reduced && flag == WBC_SOLVED && !good(&t->report)) {
        /* With all variables, whose certificate is sharper */
        t->reduced = t->prepared = 0;
        t->whole = 1;
        return answer(t, nameless);
    }
    if (t->cap == 0.0 && unsound(t, flag) && (again_at_prices(t, flag) || primal(t) || primal_of_the_rest(t, flag))) {
        flag = (int)(t->report.flag = flag == WBC_RELAXED ? WBC_RELAXED : WBC_SOLVED);
        /* Rows that contradicted each other by rounding only: their frozen bounds are not what is to be certified */
        *nameless = flag == WBC_RELAXED && !report_slack(t, flag);
    } else if (flag == WBC_RELAXED) {
        /* The certificate may have refined the command */
        *nameless = !report_slack(t, flag);
    }
    if (*nameless && primal_of_all(t)) {
        flag = (int)(t->report.flag = WBC_SOLVED);
        *nameless = 0;
    }
#endif
    return flag;
}

static int has_answer(const wbc_tick *t, int flag) { return flag <= WBC_RELAXED && !unsound(t, flag); }

#if BENDING > 0
/* Sides are moved until the rows make up for what they lose, `worst` as a rate, as far as that gets less; what they lose then */
static double correct_rows(wbc_tick *t, int all, double worst, int *flag, int *nameless) {
    double last[MC + 1], next[MC + 1], off = bent_by(t, worst, t->eased + EXACT);
    for (int n = 0; n < (worst > BENDS ? BENDINGS : REFINED) && off > 1.0 && has_answer(t, *flag); n++) {
        const double before = off;
        for (int k = 0; k < MC; k++) {
            last[k] = t->bend[k];
            next[k] = last[k] - t->report.lost[k] / t->dt;
        }
        bend_rows(t, next);
        *flag = answer(t, nameless);
        worst = wbc_tick_find_lost(t, all);
        off = bent_by(t, worst, t->eased + EXACT);
        if (off < before && has_answer(t, *flag)) continue;
        bend_rows(t, last);
        *flag = answer(t, nameless);
        return wbc_tick_find_lost(t, all);
    }
    return worst;
}
#endif

/* Equality rows make up for what they lose within the tick; where that does not help, the step gets shorter */
static int bent_answer(wbc_tick *t, int flag, int *nameless) {
#if BENDING > 0
    const int all = flag == WBC_SOLVED;
    double worst = wbc_tick_find_lost(t, all);
    const int bends = worst > BENDS;
    if (worst > (CALM ? STRETCHED : BENDS) && has_answer(t, flag) && curve_rows(t)) {
        flag = answer(t, nameless);
        worst = wbc_tick_find_lost(t, all);
    }
    worst = correct_rows(t, all, worst, &flag, nameless);
    for (int n = 0; n < SHORTER && has_answer(t, flag) && (bent_by(t, worst, OPENED) > 1.0 || (bends && n == 0 && turns_round(t))); n++) {
        shorten(t);
        flag = answer(t, nameless);
        worst = correct_rows(t, all, wbc_tick_find_lost(t, all), &flag, nameless);
    }
    if (bent_by(t, worst, OPENED) > 1.0 && flag <= WBC_RELAXED && report_lost(t)) flag = (int)(t->report.flag = WBC_RELAXED);
#else
    (void)t, (void)nameless;
#endif
    return flag;
}

/* The velocity that accelerations lead to keeps loops closed, and within the bounds: where corrections of it would pass them, the
 * accelerations are others, as far as there are any, and where none lead to closed loops, as next to a dead point, smaller ones */
static int arriving_answer(wbc_tick *t, int flag, int *nameless) {
#if COMMAND != VELOCITY && CLOSING > 0
    if (CLOSING == 0 || flag != WBC_SOLVED || (t->arrived = arrives_within(t))) return flag;
    for (int n = 0; n < ARRIVALS && flag == WBC_SOLVED; n++) {
        if (!bend_arrival(t)) break;
        flag = answer(t, nameless);
        if (flag == WBC_SOLVED && !unsound(t, flag) && (t->arrived = arrives_within(t))) return flag;
    }
    for (int n = 0; n < SHORTER; n++) {
        shorten(t);
        flag = answer(t, nameless);
        if (flag == WBC_SOLVED && !unsound(t, flag) && (t->arrived = arrives_within(t))) return flag;
    }
    t->shortened = 0.0;
    assemble(t, 1);
    return answer(t, nameless);
#else
    (void)t, (void)nameless;
    return flag;
#endif
}

EXPORT int wbc_tick_step(wbc_tick *t) {
    const int bad = wbc_tick_check(t);
    if (bad) return bad;
    /* What accelerations count from, for who looks at the tick afterwards */
    memcpy(t->v_in, t->v_last, sizeof t->v_in);
    assemble(t, 1);
#if BENDING > 0
    foresee(t);
#endif
    int nameless, flag = answer(t, &nameless);
    if (has_answer(t, flag) && wbc_tick_hurries(t)) {
        own_sides(t);
        assemble(t, 1);
        flag = answer(t, &nameless);
    }
    flag = bent_answer(t, flag, &nameless);
    flag = arriving_answer(t, flag, &nameless);
    if (PRICES) report_soft_rows(t);
    for (int k = 0; ELASTIC && flag == WBC_RELAXED && k < MC; k++)
        if (t->spring[k] > 0.0) t->report.lambda[NV + k] = t->spring[k] * (row_at(t, k, t->report.v) - t->free_low[k]);
    wbc_tick_look_ahead(t);
    const int sound = !unsound(t, flag) && !nameless;
    commanded(t, sound && flag != WBC_BRAKED);
    if (flag == WBC_SOLVED) flag = (int)t->report.flag;
    return sound ? flag : flag + WBC_UNSOUND;
}

/* For solvers in Python, whose QP has no answer: closed loops get room in it by rounding, and, `limits`, limits of motion give way as
 * far as loops need it; the room that these have, as the rows have it in their units, 0 where they do not give way last */
EXPORT double wbc_tick_ease(wbc_tick *t, int limits) {
    t->eased = t->report.iterations = 0.0;
    t->spent = 0;
    own_sides(t);
    if (!LOOPS || (limits && ELASTIC)) return 0.0;
    if (limits) limits_give_way(t);
    ease_loops(t, limits ? EXACT : EASED);
    return room_of(t, t->eased);
}

EXPORT long long wbc_tick_size(void) { return (long long)sizeof(wbc_tick); }

/* Bytes before field k of memory.h, -1 behind the last one: what the caller takes for granted */
EXPORT long long wbc_tick_offset(int k) {
#define IN_REPORT(field) (long long)(offsetof(wbc_tick, report) + offsetof(wbc_report, field)),
#define IN_TICK(field) (long long)offsetof(wbc_tick, field),
    static const long long offsets[] = {WBC_REPORT_FIELDS(IN_REPORT) WBC_BUFFER_FIELDS(IN_TICK) -1};
    return k >= 0 && k < (int)(sizeof offsets / sizeof *offsets) ? offsets[k] : -1;
}

/* J of all task rows in the last QP [MT, NV] */
EXPORT void wbc_tick_task_rows(const wbc_tick *t, double *J) {
    memset(J, 0, MT * NV * sizeof(double));
    for (int k = 0; k < MT; k++)
        for (int e = j_start[k]; e < j_start[k + 1]; e++) J[k * NV + j_col[e]] = t->jt[e];
}

#if LEVELS > 0
/* The curvature in H [NV, NV]; 0 for none */
EXPORT int wbc_tick_curvature(const wbc_tick *t, double *out) {
    memcpy(out, t->curvature, sizeof t->curvature);
    return t->curved;
}
#endif

EXPORT void wbc_tick_reset(wbc_tick *t) {
    t->warm = 0;
#if SOFT_ROWS > 0
    memset(t->held, 0, sizeof t->held);
    memset(t->later, 0, sizeof t->later);
#endif
#if LEVELS > 0
    memset(t->levels.warm, 0, sizeof t->levels.warm);
#endif
}

/* The step where no other solver is at hand: what has no certificate is searched again from no active set, and brakes
 * where that has none either */
EXPORT int wbc_tick_safe_step(wbc_tick *t) {
    int flag = wbc_tick_step(t);
    if (flag < 0 || !(flag & WBC_UNSOUND)) return flag;
    rewind_tick(t);
    wbc_tick_reset(t);
    flag = wbc_tick_step(t);
    if (flag == WBC_BRAKED) return flag;
    if (!(flag & WBC_UNSOUND)) return (int)(t->report.flag = WBC_RECOVERED);
    rewind_tick(t);
    wbc_tick_reset(t);
    assemble(t, 1);
    brake(t);
    command(t);
    t->report.flag = WBC_BRAKED;
    wbc_tick_certify(t);
    memset(t->report.slack, 0, sizeof t->report.slack);
    wbc_tick_look_ahead(t);
    commanded(t, 0);
    return (int)(t->report.flag = WBC_UNCERTIFIED);
}

/* The solvers' memory is that of the tick, all of it zero */
static void begin(wbc_tick *t) {
    DAQPWorkspace *work = &t->daqp;
    t->problem.n = work->n = NV;
    t->problem.m = work->m = M_ALL;
    t->problem.ms = work->ms = NV;
    work->qp = &t->problem;
    work->settings = &t->settings;
    daqp_default_settings(&t->settings);
    SEARCH_SETTINGS(t->settings);
    t->settings.eps_prox = 0.0;
    t->settings.rho_soft = RHO;
    work->Rinv = t->Rinv;
    work->M = t->M;
    work->dupper = t->dupper;
    work->dlower = t->dlower;
    work->v = t->ldp_v;
    work->scaling = t->scaling;
    work->sense = t->sense;
    work->x = t->x;
    work->xold = t->xold;
    work->lam = t->lam;
    work->lam_star = t->lam_star;
    work->u = t->u;
    work->L = t->L;
    work->D = t->D;
    work->xldl = t->xldl;
    work->zldl = t->zldl;
    work->WS = t->WS;
    work->sing_ind = EMPTY_IND;
#if LEVELS > 0
    begin_level_solver(t);
#endif
}

EXPORT void wbc_tick_init(wbc_tick *t) {
    memset(t, 0, sizeof *t);
    begin(t);
    for (int i = 0; i < MT; i++) t->weight[i] = 1.0;
    for (int k = 0; k < MC; k++) t->enabled[k] = 1.0;
    for (int i = 0; i < NB * NV; i++) t->bound_enabled[i] = 1.0;
#if COMMAND == TORQUE
    for (int i = 0; i < DOFS; i++) t->kept[i] = WBC_INF;
#endif
}
