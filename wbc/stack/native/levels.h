/* Strict levels, one after the other, each in the space that the earlier ones leave: docs/levels.md, and the same in
 * numpy in wbc/qp/levels/cascade.py. */
#ifndef WBC_LEVELS_H
#define WBC_LEVELS_H

#include "level_curvature.h"

#if LEVELS > 0

/* The part of `space` that `count` rows (in its coordinates, of unit length each) do not see */
static void without(wbc_levels *s, double *rows, int count) {
    double q[NV * NV], kept[NV * NV];
    const int rank = reduce(rows, count, s->width, SHARED, s->order, q);
    into_vectors(s->space, s->width, q + rank * NV, s->width - rank, kept);
    s->width -= rank;
    memcpy(s->space, kept, s->width * NV * sizeof(double));
}

/* Row i in coordinates of the space, over its whole length */
static void local_row(const wbc_levels *s, int i, double *out) {
    const double *row = s->general + (i - NV) * NV;
    const double length = i < NV ? 1.0 : sqrt(inner(row, row, NV));
    for (int j = 0; j < s->width; j++) out[j] = length > 0.0 ? row_of(s, i, s->space + j * NV) / length : 0.0;
}

/* Equality rows leave the space; which of them depend on others is reported by -2 until it is known how far they are off */
static void take_equalities(wbc_tick *t) {
    wbc_levels *s = &t->levels;
    double rows[LEVEL_MOST * NV];
    int which[M_ALL], count = 0;
    s->width = 0;
    for (int i = 0; i < NV; i++) {
        if (s->low[i] == s->high[i]) continue;
        double *axis = s->space + s->width++ * NV;
        for (int j = 0; j < NV; j++) axis[j] = i == j;
    }
    for (int k = 0; k < MC; k++) {
        const int i = NV + k;
        t->report.dropped[k] = -1.0;
        if (row_level[k] >= 0 || t->low[i] != t->high[i]) continue;
        double *row = rows + count * NV;
        t->report.dropped[k] = -2.0;
        local_row(s, i, row);
        const double length = sqrt(inner(row, row, s->width));
        if (length <= SHARED) continue;
        for (int j = 0; j < s->width; j++) row[j] /= length;
        which[count++] = k;
    }
    const int before = s->width;
    without(s, rows, count);
    for (int r = 0; r < before - s->width; r++) t->report.dropped[which[s->order[r]]] = -1.0;
}

/* Where the cascade begins, and the bounds of all rows per unit, loosened as far as that point misses them */
static void begin_levels(wbc_tick *t) {
    wbc_levels *s = &t->levels;
    for (int i = 0; i < NV; i++) {
        s->x[i] = t->report.v[i] / dof_scale[i];
        s->low[i] = t->low[i] <= -WBC_INF ? -WBC_INF : t->low[i] / dof_scale[i];
        s->high[i] = t->high[i] >= WBC_INF ? WBC_INF : t->high[i] / dof_scale[i];
        s->on[i] = t->low[i] != t->high[i];
    }
    for (int k = 0; k < MC; k++) {
        const int i = NV + k, soft = row_level[k] >= 0;
        const double low = soft ? t->free_low[k] : t->low[i], high = soft ? t->free_high[k] : t->high[i];
        s->low[i] = low <= -WBC_INF ? -WBC_INF : low / row_scale[k];
        s->high[i] = high >= WBC_INF ? WBC_INF : high / row_scale[k];
        s->on[i] = !soft && !t->idle[k] && low != high;
        for (int j = 0; j < NV; j++) s->general[k * NV + j] = 0.0;
        for (int e = a_start[k]; e < a_end[k]; e++)
            s->general[k * NV + a_col[e]] = t->at[e] * dof_scale[a_col[e]] / row_scale[k];
    }
    memcpy(s->given_low, s->low, sizeof s->low);
    memcpy(s->given_high, s->high, sizeof s->high);
    take_equalities(t);
    for (int i = 0; i < M_ALL; i++) t->report.pushes[i] = -1.0;
}

/* Multipliers of the equality rows that push against the first level: those of its QP, which has them all */
static void held_by_equalities(wbc_tick *t) {
    wbc_report *out = &t->report;
    double v[WIDE] = {0}, residual[WIDE], size[WIDE], drive = 0.0;
    memcpy(v, out->v, sizeof out->v);
    gradient(t, v, residual, size);
    add_forces(t, v, residual, size);
    for (int i = 0; i < NV; i++) drive = larger(drive, fabs(t->g[i]) * dof_scale[i]);
    for (int i = 0; i < M_ALL; i++) drive = larger(drive, fabs(out->lambda[i]) * (i < NV ? dof_scale[i] : row_scale[i - NV]));
    for (int i = 0; i < M_ALL; i++) {
        const double *row = i < NV ? NULL : t->levels.general + (i - NV) * NV;
        const double length = row ? sqrt(inner(row, row, NV)) : 1.0;
        const double push = fabs(out->lambda[i]) * length * (i < NV ? dof_scale[i] : row_scale[i - NV]);
        if (t->low[i] == t->high[i] && push > larger(PUSHING * drive, NOISE)) out->pushes[i] = 0.0;
        else out->lambda[i] = 0.0;
    }
}

