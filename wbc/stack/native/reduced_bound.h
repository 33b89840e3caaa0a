/* The certificate of an answer to the reduced problem, see reduced.h, and corrections of it. */
#ifndef WBC_REDUCED_BOUND_H
#define WBC_REDUCED_BOUND_H

#include "wide.h"

/* Forces of the rows that were taken out: what the others leave on the variables that they give */
static void add_equality_forces(wbc_tick *t, const double *v, double *residual, double *size) {
    const DAQPWorkspace *work = &t->daqp;
    double rest[WIDE], lambda[WIDE];
    memcpy(rest, residual, sizeof rest);
    for (int a = 0; a < work->n_active; a++)
        if (work->WS[a] < NV) rest[work->WS[a]] += work->lam_star[a];
    multipliers_of(t, rest, lambda);
    for (int n = 0; n < t->reduced; n++) {
        const int k = t->equal_row[n];
        double value = -t->low[NV + k], bulk = fabs(value);
        t->report.lambda[NV + k] = lambda[n];
        for (int e = a_start[k]; e < a_end[k]; e++) {
            const double part = t->at[e] * lambda[n];
            const double term = t->at[e] * v[a_col[e]];
            value += term;
            bulk += fabs(term);
            residual[a_col[e]] += part;
            size[a_col[e]] += fabs(part);
        }
        t->missed[n] = value;
        t->missed_size[n] = fabs(value) + (a_end[k] - a_start[k] + 2) * EPS * bulk;
        t->report.complementarity = larger(fabs(lambda[n] * value), t->report.complementarity);
    }
}

/* |v_i - v*_i| <= |row i of T| (| |T'| size | + |H^1/2 s| + the part of the active rows) + |s_i|, where no v that misses the equality
 * rows by as much as v does is further from one that keeps them than s, rounding included */
static double reduced_bound(const wbc_tick *t, const double *size) {
    const DAQPWorkspace *work = &t->daqp;
    double missed[WIDE], shift[WIDE], image[WIDE], part[ACTIVE_MAX], length = 0.0, rest = 0.0, reach = 0.0, most = 0.0;
    for (int n = 0; n < t->reduced; n++) missed[n] = t->missed_size[n];
    by_rows(t, missed, shift, 1);
    for (int k = 0; k < t->reduced; k++) {
        const int i = t->given[k];
        rest += t->H[i * WIDE + i] * shift[i] * shift[i];
        most = larger(shift[i], most);
    }
    rest = sqrt(t->reduced * larger(rest, 0.0));
    for (int a = 0, at = 0; a < work->n_active; a++, at++) {
        const int i = work->WS[a], k = i - NV;
        double gap = fabs(side_gap(t, a)), moved = k < 0 ? shift[i] : 0.0;
        for (int e = k < 0 ? 0 : a_start[k]; k >= 0 && e < a_end[k]; e++) moved += fabs(t->at[e]) * shift[a_col[e]];
        gap += moved * t->scaling[i];
        for (int b = 0; b < a; b++) gap += fabs(t->L[at++]) * part[b];
        part[a] = gap;
        length += gap * gap / t->D[a];
    }
    rest += sqrt(length);
    for (int at = 0; at < THIN; at += 4) {
        four even = {0}, odd = {0};
        int i = 0;
        for (; i + 1 < NV; i += 2) {
            even = MADD(EACH(size[i]), SIZE_OF_FOUR(GIVEN_FOUR(t->through + i * WIDE + at)), even);
            odd = MADD(EACH(size[i + 1]), SIZE_OF_FOUR(GIVEN_FOUR(t->through + (i + 1) * WIDE + at)), odd);
        }
        if (i < NV) even = MADD(EACH(size[i]), SIZE_OF_FOUR(GIVEN_FOUR(t->through + i * WIDE + at)), even);
        FOUR(image + at) = even + odd;
    }
    for (int i = 0; i < DOFS; i++) reach = larger(thin_dot(t->through + i * WIDE, t->through + i * WIDE), reach);
    return sqrt(reach) * (sqrt(thin_dot(image, image)) + rest) + most;
}

/* One Newton step on the active set: x = v - P missed + T dy, where equality rows are missed by `missed`, and
 * `residual`, or none, is left of the stationarity;   dy + M' mu = -T'(residual + H dx),   M dy = side - M y */
static void correct_reduced(wbc_tick *t, const double *missed, const double *residual) {
    DAQPWorkspace *work = &t->daqp;
    double moved[WIDE], dy[WIDE], mu[ACTIVE_MAX];
    by_rows(t, missed, moved, 0);
    for (int i = 0; i < WIDE; i++) moved[i] = -moved[i];
    reduced_forces(t, moved, residual, dy);
    for (int at = 0; at < THIN; at += 4) FOUR(dy + at) = -GIVEN_FOUR(dy + at);
    for (int a = 0; a < work->n_active; a++) {
        const int i = work->WS[a];
        mu[a] = side_gap(t, a) + t->scaling[i] * (i < NV ? moved[i] : row_at(t, i - NV, moved));
        for (int c = 0; c < t->width; c++) mu[a] += t->seen[i * t->width + c] * dy[c];
    }
    solve_gram(t, work->n_active, mu);
    for (int a = 0; a < work->n_active; a++) {
        const int i = work->WS[a];
        for (int c = 0; c < t->width; c++) dy[c] -= mu[a] * t->seen[i * t->width + c];
        work->lam_star[a] += mu[a] * t->scaling[i];
    }
    for (int i = 0; i < NV; i++) t->x[i] = t->report.v[i] + moved[i] + thin_dot(t->through + i * WIDE, dy);
}

#endif
