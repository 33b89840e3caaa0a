/* What one step along the Jacobians cannot do: errors that no step removes, and speeds that no joint can stop.
 * The formulas are in docs/reach.md. */
#ifndef WBC_REACH_H
#define WBC_REACH_H

#include "kept.h"

/* A step up to here [rad, or characteristic lengths] is what the Jacobians say */
#define TRUSTED 2.0
/* A joint this near to a limit [rad, or characteristic lengths] is at it, and is near it up to twice of it */
#define AT_LIMIT 0.02
/* Slopes above this share of the steepest one push in full */
#define PUSHED 0.01
/* Up to this share, what is left of an error is as good as removed; from twice of it on it counts in full */
#define REMOVED 0.02
/* Curvature below this share of the least pivot of H does not count; it counts in full from twice of it on */
#define NEGLIGIBLE 0.05
/* Least pivot of H with the curvature in it, as a share of the largest entry of the curvature; never less than
 * without it */
#define LEAST_PIVOT 1e-4
/* Share of the acceleration limits that slowing down towards the optimum may take */
#define BRAKING 1.0
/* Corrections of a step with residuals in wide arithmetic, where the squared pivots of the metric are further apart */
#define SHARPENED 3
#define APART 1e6
/* Joints that move by less in a tick are still [rad, or characteristic lengths] */
#define MOVELESS 1e-7
/* Corrections of the step that follows moving targets */
#define CORRECTIONS 2

/* out += J' diag(weight) x, and out = J v, for rows that share their columns and for rows with one non-zero each, as in
 * assemble.h */
INLINE void gather_block(const wbc_tick *t, const double *x, double *out, int row, int count, int first, int cols) {
    const double *J = t->jt + first;
    double sum[cols];
    for (int c = 0; c < cols; c++) sum[c] = 0.0;
    for (int r = 0; r < count; r++) {
        const double f = t->weight[row + r] * t->report.factor[row + r] * x[row + r];
        for (int c = 0; c < cols; c++) sum[c] += f * J[r * cols + c];
    }
    for (int c = 0; c < cols; c++) out[j_col[first + c]] += sum[c];
}

INLINE void gather_single(const wbc_tick *t, const double *x, double *out, int row, int count, int first) {
    for (int r = 0; r < count; r++)
        out[j_col[first + r]] += t->weight[row + r] * t->report.factor[row + r] * x[row + r] * t->jt[first + r];
}

INLINE void along_block(const wbc_tick *t, const double *v, double *out, int row, int count, int first, int cols) {
    double part[cols];
    for (int c = 0; c < cols; c++) part[c] = v[j_col[first + c]];
    for (int r = 0; r < count; r++) {
        double sum = 0.0;
        for (int c = 0; c < cols; c++) sum += t->jt[first + r * cols + c] * part[c];
        out[row + r] = sum;
    }
}

INLINE void along_single(const wbc_tick *t, const double *v, double *out, int row, int count, int first) {
    for (int r = 0; r < count; r++) out[row + r] = t->jt[first + r] * v[j_col[first + r]];
}

/* out = J' diag(weight) x, of the first level's rows. Those without weight must be finite too. */
static void gather(const wbc_tick *t, const double *x, double *out) {
    (void)t, (void)x; /* of stacks without task rows */
    for (int i = 0; i < WIDE; i++) out[i] = 0.0;
#define MANY(t, ...) gather_block(t, x, out, __VA_ARGS__)
#define SINGLE(t, ...) gather_single(t, x, out, __VA_ARGS__)
    BLOCKS(MANY, SINGLE)
#undef MANY
#undef SINGLE
}

/* out = J v, of the first level's rows */
static void along_all(const wbc_tick *t, const double *v, double *out) {
    (void)t, (void)v;
    for (int k = 0; k < LEADING; k++) out[k] = 0.0;
#define MANY(t, ...) along_block(t, v, out, __VA_ARGS__)
#define SINGLE(t, ...) along_single(t, v, out, __VA_ARGS__)
    BLOCKS(MANY, SINGLE)
#undef MANY
#undef SINGLE
}

/* Row k of J times v */
INLINE double along(const wbc_tick *t, int k, const double *v) {
    double sum = 0.0;
    for (int e = j_start[k]; e < j_start[k + 1]; e++) sum += t->jt[e] * v[j_col[e]];
    return sum;
}

