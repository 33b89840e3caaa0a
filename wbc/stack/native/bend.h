/* Equality rows hold at q, and what they keep at 0 bends until q (+) v dt: they are made to make up for it. docs/reach.md */
#ifndef WBC_BEND_H
#define WBC_BEND_H

#include "primal.h"

/* A residual may bend by so much [rad, or characteristic lengths, per second]; at a gain of 10/s a tenth of that remains */
#define BENDS 1e-3
/* Exact rows that miss 0 at q (+) v dt by more give way, and limits of position that are passed by more where loops are closed [rad, or
 * characteristic lengths] */
#define OPENED 1e-9
/* Where joints that are stopped by bounds are to be left out of account, as others make up for them in one tick more than their
 * Jacobians say: as above */
#define STRETCHED 2e-2
/* Corrections at most, and where exact rows alone miss what they may; how often at most the step gets shorter, each time by so much
 * more on the diagonal of H */
#define BENDINGS 8
#define REFINED 24
#define SHORTER 3
#define STEEPER 100.0
/* Corrections in full; later ones are half of what is missed, as next to where rows nearly depend on each other two sets of bounds
 * take turns, each by what the other misses */
#define IN_FULL 6
/* A joint that moves at this rate and moved at it the other way in the last tick turns round [rad, or characteristic lengths, per
 * second]: where rows bend it is not their tasks that want it */
#define TURNING 1.0
/* A tick that moves the joints of a row by no more in all bends it in the second order [rad, or characteristic lengths] */
#define SHORT 0.2

#if BENDING > 0
/* By how much what rows keep changes until q (+) v dt, into `lost_there`. That of one v is asked for again and again, and evaluated
 * once. */
static void change_of_kept(wbc_tick *t, const double *v) {
    if (!t->lost_known || memcmp(v, t->lost_of, sizeof t->lost_of)) {
        const double *arg[5] = {t->q, v, t->p, &t->dt, t->handed_to_lost};
        double *res[1] = {t->report.lost};
        lost(arg, res, t->work_iw, t->work_w, 0);
        memcpy(t->lost_there, t->report.lost, MC * sizeof(double));
        memcpy(t->lost_of, v, sizeof t->lost_of);
        t->lost_known = 1;
    }
}

/* What each row loses of it: it changes by another amount than its rate says */
static void lose(wbc_tick *t, const double *v) {
    change_of_kept(t, v);
    for (int k = 0; k < MC; k++) {
        const double loss = bent[k] ? t->lost_there[k] - row_at(t, k, v) * t->dt : 0.0;
        t->report.lost[k] = isfinite(loss) && t->free_low[k] == t->free_high[k] ? loss : 0.0;
    }
}
#endif

#if BENDING > 0
/* `most` to the size of x in units of row k, where that is larger; divided only then */
INLINE void raise_per_unit(double *most, double x, int k) {
    if (fabs(x) > *most * row_scale[k]) *most = fabs(x) / row_scale[k];
}

/* Whether loops are open at q, and their rows close them: those that are left out close with these, at rates of their own */
static int closes_loops(const wbc_tick *t) {
    int open = 0;
    for (int k = 0; k < MC; k++)
        open |= bent[k] == 2 && t->free_low[k] == t->free_high[k] && fabs(t->free_low[k] - t->bend[k]) * t->dt > 10.0 * EXACT * row_scale[k];
    return open;
}
#endif

/* What the equality rows lose at the command and do not make up for; the largest as a rate, in row units. `all`: what they miss
 * of moved sides, too, which is not what the order of sacrifice has taken. */
EXPORT double wbc_tick_find_lost(wbc_tick *t, int all) {
#if BENDING > 0
    double worst = 0.0;
    if (all) change_of_kept(t, t->report.v);
    else lose(t, t->report.v);
    const int looks = SPARED > 0 && all && !closes_loops(t);
    for (int k = 0; k < MC; k++) {
        if (all) t->report.lost[k] = 0.0;
        if (looks && bent[k] && t->left_out[k] && isfinite(t->lost_there[k])) {
            t->report.lost[k] = t->lost_there[k] - t->left_side[k] * t->dt;
            raise_per_unit(&worst, t->report.lost[k], k);
        }
        if (!bent[k] || t->free_low[k] != t->free_high[k] || !isfinite(t->lost_there[k])) continue;
        /* What the rate says cancels where all is asked for */
        t->report.lost[k] = all ? t->lost_there[k] + (t->bend[k] - t->free_low[k]) * t->dt : t->report.lost[k] + t->bend[k] * t->dt;
        raise_per_unit(&worst, t->report.lost[k], k);
    }
    return worst / t->dt;
#else
    (void)t, (void)all;
    return 0.0;
#endif
}

