/* What gives way when the rows cannot all hold: the declared order of sacrifice. */
#ifndef WBC_RELAX_H
#define WBC_RELAX_H

#include "soft.h"

/* Whether a row of a class violates its bounds at x by more than rounding */
static int gives_way(const wbc_tick *t, int k) {
    const double value = row_at(t, k, t->x), tolerance = TOLERANCE * row_scale[k];
    return value < t->low[NV + k] - tolerance || value > t->high[NV + k] + tolerance;
}

/* A class has found its least violation at x. Where a row gave way, it and what pushed against it become equalities
 * that meet at x: all least violations lie there, and what is left to move has no boundary within rounding. Rows of
 * the class that hold may move by rounding. */
static void freeze(wbc_tick *t, int order, const char *pushing) {
    int given = 0;
    for (int k = 0; k < MC; k++) given |= row_order[k] == order && gives_way(t, k);
    for (int i = 0; given && i < NV; i++) {
        if (!pushing[i] || t->low[i] == t->high[i]) continue;
        /* The other bound is not what binds here, whatever sign the last multiplier takes */
        if (pushing[i] == LOWER) {
            t->high[i] = t->low[i];
            t->report.owner_high[i] = -1.0;
        } else {
            t->low[i] = t->high[i];
            t->report.owner_low[i] = -1.0;
        }
        t->x[i] = t->low[i];
    }
    for (int k = 0; k < MC; k++) {
        double *low = t->low + NV + k, *high = t->high + NV + k;
        const int equal = *low == *high, own = row_order[k] == order;
        if (given && row_order[k] <= order && (equal || (own ? gives_way(t, k) : pushing[NV + k]))) {
            *low = *high = row_at(t, k, t->x);
        } else if (own && !equal) {
            *low -= TOLERANCE * row_scale[k];
            *high += TOLERANCE * row_scale[k];
        }
    }
}

/* Rows of class `order` and before it as DAQP takes them, in v / dof_scale and per row_scale */
static int class_rows(wbc_tick *t, int order) {
    int found = 0;
    for (int i = 0; i < NV; i++) t->scaling[i] = 1.0 / dof_scale[i];
    for (int k = 0; k < MC; k++) {
        double *row = t->M + k * NV, square = 0.0;
        for (int j = 0; j < NV; j++) row[j] = 0.0;
        for (int e = a_start[k]; e < a_end[k]; e++) row[a_col[e]] = t->at[e] * dof_scale[a_col[e]] / row_scale[k];
        for (int j = 0; j < NV; j++) square += row[j] * row[j];
        const double scale = square > DEAD && row_order[k] <= order ? 1.0 / sqrt(square) : 0.0;
        for (int j = 0; j < NV; j++) row[j] *= scale;
        t->scaling[NV + k] = scale;
        found |= row_order[k] == order;
    }
    return found;
}

/* One proximal step: min |(v - base) / dof_scale|^2 / 2 + sum (slack / row_scale)^2 / (2 rho) */
static int least_slack(wbc_tick *t, int order, const double *base, int warm) {
    for (int i = 0; i < NV; i++) {
        t->dupper[i] = (t->high[i] - base[i]) * t->scaling[i];
        t->dlower[i] = (t->low[i] - base[i]) * t->scaling[i];
        t->sense[i] = 0;
    }
    for (int k = 0; k < MC; k++) {
        const double scale = t->scaling[NV + k] / row_scale[k], value = row_at(t, k, base);
        t->dupper[NV + k] = (t->high[NV + k] - value) * scale;
        t->dlower[NV + k] = (t->low[NV + k] - value) * scale;
        t->sense[NV + k] = row_order[k] == order ? SOFT : 0;
    }
    if (!(warm && active_set(t, 1, order, LOOSE, base) >= 0) && (t->brief || active_set(t, 0, order, LOOSE, base) < 0)) return 0;
    memcpy(t->keep, t->sense, sizeof t->keep);
    for (int i = 0; i < NV; i++) t->x[i] = clamp(t->x[i], t->low[i], t->high[i]);
    return 1;
}