/* x = H^-1 b, in the metric that the factor has; of a reduced problem among the motions that are left */
static void solve_with(const wbc_tick *t, const double *b, double *x) {
    double y[WIDE];
    if (REDUCES && t->reduced) {
        solve_reduced(t, t->reduced_inverse, b, x);
        return;
    }
    memcpy(y, b, sizeof y);
    solve_transposed(t, y);
    solve_upper(t, y, x);
}

static double largest_step(const double *x) {
    double size[NV], largest = 0.0;
    for (int i = 0; i < DOFS; i++) size[i] = fabs(x[i]) / dof_scale[i];
    for (int i = 0; i < DOFS; i++) largest = larger(largest, size[i]);
    return largest;
}

/* 1 for joints that may move, 0 for those that bounds stop or their tasks push against a position limit; 1 if there are such */
static int find_free(const wbc_tick *t, const double *slope, double *free) {
    double steepest = 0.0;
    int blocked = 0;
    for (int i = 0; i < NV; i++) steepest = larger(steepest, fabs(slope[i]) * dof_scale[i]);
    for (int i = 0; i < WIDE; i++) free[i] = 1.0;
    for (int i = 0; i < NV; i++) {
        if (t->stopped[i] != 0.0) {
            free[i] = 0.0;
            blocked = 1;
            continue;
        }
        if (stop_at[i] < 0 || t->bound_enabled[stop_at[i]] == 0.0) continue;
        const double q = t->q[stop_q[i]], slack = slope[i] < 0.0 ? stop_high[i] - q : q - stop_low[i];
        if (slack >= 2.0 * AT_LIMIT * dof_scale[i]) continue;
        const double near = clamp(2.0 - slack / (AT_LIMIT * dof_scale[i]), 0.0, 1.0);
        const double pushed = clamp(fabs(slope[i]) * dof_scale[i] / (PUSHED * steepest + DBL_MIN), 0.0, 1.0);
        free[i] = 1.0 - near * pushed;
        blocked |= free[i] < 1.0;
    }
    return blocked;
}

/* Entries between a blocked joint and others times 1 - share (1 - free free'): that of the others is 1 */
INLINE void blend(double *matrix, const double *free, double share) {
    for (int i = 0; i < NV; i++) {
        if (free[i] == 1.0) continue;
        for (int j = 0; j < i; j++)
            if (free[j] == 1.0) matrix[j * WIDE + i] *= 1.0 - share * (1.0 - free[i]);
        for (int j = i + 1; j < NV; j++) matrix[i * WIDE + j] *= 1.0 - share * (1.0 - free[i] * free[j]);
    }
}

/* The factor of H, with equality rows in it or taken out */
static int refactor(wbc_tick *t) { return REDUCES && t->reduced ? factor_reduced(t) : factor(t); }

/* R = factor of H with blocked joints cut off from the others, and `more` on the diagonal */
static int cut_off(wbc_tick *t, const double *free, double more) {
    if (REDUCES && t->reduced) return t->prepared = factor_reduced(t);
    load(t);
    blend(t->R, free, 1.0);
    for (int i = 0; more != 0.0 && i < NV; i++) t->R[i * WIDE + i] += more / (dof_scale[i] * dof_scale[i]);
    t->prepared = 0;
    return decompose(t);
}

#if NNZK > 0

/* The least and the largest pivot of the factor, of v / dof_scale */
static void find_pivots(const wbc_tick *t, double *least, double *most) {
    double pivot[NV];
    *least = WBC_INF, *most = 0.0;
    for (int a = 0; REDUCES && t->reduced && a < t->width; a++) {
        *least = smaller(*least, t->reduced_R[a * WIDE + a]);
        *most = larger(*most, t->reduced_R[a * WIDE + a]);
    }
    if (REDUCES && t->reduced) return;
    for (int i = 0; i < NV; i++) pivot[i] = dof_scale[i] / t->inverse_diagonal[i];
    for (int i = 0; i < NV; i++) {
        *least = smaller(*least, pivot[i] * pivot[i]);
        *most = larger(*most, pivot[i] * pivot[i]);
    }
}