#if BENDING > 0
/* How far rows are from what is allowed: `worst` of those that bend, and what exact ones miss, which may be `most`; above 1 where they
 * are */
static double bent_by(const wbc_tick *t, double worst, double most) {
    double opened = 0.0;
    for (int k = 0; k < MC; k++)
        if (bent[k] == 2) raise_per_unit(&opened, t->report.lost[k], k);
    return larger(worst / BENDS, opened / most);
}
#endif

/* The rows as they are at q */
static void unbend(wbc_tick *t) {
    t->lost_known = 0;
    memset(t->bend, 0, sizeof t->bend);
    memset(t->stopped, 0, sizeof t->stopped);
    t->curving = t->shortened = 0.0;
    memset(t->shortfall, 0, sizeof t->shortfall);
    memset(t->pressed, 0, sizeof t->pressed);
}

#if BENDING > 0 || (COMMAND != VELOCITY && CLOSING > 0)
/* The problem again, with a shorter step, or smaller accelerations */
static void shorten(wbc_tick *t) {
    memset(t->bend, 0, sizeof t->bend);
    if (t->reduced) find_stiffness(t);
    t->shortened = t->shortened == 0.0 ? t->stiffness : STEEPER * t->shortened;
    assemble(t, 1);
}
#endif

#if BENDING > 0

/* Both sides of an equality row to where `bend` wants them */
INLINE void bend_row(wbc_tick *t, int k, double bend) {
    t->free_low[k] = t->free_high[k] = t->free_low[k] + (bend - t->bend[k]);
    t->bend[k] = bend;
}

/* The same of all, and the problem as it was assembled */
static void bend_rows(wbc_tick *t, const double *bend) {
#if SOFT_ROWS > 0
    unmelt(t);
#endif
    for (int k = 0; k < MC; k++)
        if (t->free_low[k] == t->free_high[k]) bend_row(t, k, bend[k]);
    t->prepared = 0;
    memset(t->report.slack, 0, sizeof t->report.slack);
    own_sides(t);
}

/* By how much exact rows bend at the last command, without an evaluation: what led here kept them where it began, so on the way back they
 * lose what their rates say here, and on the way on as much in the second order. 0 where that is more than such a motion of their
 * joints can bend them by, so that they were not kept, or where it is long. */
static int bends_as_before(const wbc_tick *t, double *guess) {
    double moved[NV];
    for (int i = 0; i < NV; i++) moved[i] = fabs(t->v_last[i]) / dof_scale[i] * t->dt;
    for (int k = 0; k < MC; k++) {
        double rate = 0.0, length = 0.0;
        guess[k] = 0.0;
        if (bent[k] != 2 || t->free_low[k] != t->free_high[k]) continue;
        for (int e = a_start[k]; e < a_end[k]; e++) {
            rate += t->at[e] * t->v_last[a_col[e]];
            length += moved[a_col[e]];
        }
        guess[k] = rate * t->dt;
        if (!(length <= SHORT && fabs(guess[k]) <= 0.5 * length * length * row_scale[k])) return 0;
    }
    return 1;
}

/* Exact rows make up for what they would lose at the last command, which this one is near to; before the first search */
static void foresee(wbc_tick *t) {
    double guess[MC + 1];
    if (!has_exact_rows()) return;
    const int known = bends_as_before(t, guess);
    if (!known) lose(t, t->v_last);
    for (int k = 0; k < MC; k++) {
        if (bent[k] != 2 || t->free_low[k] != t->free_high[k]) continue;
        bend_row(t, k, -(known ? guess[k] : t->report.lost[k]) / t->dt);
        t->low[NV + k] = t->high[NV + k] = t->free_low[k];
    }
    if (t->prepared && !t->reduced) right_side(t);
}

#if LEVELS == 0
/* Whether the rows that hold the command are still those of the optimum: forces have their signs, and no other row binds */
static int same_rows(const wbc_tick *t) {
    for (int a = 0; a < t->daqp.n_active; a++) {
        const int i = t->daqp.WS[a];
        if (!stays(t, i) && (t->sense[i] & LOWER ? t->daqp.lam_star[a] > 0.0 : t->daqp.lam_star[a] < 0.0)) return 0;
    }
    int outside = 0;
    for (int i = 0; i < NV; i++) {
        const double rounding = TOLERANCE * dof_scale[i];
        outside |= (t->x[i] < t->low[i] - rounding) | (t->x[i] > t->high[i] + rounding);
    }
    for (int i = outside ? 0 : NV; i < M_ALL; i++) {
        /* Rows that are taken out hold by what follows from them */
        if (REDUCES && t->reduced && t->low[i] == t->high[i]) continue;
        if (t->sense[i] & ACTIVE || (i >= NV && (t->idle[i - NV] || HELD(t, i - NV)))) continue;
        const double value = i < NV ? t->x[i] : row_at(t, i - NV, t->x);
        const double rounding = TOLERANCE * (i < NV ? dof_scale[i] : row_scale[i - NV]);
        if (value < t->low[i] - rounding || value > t->high[i] + rounding) return 0;
    }
    return 1;
}

