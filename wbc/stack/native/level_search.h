/* The QP of one level where rows bind, in the coordinates of its directions: taken ones, free ones, slacks. */
#ifndef WBC_LEVEL_SEARCH_H
#define WBC_LEVEL_SEARCH_H

#include "spaces.h"

#if LEVELS > 0

/* Cost of the free directions, in the QP of a level; steps take the effect away again, until nothing moves by more */
#define PROXIMAL 1e-6
#define LEVEL_STEPS 12
#define LEVEL_SETTLED 1e-11
/* Rows shorter than this in the space that is left cannot be moved */
#define UNMOVED 1e-9
/* Multipliers below this are rounding, whatever drives the level */
#define NOISE 1e-12

INLINE double row_of(const wbc_levels *s, int i, const double *x) {
    return i < NV ? x[i] : inner(s->general + (i - NV) * NV, x, NV);
}

/* Bounds of a row for this level; those that cross are met half-way */
INLINE void level_sides(const wbc_levels *s, int i, double *low, double *high) {
    *low = s->soft[i] ? s->given_low[i] : s->low[i];
    *high = s->soft[i] ? s->given_high[i] : s->high[i];
    if (*low > *high) *low = *high = 0.5 * (*low + *high);
}

INLINE int counts(const wbc_levels *s, int i) { return s->on[i] || s->soft[i]; }

/* Whether all rows hold at x, as far as rounding goes */
static int level_holds(const wbc_levels *s, const double *x) {
    for (int i = 0; i < M_ALL; i++) {
        double low, high;
        if (!counts(s, i)) continue;
        level_sides(s, i, &low, &high);
        const double at = row_of(s, i, x);
        if (!(at >= low - TOLERANCE && at <= high + TOLERANCE)) return 0;
    }
    return 1;
}

/* Rows as DAQP takes them */
static void level_rows(wbc_levels *s) {
    for (int i = 0; i < M_ALL; i++) {
        double e[NV], *out = s->M + i * s->width;
        s->scaling[i] = s->soft_scaling[i] = s->length[i] = 0.0;
        if (!counts(s, i)) continue;
        for (int j = 0; j < s->width; j++) e[j] = row_of(s, i, s->basis + j * NV);
        const double square = inner(e, e, s->width);
        if (square <= UNMOVED * UNMOVED) continue;
        s->length[i] = sqrt(square + s->soft[i]);
        for (int j = 0; j < s->width; j++) out[j] = 0.0;
        for (int k = 0; k < s->rank; k++)
            for (int j = k; j < s->rank; j++) out[j] += e[k] * s->inverse[k * NV + j];
        for (int j = s->rank; j < s->width; j++) out[j] = e[j] / sqrt(PROXIMAL);
        s->scaling[i] = 1.0 / sqrt(inner(out, out, s->width));
        s->soft_scaling[i] = s->soft[i] ? s->scaling[i] * sqrt(s->give[i]) : s->scaling[i];
        for (int j = 0; j < s->width; j++) out[j] *= s->scaling[i];
    }
}

/* Sides of the distance problem, whose free directions are drawn to `z` */
static void level_shift(wbc_levels *s, const double *z) {
    for (int j = 0; j < s->width; j++) s->shift[j] = 0.0;
    for (int k = 0; k < s->rank; k++)
        for (int j = k; j < s->rank; j++) s->shift[j] -= s->inverse[k * NV + j] * s->right[k];
    for (int j = s->rank; j < s->width; j++) s->shift[j] = -sqrt(PROXIMAL) * z[j];
    for (int i = 0; i < M_ALL; i++) {
        double low, high;
        if (s->scaling[i] == 0.0) continue;
        level_sides(s, i, &low, &high);
        const double at = row_of(s, i, s->x), sum = inner(s->M + i * s->width, s->shift, s->width);
        s->dupper[i] = (high - at) * s->scaling[i] + sum;
        s->dlower[i] = (low - at) * s->scaling[i] + sum;
    }
}

/* DAQP from the active set in `keep`, or from none; its exit flag */
static int level_active_set(wbc_tick *t, const int *keep) {
    wbc_levels *s = &t->levels;
    DAQPWorkspace *work = &s->daqp;
    const int limit = granted(t);
    if (limit == 0) return EXIT_ITERLIMIT;
    reset_daqp_workspace(work);
    t->settings.rho_soft = 1.0;
    for (int i = 0; i < M_ALL; i++) {
        double low, high;
        level_sides(s, i, &low, &high);
        const int dead = s->scaling[i] == 0.0 || (low <= -WBC_INF && high >= WBC_INF);
        s->sense[i] = (dead || low == high ? IMMUTABLE : 0) | (s->soft[i] ? SOFT : 0);
        if (dead) s->scaling[i] = 0.0;
    }
    for (int i = 0; i < M_ALL; i++)
        if ((s->sense[i] & IMMUTABLE) && s->scaling[i] != 0.0) activate(work, i, 0);
    for (int i = 0; keep && i < M_ALL; i++)
        if ((keep[i] & ACTIVE) && !(s->sense[i] & IMMUTABLE)) activate(work, i, keep[i] & LOWER);
    const int flag = search(t, work, limit);
    t->settings.rho_soft = RHO;
    return flag;
}