/* Which active rows and bounds hold the slack of the class up: their multipliers are not small against its own */
static void find_pushing(const wbc_tick *t, int order, char *pushing) {
    const DAQPWorkspace *work = &t->daqp;
    double largest = 0.0;
    for (int i = 0; i < M_ALL; i++) pushing[i] = 0;
    for (int a = 0; a < work->n_active; a++) {
        const int i = work->WS[a];
        const double force = fabs(work->lam_star[a]) / t->scaling[i];
        if (i >= NV && row_order[i - NV] == order && force > largest) largest = force;
    }
    for (int a = 0; a < work->n_active; a++) {
        const int i = work->WS[a];
        if (fabs(work->lam_star[a]) / t->scaling[i] > PUSHING * largest)
            pushing[i] = t->sense[i] & LOWER ? LOWER : ACTIVE;
    }
}

/* The next proximal step at a price of slack that is ten times as high, if the search follows within BRIEF iterations; else
 * at the last price */
static int dearer_slack(wbc_tick *t, int order, const double *base) {
    const double rho = t->settings.rho_soft;
    t->settings.rho_soft = larger(0.1 * rho, RHO);
    t->brief = rho > RHO ? BRIEF : 0;
    const int found = least_slack(t, order, base, 1);
    t->brief = 0;
    if (found || rho <= RHO || t->spent) return found;
    t->settings.rho_soft = rho;
    return least_slack(t, order, base, 1);
}

/* The first proximal step. The price of slack may be too high for the search, which then calls rows infeasible that are
 * not: it rises from 1 step by step. */
static int first_slack(wbc_tick *t, int order, const double *base) {
    t->settings.rho_soft = RHO;
    if (least_slack(t, order, base, 0)) return 1;
    t->settings.rho_soft = 1.0;
    return !t->spent && least_slack(t, order, base, 0);
}

/* The least sum of squared slack of one class, with the bounds and the classes before it as they stand. The proximal steps
 * take the share of |v| out of the multipliers. `base`: where the classes before met, and where the slack is least. 0 where no
 * search has an answer. */
static int least_violation(wbc_tick *t, int order, double *base, char *pushing) {
    DAQPWorkspace *work = &t->daqp;
    int found = 0;
    t->factored = 0;
    work->Rinv = NULL;
    work->RinvD = (double *)dof_scale;
    work->v = NULL;
    for (int step = 0; step < PROXIMAL_STEPS; step++) {
        double moved = 0.0;
        if (!(step ? dearer_slack(t, order, base) : first_slack(t, order, base))) break;
        for (int k = 0; k < MC; k++)
            if (row_order[k] == order) moved = fmax(moved, fabs(row_at(t, k, t->x) - row_at(t, k, base)) / row_scale[k]);
        memcpy(base, t->x, WIDE * sizeof(double));
        find_pushing(t, order, pushing);
        found = 1;
        if (moved <= SETTLED && t->settings.rho_soft <= RHO) break;
    }
    t->settings.rho_soft = RHO;
    work->Rinv = t->Rinv;
    work->RinvD = NULL;
    work->v = t->ldp_v;
    return found;
}

/* A class gives way as little as it can, and is frozen there */
static int relax_class(wbc_tick *t, int order, double *base) {
    char pushing[M_ALL];
    if (!class_rows(t, order)) return 1;
    if (!least_violation(t, order, base, pushing)) return 0;
    memcpy(t->x, base, sizeof t->x);
    freeze(t, order, pushing);
    memcpy(base, t->x, sizeof t->x);
    return 1;
}

/* Whether nothing within the bounds keeps the rows that never give way: the multipliers y of their least violation add
 * them up to one row y'A x <= y'side that the whole box breaks, infinite sides counted as FAR_AWAY (Farkas). Bounds and rows
 * are those before a relaxation. */
static int impossible(wbc_tick *t) {
    double base[WIDE] = {0}, sum[NV], most = 0.0, size = 0.0, gap = 0.0;
    char pushing[M_ALL];
    if (!class_rows(t, 0) || !least_violation(t, 0, base, pushing)) return 0;
    for (int i = 0; i < NV; i++) sum[i] = 0.0;
    for (int a = 0; a < t->daqp.n_active; a++) {
        const int i = t->daqp.WS[a], k = i - NV;
        const double y = t->daqp.lam_star[a] / (k < 0 ? 1.0 : row_scale[k]);
        if (k < 0 || row_order[k] != 0) continue;
        const double side = y > 0.0 ? t->high[i] : t->low[i];
        if (fabs(side) >= WBC_INF) return 0;
        gap -= y * side;
        size += fabs(y * side);
        most = larger(most, fabs(y) * row_scale[k]);
        for (int e = a_start[k]; e < a_end[k]; e++) sum[a_col[e]] += y * t->at[e];
    }
    for (int i = 0; i < NV; i++) {
        const double reach = FAR_AWAY * dof_scale[i];
        const double x = sum[i] > 0.0 ? larger(t->low[i], -reach) : smaller(t->high[i], reach);
        gap += sum[i] * x;
        size += fabs(sum[i] * x);
    }
    return gap > SEEN * most + 1e3 * EPS * size;
}

