/* Rows from CasADi, and the QP that they make. */
#ifndef WBC_ASSEMBLE_H
#define WBC_ASSEMBLE_H

#include "reach.h"
#include "sensed.h"
#include "spare.h"

/* H += J' diag(w) J, g -= J' diag(w) desired, for `count` rows that share the `cols` columns listed from `first`. The rows
 * are spread to the groups of 8 columns that they have entries in; left of the diagonal numbers are added too. */
INLINE void block(wbc_tick *t, int row, int count, int first, int cols) {
    const int *col = j_col + first;
    const double *J = t->jt + first;
    double spread[count * WIDE], weighted[count * cols], pull[cols];
    int group[WIDE / 8], groups = 0, place[cols];
    for (int c = 0; c < cols; c++) {
        if (groups == 0 || group[groups - 1] != col[c] / 8) group[groups++] = col[c] / 8;
        place[c] = 8 * groups - 8 + col[c] % 8;
        pull[c] = 0.0;
    }
    for (int r = 0; r < count; r++) {
        const double weight = t->weight[row + r] * t->report.factor[row + r];
        double *out = spread + r * WIDE;
        for (int b = 0; b < 8 * groups; b += 4) FOUR(out + b) = (four){0};
        for (int c = 0; c < cols; c++) out[place[c]] = J[r * cols + c];
        for (int c = 0; c < cols; c++) weighted[r * cols + c] = weight * J[r * cols + c];
        for (int c = 0; c < cols; c++) pull[c] += weighted[r * cols + c] * t->desired[row + r];
    }
    for (int a = 0; a < cols; a++) {
        double *out = t->H + col[a] * WIDE;
        t->g[col[a]] -= pull[a];
        for (int b = place[a] / 8; b < groups; b++) {
            four p = {0}, q = {0};
            for (int r = 0; r < count; r++) {
                const four each = EACH(weighted[r * cols + a]);
                p = MADD(each, GIVEN_FOUR(spread + r * WIDE + 8 * b), p);
                q = MADD(each, GIVEN_FOUR(spread + r * WIDE + 8 * b + 4), q);
            }
            FOUR(out + 8 * group[b]) += p;
            FOUR(out + 8 * group[b] + 4) += q;
        }
    }
}

/* The upper triangle of H is given, with zeros left of the diagonal in its group of 8 */
static void only_upper(wbc_tick *t) {
    for (int i = 0; i < NV; i++) upper_part(t->H + i * WIDE + (i & ~7), i & 7);
}

/* The same for rows with one non-zero each */
INLINE void diagonal(wbc_tick *t, int row, int count, int first) {
    for (int r = 0; r < count; r++) {
        const int c = j_col[first + r];
        const double wa = t->weight[row + r] * t->report.factor[row + r] * t->jt[first + r];
        t->g[c] -= wa * t->desired[row + r];
        t->H[c * WIDE + c] += wa * t->jt[first + r];
    }
}

/* Task rows without weight leave the problem, whatever their numbers are. 0 where others are not finite. */
static int usable_tasks(wbc_tick *t) {
    int ok = 1;
    for (int k = 0; k < MT; k++) {
        const int first = j_start[k], count = j_start[k + 1] - first;
        const int fine = all_finite(t->jt + first, count) && all_finite(t->desired + k, 1) && all_finite(t->report.factor + k, 1);
        if (fine) continue;
        ok &= t->weight[k] == 0.0;
        memset(t->jt + first, 0, count * sizeof(double));
        t->desired[k] = t->report.factor[k] = 0.0;
    }
    return ok;
}

static void form_bounds(wbc_tick *t) {
    for (int i = 0; i < NV; i++) {
        t->low[i] = -WBC_INF;
        t->high[i] = WBC_INF;
        t->report.owner_low[i] = t->report.owner_high[i] = -1.0;
    }
    /* In the order of sacrifice; a later block is clipped into what the earlier ones left */
    for (int k = 0; k < NB; k++) {
        const int b = bound_sequence[k];
        for (int i = 0; i < NV; i++) {
            if (t->bound_enabled[b * NV + i] == 0.0) continue;
            const double low = t->low[i], high = t->high[i];
            double from = t->bound_low[b * NV + i], to = t->bound_high[b * NV + i];
            if (from > to && from - to <= TOLERANCE * dof_scale[i]) from = to = 0.5 * (from + to);
            /* No interval, or NaN: what the other blocks leave stands, and the tick brakes */
            if (!(from <= to && from < WBC_INF && to > -WBC_INF)) {
                t->unusable = 1.0;
                continue;
            }
            t->low[i] = clamp(from, low, high);
            t->high[i] = clamp(to, low, high);
            if (t->low[i] > low) t->report.owner_low[i] = b;
            if (t->high[i] < high) t->report.owner_high[i] = b;
        }
    }
}

