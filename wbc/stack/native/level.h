/* One strict level: its rows, the directions that it takes, its optimum, and what it costs. */
#ifndef WBC_LEVEL_H
#define WBC_LEVEL_H

#include "level_search.h"

#if LEVELS > 0

/* Task row k per unit, of v / dof_scale, with its fading in it */
static void unit_row(const wbc_tick *t, int k, double *out) {
    const double f = t->weight[k] > 0.0 && t->report.factor[k] > 0.0 ? sqrt(t->report.factor[k]) / task_scale[k] : 0.0;
    for (int i = 0; i < NV; i++) out[i] = 0.0;
    for (int e = j_start[k]; f != 0.0 && e < j_start[k + 1]; e++) out[j_col[e]] = f * t->jt[e] * dof_scale[j_col[e]];
}

/* The weight of a row that is minimised, in its unit; 0 where it is switched off */
static double row_price(const wbc_tick *t, int k) { return price_at[k] >= 0 ? t->p[price_at[k]] : 1.0; }

/* The weight of the heaviest row of a level, soft rows included: the others count beside it */
static double heaviest(const wbc_tick *t, int level) {
    double most = 0.0;
    for (int k = 0; k < MC; k++)
        if (row_level[k] == level && !t->far[k]) most = larger(most, row_price(t, k));
    for (int k = level_start[level]; k < level_start[level + 1]; k++)
        if (t->report.factor[k] > 0.0) most = larger(most, t->weight[k] * task_scale[k] * task_scale[k]);
    return most > 0.0 ? most : 1.0;
}

/* Rows, weights and what is wanted of `level`, the least velocity where that is LEVELS */
static void load_level(wbc_tick *t, int level) {
    wbc_levels *s = &t->levels;
    s->count = 0;
    for (int i = 0; i < M_ALL; i++) s->soft[i] = i >= NV && row_level[i - NV] == level && !t->far[i - NV] && row_price(t, i - NV) > 0.0;
    for (int i = 0; i < NV; i++) s->wanted[i] = 0.0;
    s->scale = 1.0;
    if (level == LEVELS) return;
    s->scale = heaviest(t, level);
    for (int i = NV; i < M_ALL; i++) s->give[i] = s->soft[i] ? s->scale / row_price(t, i - NV) : 0.0;
    for (int k = level_start[level]; k < level_start[level + 1]; k++, s->count++) {
        double *row = s->row + s->count * NV;
        unit_row(t, k, row);
        const double rate = sqrt(larger(t->report.factor[k], 0.0)) / task_scale[k] * t->desired[k];
        s->weight[s->count] = t->weight[k] * task_scale[k] * task_scale[k] / s->scale;
        add_to(s->wanted, row, s->weight[s->count] * rate, NV);
    }
    /* The first level's, as its gains were changed where joints could not brake */
    for (int i = 0; level == 0 && LEADING > 0 && i < NV; i++) s->wanted[i] = -t->g[i] * dof_scale[i] / s->scale;
}

/* Directions that the level takes come first in `basis`, with their singular values and dampings */
static void take_directions(wbc_tick *t, int level) {
    wbc_levels *s = &t->levels;
    double local[LEVEL_MOST * NV], *q = s->direction;
    for (int r = 0; r < s->count; r++) {
        double *row = s->row + r * NV;
        for (int j = 0; j < s->width; j++) local[r * NV + j] = inner(row, s->space + j * NV, NV);
        const double left = inner(local + r * NV, local + r * NV, s->width), all = inner(row, row, NV);
        t->report.share[level_start[level] + r] = all > 0.0 ? sqrt(left / all) : 1.0;
    }
    const int rank = reduce(local, s->count, s->width, NOTHING, s->order, q);
    for (int j = 0; j < rank; j++)
        for (int r = 0; r < s->count; r++) s->column[j * LEVEL_MOST + r] = local[r * NV + j];
    s->least = least_singular(local, rank);
    s->rank = rank;
    for (int j = 0; j < rank; j++) s->damped[j] = 0.0;
    if (s->least < ONSET) {
        separate(s->column, rank, s->count, q, s->width);
        s->rank = 0;
        s->least = WBC_INF;
        for (int j = 0; j < rank; j++) {
            const double sigma = sqrt(inner(s->column + j * LEVEL_MOST, s->column + j * LEVEL_MOST, s->count));
            if (sigma < LEFT_FREE) continue;
            const double share = larger(1.0 - sigma * sigma / (ONSET * ONSET), 0.0);
            exchange(s->column + j * LEVEL_MOST, s->column + s->rank * LEVEL_MOST, s->count);
            exchange(q + j * NV, q + s->rank * NV, s->width);
            s->damped[s->rank++] = DAMPING * share * share;
            s->least = smaller(s->least, sigma);
        }
    }
    s->seen = s->rank;
    into_vectors(s->space, s->width, q, s->width, s->basis);
}