/* The optimum over what the classes left. The set may be so thin that rounding makes it empty: then its bounds get
 * rounding, then the joints of frozen rows are fixed, and at last the point that the classes met at is the answer. */
static int optimum_of_the_rest(wbc_tick *t) {
    double low[NV], high[NV];
    memcpy(t->met, t->x, sizeof t->met);
    memcpy(low, t->low, sizeof low);
    memcpy(high, t->high, sizeof high);
    /* The bounds have moved, and with them what the equality rows contribute */
    t->prepared = 0;
    int flag = optimum(t, LOOSE);
    if (flag >= 0 || t->spent) return flag;
    for (int i = 0; i < NV; i++) {
        if (low[i] == high[i]) continue;
        t->low[i] -= TOLERANCE * dof_scale[i];
        t->high[i] += TOLERANCE * dof_scale[i];
    }
    t->prepared = 0;
    flag = optimum(t, LOOSE);
    memcpy(t->low, low, sizeof low);
    memcpy(t->high, high, sizeof high);
    if (flag >= 0 || t->spent) return flag;
    /* Joints that frozen rows speak of stay where the classes met; the others still serve the tasks */
    for (int k = 0; k < MC; k++)
        for (int e = a_start[k]; t->low[NV + k] == t->high[NV + k] && e < a_end[k]; e++)
            if (t->at[e] != 0.0) t->low[a_col[e]] = t->high[a_col[e]] = t->met[a_col[e]];
    t->prepared = 0;
    flag = optimum(t, LOOSE);
    if (flag >= 0 || t->spent) return flag;
    memcpy(t->low, low, sizeof low);
    memcpy(t->high, high, sizeof high);
    memcpy(t->x, t->met, sizeof t->met);
    t->daqp.n_active = 0;
    /* Not an optimum, so nothing for the certificate to refine */
    t->factored = 0;
    return 0;
}

/* What a violation of one unit of a class costs that gives way where limits of motion do, per largest entry on the diagonal
 * of H; 0: it never does */
static double class_price(int order) { return order < HOLDS ? 0.0 : order == HOLDS ? HOLD_PRICE : MOTION_PRICE; }

/* Equality row k at a price: a part of H and g, and no row */
static void as_task(wbc_tick *t, int k, double price) {
    for (int e = a_start[k]; e < a_end[k]; e++) {
        const double f = price * t->at[e];
        t->g[a_col[e]] -= f * t->low[NV + k];
        for (int c = e; c < a_end[k]; c++) t->H[a_col[e] * WIDE + a_col[c]] += f * t->at[c];
    }
    t->spring[k] = price;
    t->low[NV + k] = -WBC_INF;
    t->high[NV + k] = WBC_INF;
    t->idle[k] = 1;
}

/* Rows that give way at a price reach to where they are at x */
static void widen(wbc_tick *t, const double *x) {
    for (int k = 0; k < MC; k++) {
        if (!(t->elastic[k] > 0.0)) continue;
        const double value = row_at(t, k, x);
        t->low[NV + k] = smaller(t->free_low[k], value);
        t->high[NV + k] = larger(t->free_high[k], value);
    }
}

/* The optimum where what is held and limits of motion give way at prices, in one search: of a robot whose base floats what
 * motors and contacts can do, the classes before, has an answer unless a wrench must be larger than motors bear. */