/* z = R^-1 (u - shift): the coordinates that the active set answers */
static void level_point(const wbc_levels *s, double *z) {
    for (int k = 0; k < s->rank; k++) {
        z[k] = 0.0;
        for (int j = k; j < s->rank; j++) z[k] += s->inverse[k * NV + j] * (s->u[j] - s->shift[j]);
    }
    for (int j = s->rank; j < s->width; j++) z[j] = (s->u[j] - s->shift[j]) / sqrt(PROXIMAL);
}

/* The multipliers of all rows, for the certificate, and of those that push */
static void level_multipliers(wbc_levels *s) {
    const DAQPWorkspace *work = &s->daqp;
    double drive = 0.0;
    for (int i = 0; i < M_ALL; i++) s->lambda[i] = 0.0;
    for (int k = 0; k < s->rank; k++) drive = larger(drive, fabs(s->right[k]));
    for (int a = 0; a < work->n_active; a++) {
        const int i = work->WS[a];
        s->lambda[i] = work->lam_star[a] * s->scaling[i];
        drive = larger(drive, fabs(s->lambda[i]));
    }
    memcpy(s->force, s->lambda, sizeof s->force);
    for (int i = 0; i < M_ALL; i++)
        if (fabs(s->lambda[i]) * s->length[i] <= larger(PUSHING * drive, NOISE)) s->lambda[i] = 0.0;
}

/* Active rows meet their bounds to rounding: the search leaves them off by what the cost of free directions hides */
static void level_meet(wbc_tick *t, double *z) {
    wbc_levels *s = &t->levels;
    DAQPWorkspace *work = &s->daqp;
    for (int n = 0; n < MEETINGS && work->n_active > 0; n++) {
        double x[NV], move[NV] = {0}, mu[NV + SOFT_MAX + 2];
        memcpy(x, s->x, sizeof x);
        for (int j = 0; j < s->width; j++) add_to(x, s->basis + j * NV, z[j], NV);
        for (int a = 0; a < work->n_active; a++) {
            const int i = work->WS[a];
            double low, high;
            level_sides(s, i, &low, &high);
            const double given = s->soft[i] ? s->give[i] * work->lam_star[a] * s->scaling[i] : 0.0;
            mu[a] = ((s->sense[i] & LOWER ? low : high) + given - row_of(s, i, x)) * s->scaling[i];
        }
        solve_factors(s->factor, s->pivot, work->n_active, mu);
        for (int a = 0; a < work->n_active; a++) {
            add_to(move, s->M + work->WS[a] * s->width, mu[a], s->width);
            work->lam_star[a] -= mu[a];
        }
        for (int k = 0; k < s->rank; k++)
            for (int j = k; j < s->rank; j++) z[k] += s->inverse[k * NV + j] * move[j];
        for (int j = s->rank; j < s->width; j++) z[j] += move[j] / sqrt(PROXIMAL);
    }
}

/* The optimum of a level whose rows bind, into `z` (its directions) and lambda; 0 where it was not found */
static int level_search(wbc_tick *t, int level, double *z) {
    wbc_levels *s = &t->levels;
    double next[NV];
    int found = 0, *keep = s->keep + level * M_ALL;
    s->problem.n = s->daqp.n = s->width;
    level_rows(s);
    for (int j = 0; j < NV; j++) z[j] = 0.0;
    for (int step = 0; step < LEVEL_STEPS; step++) {
        level_shift(s, z);
        const int warm = s->warm[level];
        int flag = level_active_set(t, warm ? keep : NULL);
        if (flag < 0 && warm && !t->spent) flag = level_active_set(t, NULL);
        if (flag < 0) break;
        double moved = 0.0;
        level_point(s, next);
        for (int j = 0; j < s->width; j++) {
            moved = larger(moved, fabs(next[j] - z[j]));
            z[j] = next[j];
        }
        memcpy(keep, s->sense, M_ALL * sizeof(int));
        level_multipliers(s);
        s->warm[level] = found = 1;
        if (s->width == s->rank || (step > 0 && moved <= LEVEL_SETTLED)) break;
    }
    if (found && !t->spent) {
        level_meet(t, z);
        level_multipliers(s);
    }
    return found;
}

static void begin_level_solver(wbc_tick *t) {
    wbc_levels *s = &t->levels;
    DAQPWorkspace *work = &s->daqp;
    s->problem.m = work->m = M_ALL;
    work->qp = &s->problem;
    work->settings = &t->settings;
    work->M = s->M;
    work->dupper = s->dupper;
    work->dlower = s->dlower;
    work->v = s->shift;
    work->scaling = s->soft_scaling;
    work->sense = s->sense;
    work->x = s->z;
    work->xold = s->old;
    work->lam = s->lam;
    work->lam_star = s->lam_star;
    work->u = s->u;
    work->L = s->factor;
    work->D = s->pivot;
    work->xldl = s->xldl;
    work->zldl = s->zldl;
    work->WS = s->WS;
    work->sing_ind = EMPTY_IND;
}

#endif

#endif