/* All that is left, for the least velocity */
static void take_all(wbc_levels *s) {
    s->rank = s->seen = s->width;
    s->least = s->width > 0 ? 1.0 : WBC_INF;
    memcpy(s->basis, s->space, sizeof s->basis);
    for (int j = 0; j < s->width; j++) s->damped[j] = 0.0;
}

/* H, and the right-hand side without and with damping, in the directions that are taken */
static void level_quadratic(wbc_levels *s, int rest) {
    double descent[NV];
    for (int i = 0; i < NV; i++) descent[i] = rest ? -s->x[i] : s->wanted[i];
    for (int r = 0; r < s->count; r++) add_to(descent, s->row + r * NV, -s->weight[r] * inner(s->row + r * NV, s->x, NV), NV);
    for (int i = 0; i < s->rank; i++) {
        const double *basis = s->basis + i * NV;
        s->plain[i] = inner(basis, descent, NV);
        s->right[i] = s->plain[i] - s->damped[i] * inner(basis, s->x, NV);
        for (int j = i; j < s->rank; j++) {
            double sum = i == j ? s->damped[i] + (rest ? 1.0 : 0.0) : 0.0;
            for (int r = 0; j < s->seen && r < s->count; r++)
                sum += s->weight[s->order[r]] * s->column[i * LEVEL_MOST + r] * s->column[j * LEVEL_MOST + r];
            s->H[i * NV + j] = s->H[j * NV + i] = sum;
        }
    }
}

/* inverse = R^-1 with matrix = R'R, both upper; 0 where it is not positive definite */
static int invert_matrix(const double *matrix, int size, double *inverse) {
    double R[NV * NV];
    for (int i = 0; i < size; i++)
        for (int j = i; j < size; j++) {
            double sum = matrix[i * NV + j];
            for (int k = 0; k < i; k++) sum -= R[k * NV + i] * R[k * NV + j];
            if (i == j && !(sum > 0.0)) return 0;
            R[i * NV + j] = i == j ? sqrt(sum) : sum / R[i * NV + i];
        }
    for (int j = 0; j < size; j++)
        for (int i = j; i >= 0; i--) {
            double sum = i == j;
            for (int k = i + 1; k <= j; k++) sum -= R[i * NV + k] * inverse[k * NV + j];
            inverse[i * NV + j] = sum / R[i * NV + i];
        }
    return 1;
}

/* y = R^-1 R^-T b */
static void solve_level(const double *inverse, int size, const double *b, double *y) {
    double half[NV];
    for (int j = 0; j < size; j++) {
        half[j] = 0.0;
        for (int i = 0; i <= j; i++) half[j] += inverse[i * NV + j] * b[i];
    }
    for (int i = 0; i < size; i++) y[i] = inner(inverse + i * NV + i, half + i, size - i);
}

/* x += the directions up to `count`, by z */
static void into_point(const wbc_levels *s, const double *z, int count, double *x) {
    for (int j = 0; j < count; j++) add_to(x, s->basis + j * NV, z[j], NV);
}

/* How far damping moves the level's rows, or a bound on it */
static double price(const wbc_levels *s, const double *y) {
    double matrix[NV * NV], inverse[NV * NV], right[NV], best[NV], exact = 0.0, bound = 0.0;
    int damped = 0;
    for (int i = 0; i < s->rank; i++) damped |= s->damped[i] > 0.0;
    if (!damped) return 0.0;
    /* Per singular value, in which the rows are well scaled however small one is */
    double sigma[NV];
    for (int i = 0; i < s->rank; i++) {
        const double *column = s->column + i * LEVEL_MOST;
        sigma[i] = sqrt(inner(column, column, s->count));
    }
    for (int i = 0; i < s->rank; i++) {
        right[i] = s->plain[i] / sigma[i];
        for (int j = 0; j < s->rank; j++)
            matrix[i * NV + j] = (s->H[i * NV + j] - (i == j ? s->damped[i] : 0.0)) / (sigma[i] * sigma[j]);
    }
    if (!invert_matrix(matrix, s->rank, inverse)) return WBC_INF;
    solve_level(inverse, s->rank, right, best);
    for (int i = 0; i < s->rank; i++) best[i] -= sigma[i] * y[i];
    for (int i = 0; i < s->rank; i++) exact += best[i] * inner(matrix + i * NV, best, s->rank);
    for (int i = 0; i < s->rank; i++) {
        double fastest = 0.0, reached = inner(s->basis + i * NV, s->x, NV) + y[i];
        for (int j = 0; j < NV; j++)
            fastest += fabs(s->basis[i * NV + j]) * larger(fabs(s->low[j]), fabs(s->high[j]));
        if (s->damped[i] > 0.0) bound += s->damped[i] * larger(fastest * fastest - reached * reached, 0.0);
    }
    return sqrt(larger(smaller(exact, bound), 0.0));
}

#endif

#endif