/* What a metric step leaves of the slope: r -= f a a' x for a row a, blocked joints cut off */
INLINE void less_row(const double *a, const int *col, int count, double f, const double *free, const double *x, wide *r) {
    wide sum = 0.0L;
    for (int e = 0; e < count; e++) sum += (wide)a[e] * free[col[e]] * x[col[e]];
    sum *= f;
    for (int e = 0; e < count; e++) {
        const double open = free[col[e]];
        r[col[e]] -= a[e] * (open * sum + (1.0 - open * open) * f * a[e] * (wide)x[col[e]]);
    }
}

/* The solution x for b in the metric of R, at rounding level however far its pivots are apart: the errors that a step
 * leaves are small differences, and the curvature along them must not be noise. `more` is on the diagonal besides. */
static void sharpen(const wbc_tick *t, const double *free, double more, const double *b, double *x) {
    double least, most;
    if (REDUCES && t->reduced) return;
    find_pivots(t, &least, &most);
    for (int n = 0; most > APART * least && n < SHARPENED; n++) {
        wide r[NV];
        double rest[WIDE] = {0}, change[WIDE];
        for (int i = 0; i < NV; i++) {
            const double fixed = t->low[i] == t->high[i] ? t->stiffness : 0.0;
            r[i] = b[i] - (damping[i] + (more + fixed) / (dof_scale[i] * dof_scale[i])) * (wide)x[i];
        }
        for (int k = 0; k < LEADING; k++) {
            const double f = t->weight[k] * t->report.factor[k];
            if (f != 0.0) less_row(t->jt + j_start[k], j_col + j_start[k], j_start[k + 1] - j_start[k], f, free, x, r);
        }
        for (int k = 0; k < MC; k++)
            if (t->strength[k] != 0.0) less_row(t->at + a_start[k], a_col + a_start[k], a_end[k] - a_start[k], t->strength[k], free, x, r);
        for (int i = 0; i < NV; i++) rest[i] = (double)r[i];
        solve_with(t, rest, change);
        for (int i = 0; i < NV; i++) x[i] += change[i];
        if (largest_step(change) <= EPS * largest_step(x)) break;
    }
}

/* What on the diagonal of the metric, in units of dof_scale, keeps a step of this length down the slope to about TRUSTED */
static double held_short(const double *slope, double length) {
    double steepest = 0.0;
    for (int i = 0; i < NV; i++) steepest = larger(steepest, fabs(slope[i]) * dof_scale[i]);
    return steepest / TRUSTED * (1.0 - TRUSTED / length);
}

/* The step of the linear model, kept to TRUSTED where it asks for more, in R, which it changes then, by `more`; 0 for none */
static int trusted_step(wbc_tick *t, const double *free, const double *slope, double *step, double *more) {
    solve_with(t, slope, step);
    sharpen(t, free, 0.0, slope, step);
    const double length = largest_step(step);
    if (length > TRUSTED) {
        *more = held_short(slope, length);
        if (REDUCES && t->reduced) return solve_stiffened(t, *more, slope, step);
        if (!cut_off(t, free, *more)) return 0;
        solve_with(t, slope, step);
        sharpen(t, free, *more, slope, step);
    }
    for (int i = 0; i < NV; i++) step[i] *= free[i];
    return 1;
}

/* Weighted errors that the step in the metric R leaves, and what equality rows hold against them; `changed`: R is another one then */
static int left_over(wbc_tick *t, const double *free, const double *error, const double *whole, double *force, int *changed) {
    double step[WIDE], slope[WIDE] = {0}, more = 0.0;
    /* What blocked joints are asked for is not asked of the others */
    for (int i = 0; i < NV; i++) slope[i] = free[i] * whole[i];
    const int ok = trusted_step(t, free, slope, step, &more);
    *changed |= more != 0.0 && !(REDUCES && t->reduced);
    if (!ok) return 0;
    along_all(t, step, force);
    for (int k = 0; k < LEADING; k++) force[k] = t->weight[k] * t->report.factor[k] * (error[k] - force[k]);
    for (int k = LEADING; k < MT; k++) force[k] = 0.0;
    if (KEPT) without_kept(t, step, force);
    if (REDUCES && t->reduced) held_by_reduced(t, slope, step, more, force);
    else held_back(t, step, force);
    return 1;
}

/* What bounds on velocities let a command leave of errors counts where it is more than what a step leaves, and `whole` becomes what it is
 * a part of */