/* `screen`: without rows that no velocity within the bounds could violate */
static void assemble(wbc_tick *t, int screen) {
    const double *arg[4] = {t->q, t->v_last, t->p, &t->dt};
    double *res[16] = {t->report.error, t->desired, t->report.factor, t->jt, t->at, t->free_low, t->free_high,
                       t->report.margin, t->bound_low, t->bound_high, t->report.margin_factor,
#if NNZK > 0
                       t->handed,
#endif
#if HANDED_TO_LOST >= 0
                       t->handed_to_lost,
#endif
#if HANDED_TO_TORQUE >= 0
                       t->handed_to_torque,
#endif
                       t->segment, t->screw};
    rows(arg, res, t->work_iw, t->work_w, 0);
    for (int i = 0; i < NV; i++)
        for (int at = i * WIDE + (i & ~7); at < i * WIDE + WIDE; at += 8) FOUR(t->H + at) = FOUR(t->H + at + 4) = (four){0};
    memset(t->g, 0, sizeof t->g);
    /* Comparisons with NaN are false, so a row of NaN would pass as satisfied: such a tick brakes */
    t->unusable = 0.0;
    if (!(all_finite(t->jt, NNZJ) && all_finite(t->desired, MT) && all_finite(t->report.factor, MT)))
        t->unusable = !usable_tasks(t);
    for (int i = 0; i < NV; i++) t->H[i * WIDE + i] = damping[i];
    BLOCKS(block, diagonal)
    only_upper(t);
    form_bounds(t);
#if BALLS > 0
    ball_rows(t, screen);
#endif
#if SENSED > 0
    sensed_rows(t, screen);
#endif
    if (CALM) brake_for_margins(t);
    for (int n = 0; n < SPARED; n++) choose_rows(t, spare_first[n], spare_first[n + 1] - spare_first[n], spare_held[n]);
    const int finite = all_finite(t->at, NNZA);
    for (int k = 0; k < MC; k++) {
        t->report.slack[k] = t->spring[k] = 0.0;
        if (t->far[k]) {
            t->low[NV + k] = t->free_low[k];
            t->high[NV + k] = t->free_high[k] = WBC_INF;
            continue;
        }
        double *row = t->at + a_start[k];
        const int priced = price_at[k] >= 0, count = a_end[k] - a_start[k];
        const double price = priced ? smaller(t->p[price_at[k]], HIGHEST_PRICE) : 1.0;
        t->give[k] = priced && !MINIMISED(k) ? (price > 0.0 ? row_scale[k] * row_scale[k] / price : 1.0) : 0.0;
        t->left_side[k] = t->free_low[k];
        if (t->enabled[k] == 0.0 || price == 0.0 || t->left_out[k]) {
            memset(row, 0, count * sizeof(double));
            t->free_low[k] = -WBC_INF;
            t->free_high[k] = WBC_INF;
        } else if (!((finite || all_finite(row, count)) && t->free_low[k] < WBC_INF && t->free_high[k] > -WBC_INF)) {
            t->unusable = 1.0;
        }
#if BENDING > 0
        if (bent[k] && t->enabled[k] != 0.0) {
            t->free_low[k] += t->bend[k];
            t->free_high[k] += t->bend[k];
        }
#endif
        if (t->free_low[k] < -WBC_INF) t->free_low[k] = -WBC_INF;
        if (t->free_high[k] > WBC_INF) t->free_high[k] = WBC_INF;
        t->low[NV + k] = MINIMISED(k) ? -WBC_INF : t->free_low[k];
        t->high[NV + k] = MINIMISED(k) ? WBC_INF : t->free_high[k];
        /* A tick reads `at` alone */
        for (int e = a_start[k]; !screen && e < a_end[k]; e++) t->A[k * NV + a_col[e]] = t->at[e];
    }
    t->prepared = t->curved = t->lost_known = t->reduced = t->whole = 0;
#if SOFT_ROWS > 0
    t->settled = 0;
#endif
#if LEVELS > 0
    memcpy(t->straight, t->H, sizeof t->H);
#endif
    if ((CALM || (BENDING > 0 && t->curving != 0.0)) && t->plain == 0.0 && LEADING > 0 && t->unusable == 0.0) reach(t);
    for (int i = 0; (BENDING > 0 || CLOSING > 0) && t->shortened != 0.0 && i < NV; i++) {
        t->H[i * WIDE + i] += t->shortened / (dof_scale[i] * dof_scale[i]);
        t->prepared = 0;
    }
}

/* All rows of the QP */
EXPORT void wbc_tick_assemble(wbc_tick *t) { assemble(t, 0); }

#endif