/* The same where equality rows are taken out: the sides of exact ones, by what they lose */
static int bend_reduced(wbc_tick *t, double share) {
    double change[WIDE];
    int open = 0;
    wbc_tick_find_lost(t, 1);
    for (int n = 0; n < t->reduced; n++) {
        const int k = t->equal_row[n];
        change[n] = bent[k] == 2 ? share * t->report.lost[k] / t->dt : 0.0;
        open |= bent[k] == 2 && fabs(t->report.lost[k]) > EXACT * row_scale[k];
    }
    if (!open) return 0;
    for (int n = 0; n < t->reduced; n++) {
        const int k = t->equal_row[n];
        if (change[n] == 0.0) continue;
        bend_row(t, k, t->bend[k] - change[n]);
        t->low[NV + k] = t->high[NV + k] = t->free_low[k];
    }
    correct_reduced(t, change, NULL);
    return 1;
}

/* Exact rows make up for a share of what they lose at the command, with the factors of the rows that hold it: M dy = change of the sides, and
 * multipliers as they follow. 0 where other rows would hold it, and the search is to go on with the sides as they are then */
static int make_up(wbc_tick *t, double share) {
    DAQPWorkspace *work = &t->daqp;
    if (!t->factored || t->eased > 0.0 || (work->n_active == 0 && !t->reduced)) return 1;
    for (int n = 0; n < REFINED; n++) {
        if (REDUCES && t->reduced) {
            if (!bend_reduced(t, share)) return 1;
            if (!same_rows(t)) {
                bend_rows(t, t->bend);
                return 0;
            }
            command(t);
            continue;
        }
        double mu[ACTIVE_MAX], change[ACTIVE_MAX], dy[WIDE] = {0}, opened = 0.0;
        wbc_tick_find_lost(t, 1);
        for (int a = 0; a < work->n_active; a++) {
            const int i = work->WS[a], k = i - NV, exact = i >= NV && bent[k] == 2 && t->free_low[k] == t->free_high[k];
            change[a] = exact ? -share * t->report.lost[k] / t->dt : 0.0;
            mu[a] = -change[a] * t->scaling[i];
            if (exact) opened = larger(opened, fabs(t->report.lost[k]) / row_scale[k]);
        }
        if (opened <= EXACT) return 1;
        solve_gram(t, work->n_active, mu);
        for (int a = 0; a < work->n_active; a++) {
            const int i = work->WS[a], k = i - NV;
            push_back(t, i, -mu[a], dy);
            work->lam_star[a] += mu[a] * t->scaling[i];
            if (change[a] == 0.0) continue;
            bend_row(t, k, t->bend[k] + change[a]);
            t->low[i] = t->high[i] = t->free_low[k];
            work->lam_star[a] += t->strength[k] * change[a];
        }
        for (int i = 0; i < NV; i++) t->x[i] = t->report.v[i] + dot(t->inverse + i * WIDE, dy, i);
        if (!same_rows(t)) {
            bend_rows(t, t->bend);
            return 0;
        }
        command(t);
    }
    return 1;
}
#endif

/* The problem again, with the curvature of equality rows, and without counting on joints that bounds stop at the command; 0 where
 * that is what it was */
static int curve_rows(wbc_tick *t) {
    int changed = !CALM;
    own_sides(t);
    for (int i = 0; i < NV; i++) {
        t->stopped[i] = t->report.lambda[i] != 0.0 && t->low[i] != t->high[i];
        changed |= t->stopped[i] != 0.0;
    }
    t->curving = 1.0;
    if (changed) assemble(t, 1);
    return changed;
}

static int turns_round(const wbc_tick *t) {
    int turns = 0;
    for (int i = 0; i < DOFS; i++) {
        const double now = t->report.v[i] / dof_scale[i], before = t->v_last[i] / dof_scale[i];
        turns |= now * before < 0.0 && smaller(fabs(now), fabs(before)) > TURNING;
    }
    return turns;
}

/* A row that loses too much gives way by it; whether any does */
static int report_lost(wbc_tick *t) {
    int gave_way = 0;
    for (int k = 0; k < MC; k++) {
        const double rate = fabs(t->report.lost[k]) / t->dt;
        if (rate <= (bent[k] == 2 ? OPENED / t->dt : BENDS) * row_scale[k]) continue;
        t->report.slack[k] = larger(t->report.slack[k], rate);
        gave_way = 1;
    }
    return gave_way;
}

#endif

#endif