static void held_by_bounds(const wbc_tick *t, double *force, double *whole) {
    int any = 0;
    for (int k = 0; k < LEADING; k++) any |= t->shortfall[k] != 0.0;
    for (int k = 0; any && k < LEADING; k++) {
        const double f = t->weight[k] * t->report.factor[k];
        whole[k] = smaller(whole[k], fabs(f * t->dt * t->desired[k]));
        if (fabs(f * t->shortfall[k]) > fabs(force[k])) force[k] = f * t->shortfall[k];
    }
}

/* Share in [0, 1] of the curvature that counts, by the errors that are left and the least pivot of H */
static double counted(const double *each, const double *force, double least) {
    double size = 0.0, whole = 0.0;
    for (int k = 0; k < LEADING; k++) {
        size += fabs(force[k]) * force_scale[k];
        whole += each[k] * force_scale[k];
    }
    const double counts = clamp(size / (NEGLIGIBLE * least) - 1.0, 0.0, 1.0);
    return counts * clamp(size / (REMOVED * whole + DBL_MIN) - 1.0, 0.0, 1.0);
}

/* Entries of the curvature that belongs to forces; 0 where they are not finite */
static int find_curvature(wbc_tick *t, const double *force) {
    const double *arg[6] = {t->q, t->v_last, t->p, &t->dt, force, t->handed};
    double *res[1] = {t->curvature_entries};
    curvature(arg, res, t->work_iw, t->work_w, 0);
    return all_finite(t->curvature_entries, NNZK);
}

/* Margins that hold against the last command bend within the tick: the diagonal of H gets so much of each line of their curvature that
 * it outweighs that whatever its signs are; whether there are any */
static int damp_along_margins(wbc_tick *t) {
    double force[MT + MC + 1];
    int any = 0;
    for (int k = 0; k < MC; k++) any |= t->pressed[k] != 0.0;
    if (!any) return 0;
    memset(force, 0, sizeof force);
    for (int k = 0; k < MC; k++) force[MT + k] = t->pressed[k];
    if (!find_curvature(t, force)) return 0;
    for (int e = 0; e < NNZK; e++) {
        const int i = k_row[e], j = k_col[e];
        const double size = fabs(t->curvature_entries[e]);
        t->H[i * WIDE + i] += size * dof_scale[j] / dof_scale[i];
        if (i != j) t->H[j * WIDE + j] += size * dof_scale[i] / dof_scale[j];
    }
    return 1;
}

/* H += curvature of the errors that are left, with blocked joints cut off; how large it is, 0 for none to count */
static double curve_errors(wbc_tick *t, const double *free, const double *each, const double *force, double least) {
    double most[4] = {0};
    const double share = counted(each, force, least);
    if (!(share > 0.0) || !find_curvature(t, force)) return 0.0;
#if LEVELS > 0
    memset(t->curvature, 0, sizeof t->curvature);
#endif
    blend(t->H, free, share);
    for (int first = 0; first < NNZK; first += 4)
        for (int n = 0; n < 4 && first + n < NNZK; n++) {
            const int e = first + n, i = k_row[e], j = k_col[e];
            const double entry = share * free[i] * free[j] * t->curvature_entries[e];
            most[n] = larger(fabs(entry) * dof_scale[i] * dof_scale[j], most[n]);
            t->H[i * WIDE + j] += entry;
#if LEVELS > 0
            t->curvature[i * NV + j] = t->curvature[j * NV + i] = entry;
#endif
        }
    return larger(larger(most[0], most[1]), larger(most[2], most[3]));
}

/* Curvature into H and what makes it positive definite again; leaves the factor. `least`: its least pivot before. 1 where there is any
 * to count. */
static int add_curvature(wbc_tick *t, const double *free, const double *each, const double *whole, const double *force, double least) {
    double slope[WIDE] = {0}, step[WIDE];
    const double largest = curve_errors(t, free, each, force, least);
    if (largest == 0.0) return 0;
    const int amended = decompose_amended(t, larger(LEAST_PIVOT * largest, least), largest);
    /* The factor that is used has equality rows in it, and they are not in H */
    int equalities = 0;
    for (int i = 0; i < M_ALL; i++) equalities |= t->low[i] == t->high[i];
    int held = t->reduced;
    for (int k = 0; k < MC; k++) held |= bent[k] && t->strength[k] != 0.0;
    t->prepared = equalities ? refactor(t) : 1;
    if (!t->prepared || !amended || !held) return 1;
    /* What is definite by little only makes a step that is too long for what is held */
    for (int i = 0; i < NV; i++) slope[i] = free[i] * whole[i];
    solve_with(t, slope, step);
    const double length = largest_step(step);
    if (length <= TRUSTED) return 1;
    const double more = held_short(slope, length);
    for (int i = 0; i < NV; i++) t->H[i * WIDE + i] += more / (dof_scale[i] * dof_scale[i]);
    t->prepared = REDUCES && t->reduced ? stiffen_reduced(t, more) : factor(t);
    return 1;
}