static int elastic_search(wbc_tick *t) {
    double largest = 0.0, soft_scaling[M_ALL];
    int flag = -1, warm = t->warm;
    for (int i = 0; i < NV; i++) largest = larger(largest, t->H[i * WIDE + i] * dof_scale[i] * dof_scale[i]);
    for (int i = 0; i < NV; i++) {
        const double firm = (i < DOFS ? STEADY : WRENCH_STEADY) * largest / (dof_scale[i] * dof_scale[i]);
        t->H[i * WIDE + i] += firm;
        if (i < DOFS) t->g[i] += firm * REST_RATE * t->v_last[i];
    }
    for (int k = 0; k < MC; k++) {
        const double price = class_price(row_order[k]) * largest / (row_scale[k] * row_scale[k]);
        const int given = price > 0.0 && !MINIMISED(k) && !t->idle[k] && !(t->give[k] > 0.0);
        if (given && t->low[NV + k] == t->high[NV + k]) as_task(t, k, price);
        else if (given) t->elastic[k] = 1.0 / price;
    }
#if SOFT_ROWS > 0
    memset(t->held, 0, sizeof t->held);
    memcpy(t->own_H, t->H, sizeof t->H);
    memcpy(t->own_g, t->g, sizeof t->g);
#endif
    t->prepared = t->factored = 0;
    if (!factor(t)) {
        steady(t->H);
        if (!factor(t)) return -1;
    }
    solve_transposed(t, t->y);
    see_rows(t);
    /* A price may be too high for the search, which then calls rows infeasible that are not */
    for (double cheaper = 1.0; flag < 0 && cheaper <= CHEAPEST && !t->spent; cheaper *= warm ? 1.0 : 10.0, warm = 0) {
        memcpy(soft_scaling, t->scaling, sizeof soft_scaling);
        for (int i = 0; i < M_ALL; i++) t->sense[i] = 0;
        for (int k = 0; k < MC; k++) {
            const double loose = softness(t, k);
            if (!(loose > 0.0) || t->idle[k]) continue;
            t->sense[NV + k] = SOFT;
            soft_scaling[NV + k] *= sqrt(loose * (t->give[k] > 0.0 ? 1.0 : cheaper));
        }
        t->daqp.scaling = soft_scaling;
        t->settings.rho_soft = 1.0;
        flag = active_set(t, warm, HOLDS, TIGHT, NULL);
        t->daqp.scaling = t->scaling;
        t->settings.rho_soft = RHO;
    }
    if (flag < 0) return flag;
    for (int k = 0; k < MC; k++) {
        const double value = row_at(t, k, t->x);
        if (LEVELS > 0 && t->spring[k] > 0.0) t->low[NV + k] = t->high[NV + k] = value;
    }
    widen(t, t->x);
    memcpy(t->met, t->x, sizeof t->met);
    /* The same point as that of hard rows, whose factors a refinement takes */
    for (int i = 0; i < M_ALL; i++) {
        t->keep[i] = t->sense[i];
        t->sense[i] = i >= NV && t->give[i - NV] > 0.0 ? SOFT : 0;
    }
    shift(t);
    if (active_set(t, 1, HOLDS, LOOSE, NULL) >= 0) return 0;
    memcpy(t->x, t->met, sizeof t->met);
    t->daqp.n_active = 0;
    t->factored = 0;
    return 0;
}

/* The same, or the problem as it was where the search has no answer. Accelerations may be thousands, of which the tolerance of
 * other searches is less than rounding. */
static int elastic(wbc_tick *t) {
    const double tolerance = t->settings.primal_tol;
    double H[NV * WIDE], g[WIDE], low[M_ALL], high[M_ALL];
    memcpy(H, t->H, sizeof t->H);
    memcpy(g, t->g, sizeof t->g);
    memcpy(low, t->low, sizeof low);
    memcpy(high, t->high, sizeof high);
    t->settings.primal_tol = ELASTIC_TOLERANCE;
    const int flag = elastic_search(t);
    t->settings.primal_tol = tolerance;
    if (flag >= 0 || t->spent) return flag;
    memcpy(t->H, H, sizeof t->H);
    memcpy(t->g, g, sizeof t->g);
    memcpy(t->low, low, sizeof low);
    memcpy(t->high, high, sizeof high);
    memset(t->spring, 0, sizeof t->spring);
    memset(t->elastic, 0, sizeof t->elastic);
    t->prepared = 0;
    return flag;
}

static int relaxed(wbc_tick *t) {
    double base[WIDE] = {0};
    t->reduced = 0;
    t->whole = 1;
    if (ELASTIC) {
        const int flag = elastic(t);
        if (flag >= 0 || t->spent) return flag;
    }
    t->warm = 0;
    memset(t->idle, 0, sizeof t->idle);
    /* Rows of class 0 never give way */
    if (LAST_ORDER == 0) return -1;
    for (int order = 1; order <= LAST_ORDER; order++)
        if (!relax_class(t, order, base)) return -1;
    return optimum_of_the_rest(t);
}

#endif