/* Bounds of rows that hold are moved to x by rounding; rows that the level minimised hold from here on */
static void pass_on(wbc_levels *s) {
    for (int i = 0; i < M_ALL; i++) {
        if (!counts(s, i)) continue;
        const double at = row_of(s, i, s->x);
        s->low[i] = smaller(at, s->low[i]);
        s->high[i] = larger(at, s->high[i]);
        s->on[i] = 1;
    }
}

/* The directions from `first` on are what is left, without those that the rows that push see */
static void leave(wbc_tick *t, int level, int first) {
    wbc_levels *s = &t->levels;
    double rows[LEVEL_MOST * NV];
    int count = 0;
    s->width -= first;
    memmove(s->space, s->basis + first * NV, s->width * NV * sizeof(double));
    for (int i = 0; i < M_ALL; i++) {
        if (s->lambda[i] == 0.0) continue;
        local_row(s, i, rows + count++ * NV);
        if (t->report.pushes[i] >= 0.0) continue;
        t->report.pushes[i] = level;
        t->report.lambda[i] = s->lambda[i] * s->scale / (i < NV ? dof_scale[i] : row_scale[i - NV]);
    }
    if (count > 0) without(s, rows, count);
}

/* Residuals of the optimality conditions: stationarity, complementarity, and a bound on the error; `gain` is how errors
 * of earlier levels count in this one */
static void judge(wbc_tick *t, const double *z, double *numbers, double *gain) {
    wbc_levels *s = &t->levels;
    double force[NV] = {0}, size[NV] = {0}, inverse = 0.0, seen = 0.0, image = 0.0, most = 0.0;
    for (int i = 0; i < M_ALL; i++) {
        if (s->force[i] == 0.0) continue;
        double low, high;
        level_sides(s, i, &low, &high);
        const double gap = row_of(s, i, s->x) - (s->force[i] > 0.0 ? high : low);
        if (!s->soft[i]) numbers[6] = larger(numbers[6], fabs(s->force[i] * gap));
        if (i < NV) force[i] += s->force[i];
        else add_to(force, s->general + (i - NV) * NV, s->force[i], NV);
    }
    for (int i = 0; i < NV; i++) most = larger(most, fabs(s->wanted[i]));
    for (int j = 0; j < s->width; j++) {
        double residual = inner(s->basis + j * NV, force, NV), terms = most;
        if (j < s->rank) {
            residual += inner(s->H + j * NV, z, s->rank) - s->right[j];
            terms += fabs(s->right[j]);
            for (int k = 0; k < s->rank; k++) terms += fabs(s->H[j * NV + k] * z[k]);
            size[j] = fabs(residual) + (NV + 4) * EPS * terms;
        }
        numbers[5] = larger(numbers[5], fabs(residual));
    }
    /* |H^-1 r| <= |R^-1| |R^-T r| */
    for (int j = 0; j < s->rank; j++) {
        double sum = 0.0;
        for (int i = 0; i <= j; i++) sum += fabs(s->inverse[i * NV + j]) * size[i];
        seen += sum * sum;
        inverse += inner(s->inverse + j * NV + j, s->inverse + j * NV + j, s->rank - j);
    }
    for (int r = 0; r < s->count; r++) image += s->weight[r] * inner(s->row + r * NV, s->row + r * NV, NV);
    numbers[7] = sqrt(inverse * seen);
    /* |H^-1 T'W J| <= |R^-1| |W^(1/2) J|, as R'R is at least T'W T */
    *gain = sqrt(inverse * image);
}

/* Level `level`, from the point and the space of the one before; 0 where the cap ended its search */
static int one_level(wbc_tick *t, int level, double *error) {
    wbc_levels *s = &t->levels;
    double z[NV] = {0}, x[NV], gain = 0.0, *numbers = t->report.levels + level * LEVEL_NUMBERS;
    const int rest = level == LEVELS;
    load_level(t, level);
    if (rest) take_all(s);
    else take_directions(t, level);
    s->curved = 0;
    if (level == 0 && t->curved) take_curvature(t);
    numbers[0] = s->rank;
    numbers[2] = s->least;
    level_quadratic(s, rest);
    if (s->curved) add_level_curvature(s);
    for (int i = 0; i < M_ALL; i++) s->lambda[i] = s->force[i] = 0.0;
    memcpy(x, s->x, sizeof x);
    int solved = invert_matrix(s->H, s->rank, s->inverse);
    if (!solved) {
        /* Weights within the level are so far apart that rounding makes H indefinite: as much as that makes it definite */
        double largest = 0.0;
        for (int i = 0; i < s->rank; i++) largest = larger(largest, s->H[i * NV + i]);
        for (int i = 0; i < s->rank; i++) s->H[i * NV + i] += ROUNDINGS * NV * EPS * largest;
        solved = invert_matrix(s->H, s->rank, s->inverse);
    }
    if (solved) {
        solve_level(s->inverse, s->rank, s->right, z);
        into_point(s, z, s->rank, x);
        if (!level_holds(s, x)) {
            solved = level_search(t, level, z);
            memcpy(x, s->x, sizeof x);
            if (solved) into_point(s, z, s->width, x);
        }
    }
    if (!solved) memset(z, 0, sizeof z);
    numbers[3] = price(s, z);
    memcpy(s->x, x, sizeof x);
    judge(t, z, numbers, &gain);
    if (!solved) numbers[5] = numbers[7] = WBC_INF;
    numbers[8] = solved;
    *error = numbers[7] = smaller(numbers[7] + *error * (1.0 + gain), WBC_INF);
    pass_on(s);
    leave(t, level, s->rank);
    numbers[1] = s->width;
    memcpy(s->reached + level * NV, s->x, sizeof s->x);
    return !t->spent;
}