/* The step that follows moving targets, as if there were no curvature: corrected until only what the linear model
 * cannot resolve either is damped */
static void following(wbc_tick *t, const double *wanted, double *x) {
    double moved[MT + 1], rest[WIDE], change[WIDE];
    solve_with(t, wanted, x);
    for (int n = 0; n < CORRECTIONS; n++) {
        along_all(t, x, moved);
        gather(t, moved, rest);
        for (int i = 0; i < NV; i++) rest[i] = wanted[i] - rest[i] - damping[i] * x[i];
        for (int i = NV; i < WIDE; i++) rest[i] = 0.0;
        solve_with(t, rest, change);
        for (int i = 0; i < WIDE; i++) x[i] += change[i];
    }
}

/* out = H x, of whose symmetric matrix the upper triangle is stored */
static void product(const wbc_tick *t, const double *x, double *out) {
    for (int i = 0; i < WIDE; i++) out[i] = 0.0;
    for (int i = 0; i < NV; i++) {
        const double *row = t->H + i * WIDE;
        out[i] += row[i] * x[i];
        for (int j = i + 1; j < NV; j++) {
            out[i] += row[j] * x[j];
            out[j] += row[j] * x[i];
        }
    }
}

#endif

/* The gain up to which all joints can brake before the target, at most `largest` */
static double stoppable(wbc_tick *t, const double *free, const double *error, double largest) {
    double square[MT + 1], b[WIDE], rate[WIDE], worst = 0.0;
    int limited = 0;
    for (int i = 0; i < NV; i++) limited |= brake_at[i] >= 0 && t->bound_enabled[brake_at[i]] != 0.0;
    if (!limited) return largest;
    for (int k = 0; k < LEADING; k++) {
        const double gain = t->p[gain_at[k]];
        square[k] = gain * gain * error[k];
    }
    gather(t, square, b);
    for (int i = 0; i < NV; i++) b[i] *= free[i];
    solve_with(t, b, rate);
    for (int i = 0; i < NV; i++)
        if (brake_at[i] >= 0 && t->bound_enabled[brake_at[i]] != 0.0)
            worst = larger(worst, free[i] * fabs(rate[i]) / (BRAKING * brake_limit[i]));
    return worst > 1.0 ? largest / sqrt(worst) : largest;
}

/* The QP of the linear model becomes the one that is solved */
static void reach(wbc_tick *t) {
    double error[MT + 1], slope[WIDE], free[WIDE], largest = 0.0;
    for (int k = 0; k < LEADING; k++) {
        const int counts = t->weight[k] * t->report.factor[k] != 0.0;
        error[k] = counts ? t->report.error[k] : 0.0;
        if (!(fabs(error[k]) < TOO_FAR)) return;
        if (counts) largest = larger(largest, t->p[gain_at[k]]);
    }
    gather(t, error, slope);
    t->prepared = 1;
    const int blocked = find_free(t, slope, free);
    /* Exact rows are taken out, or firm at once: with less, a step is one off the mechanism */
    const int exact = has_exact_rows() && !(REDUCES && !blocked && eliminate(t));
    t->firm = exact;
    if (!(blocked || exact ? cut_off(t, free, 0.0) : refactor(t))) {
        t->prepared = t->firm = 0;
        return;
    }
#if NNZK > 0
    /* There may be none also where code for stacks of any size is compiled */
    if (NNZK > 0) {
        double force[MT + MC + 1], each[MT + 1], least, most;
        for (int k = 0; k < LEADING; k++) each[k] = fabs(t->weight[k] * t->report.factor[k] * error[k]);
        int changed = exact;
        find_pivots(t, &least, &most);
        t->firm = exact || KEPT;
        int found = (t->firm == exact || cut_off(t, free, 0.0)) && left_over(t, free, error, slope, force, &changed);
        /* Errors that are left push against rows that bend: with how much is seen where these are firm */
        if (BENDING > 0 && found && !t->firm && !t->reduced && counted(each, force, least) > 0.0) {
            t->firm = 1;
            found = cut_off(t, free, 0.0) && left_over(t, free, error, slope, force, &changed);
        }
        changed |= t->firm;
        t->firm = 0;
        if (!found) return;
        held_by_bounds(t, force, each);
        changed |= damp_along_margins(t);
        const int prepared = t->prepared;
        t->prepared = 1;
        t->curved = add_curvature(t, free, each, slope, force, least);
        if (!t->prepared) return;
        if (!t->curved) t->prepared = prepared;
        if (!t->curved && changed && !(blocked ? cut_off(t, free, 0.0) : (t->prepared = refactor(t)))) return;
    }
#endif
    const double allowed = CALM ? stoppable(t, free, error, largest) : largest;
    if (!t->curved && allowed >= largest) return;
    double wanted[MT + 1], drift[MT + 1];
    int moving = 0;
    for (int k = 0; k < LEADING; k++) {
        const double gain = t->p[gain_at[k]];
        wanted[k] = smaller(gain, allowed) * error[k];
        drift[k] = -t->desired[k] - gain * error[k];
        moving |= t->weight[k] * t->report.factor[k] != 0.0 && drift[k] != 0.0;
        if (!t->curved) wanted[k] += drift[k];
    }
    gather(t, wanted, t->g);
#if NNZK > 0
    if (t->curved && moving) {
        double follow[WIDE], step[WIDE];
        for (int k = 0; k < LEADING; k++) drift[k] = -drift[k];
        gather(t, drift, follow);
        following(t, follow, step);
        product(t, step, follow);
        for (int i = 0; i < NV; i++) t->g[i] -= follow[i];
    }
#endif
    if (t->prepared && !t->reduced) right_side(t);
}

#if NNZK > 0
/* Whether a joint at its bound would leave it, within the tick, for the curvature that belongs to forces */
static int turns_within(wbc_tick *t, const double *force) {
    double change[NV] = {0};
    if (!find_curvature(t, force)) return 0;
    for (int e = 0; e < NNZK; e++) {
        const int i = k_row[e], j = k_col[e];
        change[i] += t->curvature_entries[e] * t->report.v[j];
        if (i != j) change[j] += t->curvature_entries[e] * t->report.v[i];
    }
    int turns = 0;
    for (int i = 0; i < DOFS; i++) {
        const double push = t->report.lambda[i];
        turns |= (push > 0.0 && change[i] > push) || (push < 0.0 && change[i] < push);
    }
    return turns;
}
#endif

/* Whether the problem is to be assembled again, for joints that nothing keeps from turning round at once: where they go as fast as they
 * may, further than is good for the rates of the first level, of which the command falls short, what is left of errors counts as
 * curvature, and where they move, what margins hold against them. */
EXPORT int wbc_tick_hurries(wbc_tick *t) {
#if NNZK > 0
    double rate[MT + 1], force[MT + MC + 1];
    int bound = 0, moves = 0, pressed = 0;
    if (!CALM || COMMAND != VELOCITY || t->plain != 0.0) return 0;
    for (int i = 0; i < DOFS; i++) {
        if (brake_at[i] >= 0 && t->bound_enabled[brake_at[i]] != 0.0) continue;
        bound |= t->report.lambda[i] != 0.0 && t->report.v[i] != 0.0 && t->low[i] != t->high[i];
        moves |= fabs(t->report.v[i]) * t->dt > MOVELESS * dof_scale[i];
    }
    for (int k = 0; moves && k < MC; k++) {
        if (margin_at[k] < 0 || price_at[k] >= 0) continue;
        t->pressed[k] = t->dt * t->report.lambda[NV + k];
        pressed |= t->pressed[k] != 0.0;
    }
    if (!bound) return pressed;
    memset(force, 0, sizeof force);
    along_all(t, t->report.v, rate);
    for (int k = 0; k < LEADING; k++) {
        const double most = fabs(t->report.error[k]), f = t->weight[k] * t->report.factor[k];
        t->shortfall[k] = f != 0.0 ? clamp(t->dt * (rate[k] - t->desired[k]), -most, most) : 0.0;
        force[k] = f * t->shortfall[k];
    }
    if (turns_within(t, force)) return 1;
    memset(t->shortfall, 0, sizeof t->shortfall);
    return pressed;
#else
    (void)t;
    return 0;
#endif
}

#endif