/* Of rows that are not minimised, at the command */
static void find_violation(wbc_tick *t) {
    t->report.violation = t->firm_missed = 0.0;
    for (int k = 0; k < MC; k++)
        if (!MINIMISED(k)) count_violation(t, k, row_at(t, k, t->report.v));
}

/* What rows miss, how later levels have moved earlier ones, and the certificate of all levels together */
static void sum_up(wbc_tick *t) {
    wbc_levels *s = &t->levels;
    wbc_report *out = &t->report;
    for (int i = 0; i < NV; i++) out->v[i] = clamp(s->x[i] * dof_scale[i], t->low[i], t->high[i]);
    out->stationarity = out->complementarity = 0.0;
    out->error_bound = out->levels[LEVELS * LEVEL_NUMBERS + 7];
    for (int level = 0; level <= LEVELS; level++) {
        double *numbers = out->levels + level * LEVEL_NUMBERS, row[NV];
        out->stationarity = larger(numbers[5], out->stationarity);
        out->complementarity = larger(numbers[6], out->complementarity);
        for (int k = level_start[level]; level < LEVELS && k < level_start[level + 1]; k++) {
            unit_row(t, k, row);
            const double moved = inner(row, s->x, NV) - inner(row, s->reached + level * NV, NV);
            numbers[4] = larger(numbers[4], fabs(moved));
        }
    }
    find_violation(t);
    for (int k = 0; k < MC; k++) {
        const double value = row_at(t, k, out->v);
        if (MINIMISED(k)) {
            const double slack = larger(t->free_low[k] - value, value - t->free_high[k]);
            out->slack[k] = slack > 2.0 * TOLERANCE * row_scale[k] ? slack : 0.0;
        }
        if (out->dropped[k] < -1.0) out->dropped[k] = fabs(value - t->low[NV + k]);
    }
}

/* The answer of the first level's QP onto its active rows: no level moves along equalities, so that what it misses of them
 * would stay. Where contact forces are nearly free and joints are not, that is seen in torques. */
static void meet_first(wbc_tick *t) {
    double v[NV], multipliers[ACTIVE_MAX];
    for (int n = 0; n < MEETINGS && t->factored && t->daqp.n_active > 0; n++) {
        find_violation(t);
        const double missed = t->report.violation;
        memcpy(v, t->report.v, sizeof v);
        memcpy(multipliers, t->daqp.lam_star, sizeof multipliers);
        memset(t->scratch, 0, sizeof t->scratch);
        refine(t);
        find_violation(t);
        if (all_finite(t->x, NV) && t->report.violation < missed) continue;
        memcpy(t->report.v, v, sizeof v);
        memcpy(t->daqp.lam_star, multipliers, sizeof multipliers);
        break;
    }
}

/* From the answer of the first level's QP to the command; the flag */
static int all_levels(wbc_tick *t, int flag) {
    wbc_report *out = &t->report;
    double error = 0.0;
    int going = flag == WBC_SOLVED || flag == WBC_RELAXED;
    if (going) tidy(out);
    else wbc_tick_certify(t);
    memset(out->levels, 0, sizeof out->levels);
    for (int k = 0; k < MT; k++) out->share[k] = 0.0;
    for (int k = 0; k < MC; k++) out->dropped[k] = -1.0;
    for (int i = 0; i < M_ALL; i++) out->pushes[i] = -1.0;
    for (int i = 0; i < M_ALL; i++) out->lambda[i] = 0.0;
    if (going) {
        meet_first(t);
        begin_levels(t);
        if (flag == WBC_SOLVED) held_by_equalities(t);
        for (int level = 0; going && level <= LEVELS; level++) going = one_level(t, level, &error);
        sum_up(t);
        if (!going) {
            flag = out->flag = WBC_CAPPED;
            wbc_tick_certify(t);
        }
    }
    for (int k = 0; k < MT; k++) out->missed[k] = along(t, k, out->v) - t->desired[k];
    return flag;
}

#endif

#endif
