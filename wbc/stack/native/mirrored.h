/* Rows of loops and of torques that nothing gives, whose forces in loops f meet the torques by the transposed of what keeps the loops
 * closed:   J a = b,   M a - J' f = c   on joints without motors.
 *
 * Each row of J gives one of these joints, J_g; f = J_g^-T (M_g a - c_g) then needs no elimination of its own. Rows of torques of joints
 * that are left over give others of the motions that are left. docs/solvers.md#loops */
#ifndef WBC_MIRRORED_H
#define WBC_MIRRORED_H

#include "given.h"

/* Variables that the rows of loops and their forces leave, in groups of four */
#define FREEDOMS ((NV - 2 * FORCES + 3) / 4 * 4)
#define EACH_FREEDOM(at) for (int at = 0; at < FREEDOMS; at += 4)

/* out = row k, its entries of variables before `end`, through the motions that are left */
INLINE void see_row(const wbc_tick *t, int k, int end, const double *motions, double *out) {
    EACH_FREEDOM(at) {
        four sum = {0};
        for (int e = a_start[k]; e < a_end[k] && a_col[e] < end; e++)
            sum = MADD(EACH(t->at[e]), GIVEN_FOUR(motions + a_col[e] * FREEDOMS + at), sum);
        FOUR(out + at) = sum;
    }
}

/* Joints for the rows of loops; 0 where the equalities are others, or these depend on each other */
static int give_joints(wbc_tick *t, int count) {
    double open[WIDE];
    int step = 0;
    if (count != REDUCED || t->equal_row[0] != CLOSING_FIRST || t->equal_row[FORCES - 1] != CLOSING_FIRST + FORCES - 1) return 0;
    for (int j = 0; j < NV; j++) t->is_given[j] = t->torque_slot[j] = 0;
    for (int n = FORCES; n < count; n++) {
        if (row_torque[t->equal_row[n]] < 0) return 0;
        t->torque_slot[row_torque[t->equal_row[n]]] = n;
    }
    if (!unit_rows(t, FORCES)) return 0;
    for (int i = 0; i < WIDE; i++) open[i] = i < FORCES;
    for (int n = 0; n < DOFS && step < FORCES; n++) {
        const int j = give_order[n];
        if (t->torque_slot[j] == 0) continue;
        step += t->is_given[j] = give(t->equal, DOFS, j, FORCES, CLEAR_PIVOT, open, t->given);
    }
    return step == FORCES;
}

/* Forces in loops by the motions that are left */
static void give_forces(wbc_tick *t, double *motions) {
    double torque[FORCES * FREEDOMS + 1];
    for (int i = 0; i < FORCES; i++) {
        const int slot = t->torque_slot[t->given[i]];
        see_row(t, t->equal_row[slot], FORCE_FIRST, motions, torque + i * FREEDOMS);
        t->given[slot] = FORCE_FIRST + i;
        EACH_FREEDOM(at) FOUR(torque + i * FREEDOMS + at) *= EACH(dof_scale[t->given[i]]);
    }
    for (int k = 0; k < FORCES; k++) {
        EACH_FREEDOM(at) {
            four sum = {0};
            for (int i = 0; i < FORCES; i++) sum = MADD(EACH(COLUMN(t, k)[i]), GIVEN_FOUR(torque + i * FREEDOMS + at), sum);
            FOUR(motions + (FORCE_FIRST + k) * FREEDOMS + at) = sum * EACH(t->equal_scale[k]);
        }
    }
}

/* Motions for the rows of torques of joints that were not given, `variable` says of what; 0 where they depend on each other */
static int give_motions(wbc_tick *t, int count, int left, const int *variable, const double *motions, int *given) {
    double open[WIDE], row[FREEDOMS + 1];
    int place[NV], step = 0;
    t->rest = 0;
    for (int i = 0; i < left * WIDE; i += 4) FOUR(t->second + i) = (four){0};
    for (int c = 0; c < left; c++) place[variable[c]] = c;
    for (int n = FORCES; n < count; n++) {
        const int k = t->equal_row[n];
        double square = 0.0;
        if (t->is_given[row_torque[k]]) continue;
        see_row(t, k, NV, motions, row);
        for (int c = 0; c < left; c++) square += row[c] * row[c];
        if (!(square > DEAD)) return 0;
        t->equal_scale[n] = 1.0 / sqrt(square);
        for (int c = 0; c < left; c++) t->second[c * WIDE + t->rest] = row[c] * t->equal_scale[n];
        t->rest_slot[t->rest++] = n;
    }
    for (int i = 0; i < WIDE; i++) open[i] = i < t->rest;
    for (int n = NV - 1; n >= 0; n--) t->is_moved[n] = 0;
    for (double least = CLEAR_PIVOT; least >= PIVOT && step < t->rest; least *= PIVOT / CLEAR_PIVOT)
        for (int n = 0; n < NV && step < t->rest; n++) {
            const int j = n < NV - DOFS ? DOFS + n : give_order[n - (NV - DOFS)];
            if (t->is_given[j] || t->is_moved[j] || (j >= FORCE_FIRST && j < FORCE_FIRST + FORCES)) continue;
            step += t->is_moved[j] = give(t->second, left, place[j], t->rest, least, open, given);
        }
    return step == t->rest;
}

/* Z, and what is needed to go through the rows; 0 where the rows are others, or depend on each other */
static int give_mirrored(wbc_tick *t, int count) {
    double motions[NV * FREEDOMS + 1], follow[NV * THIN + 1];
    int variable[NV], given[WIDE], kept[THIN + 1], left = 0, width = 0;
    if (!give_joints(t, count)) return 0;
    for (int i = 0; i < NV * FREEDOMS; i += 4) FOUR(motions + i) = (four){0};
    for (int j = 0; j < NV; j++) {
        if (t->is_given[j] || (j >= FORCE_FIRST && j < FORCE_FIRST + FORCES)) continue;
        motions[j * FREEDOMS + left] = dof_scale[j];
        for (int i = 0; i < FORCES && j < DOFS; i++)
            motions[t->given[i] * FREEDOMS + left] = -dof_scale[t->given[i]] * t->equal[j * WIDE + i];
        variable[left++] = j;
    }
    give_forces(t, motions);
    if (!give_motions(t, count, left, variable, motions, given)) return 0;
    for (int c = 0; c < left; c++) {
        if (t->is_moved[variable[c]]) continue;
        if (width == THIN) return 0;
        for (int s = 0; s < t->rest; s++) follow[s * THIN + width] = t->second[c * WIDE + s];
        kept[width] = c;
        t->left[width++] = variable[c];
    }
    for (int w = width; w < THIN; w++) {
        for (int s = 0; s < t->rest; s++) follow[s * THIN + w] = 0.0;
        kept[w] = 0;
    }
    for (int s = 0; s < t->rest; s++) {
        t->given[t->rest_slot[s]] = variable[given[s]];
        t->moved[s] = given[s];
    }
    for (int s = 0; s < t->rest; s++)
        for (int i = 0; i < NV; i++) t->lifted[s * WIDE + i] = motions[i * FREEDOMS + given[s]];
    for (int at = 0; at < THIN; at += 4) {
        const double *own[4];
        for (int r = 0; r < 4; r++) own[r] = motions + kept[at + r];
        const four_bits known = PLACES(at) < (four_bits){width, width, width, width};
        for (int i = 0; i < NV; i++) {
            const four row = {own[0][i * FREEDOMS], own[1][i * FREEDOMS], own[2][i * FREEDOMS], own[3][i * FREEDOMS]};
            FOUR(t->basis + i * WIDE + at) = (four)((four_bits)row & known);
        }
        for (int s = 0; s < t->rest; s++) {
            const four each = GIVEN_FOUR(follow + s * THIN + at);
            for (int i = 0; i < NV; i++) FOUR(t->basis + i * WIDE + at) -= EACH(t->lifted[s * WIDE + i]) * each;
        }
    }
    t->width = width;
    return 1;
}

/* Loops over the rows of loops, in groups of four */
#define EACH_FORCE_GROUP(i) for (int i = 0; i < FORCES; i += 4)

/* x = P e, see by_rows; with `sizes` no |P e| is larger where |e| are at most these */
INLINE void by_rows_mirrored(const wbc_tick *t, const double *e, double *x, int sizes) {
#define SIGNED(number) (sizes ? fabs(number) : (number))
#define SIGNED_FOUR(numbers) (sizes ? SIZE_OF_FOUR(numbers) : (numbers))
    double moved[WIDE] = {0}, push[WIDE] = {0}, gap[WIDE];
    for (int i = 0; i < WIDE; i++) x[i] = 0.0;
    for (int k = 0; k < FORCES; k++) {
        const four each = EACH(e[k] * t->equal_scale[k]);
        EACH_FORCE_GROUP(i) FOUR(moved + i) = MADD(SIGNED_FOUR(GIVEN_FOUR(COLUMN(t, k) + i)), each, GIVEN_FOUR(moved + i));
    }
    for (int i = 0; i < FORCES; i++) x[t->given[i]] = moved[i] * dof_scale[t->given[i]];
    for (int n = FORCES; n < t->reduced; n++) {
        const int k = t->equal_row[n];
        gap[n - FORCES] = sizes ? e[n] : -e[n];
        for (int m = a_start[k]; m < a_end[k] && a_col[m] < DOFS; m++) gap[n - FORCES] += SIGNED(t->at[m]) * x[a_col[m]];
    }
    for (int i = 0; i < FORCES; i++) push[i] = gap[t->torque_slot[t->given[i]] - FORCES] * dof_scale[t->given[i]];
    for (int k = 0; k < FORCES; k++) {
        four sum = {0};
        EACH_FORCE_GROUP(i) sum = MADD(SIGNED_FOUR(GIVEN_FOUR(COLUMN(t, k) + i)), GIVEN_FOUR(push + i), sum);
        x[FORCE_FIRST + k] = SUM_OF_FOUR(sum) * t->equal_scale[k];
    }
    for (int s = 0; s < t->rest; s++) {
        const int n = t->rest_slot[s], k = t->equal_row[n];
        for (int m = a_start[k]; m < a_end[k]; m++)
            if (a_col[m] >= FORCE_FIRST) gap[n - FORCES] += SIGNED(t->at[m]) * x[a_col[m]];
        push[s] = gap[n - FORCES] * t->equal_scale[n];
    }
    for (int i = 0; i < t->rest; i++) {
        double sum = 0.0;
        for (int s = 0; s < t->rest; s++) sum += SIGNED(t->second[t->moved[s] * WIDE + i]) * push[s];
        const four each = EACH(sizes ? sum : -sum);
        for (int at = 0; at < WIDE; at += 4) FOUR(x + at) = MADD(SIGNED_FOUR(GIVEN_FOUR(t->lifted + i * WIDE + at)), each, GIVEN_FOUR(x + at));
    }
#undef SIGNED
#undef SIGNED_FOUR
}

/* r += f row k */
INLINE void add_row(const wbc_tick *t, int k, double f, double *r) {
    for (int e = a_start[k]; e < a_end[k]; e++) r[a_col[e]] += f * t->at[e];
}

/* Multipliers that leave nothing of r on the variables that were given, see multipliers_of */
static void multipliers_mirrored(const wbc_tick *t, const double *r, double *lambda) {
    double rest[WIDE], push[WIDE] = {0}, along[WIDE] = {0};
    for (int i = 0; i < WIDE; i++) {
        rest[i] = i < NV ? r[i] : 0.0;
        lambda[i] = 0.0;
    }
    for (int s = 0; s < t->rest; s++) {
        four sum = {0};
        for (int at = 0; at < WIDE; at += 4) sum = MADD(GIVEN_FOUR(t->lifted + s * WIDE + at), GIVEN_FOUR(rest + at), sum);
        push[s] = -SUM_OF_FOUR(sum);
    }
    for (int s = 0; s < t->rest; s++) {
        const int n = t->rest_slot[s];
        for (int i = 0; i < t->rest; i++) lambda[n] += t->second[t->moved[s] * WIDE + i] * push[i];
        lambda[n] *= t->equal_scale[n];
        add_row(t, t->equal_row[n], lambda[n], rest);
    }
    for (int k = 0; k < FORCES; k++) {
        const four each = EACH(t->equal_scale[k] * rest[FORCE_FIRST + k]);
        EACH_FORCE_GROUP(i) FOUR(along + i) = MADD(GIVEN_FOUR(COLUMN(t, k) + i), each, GIVEN_FOUR(along + i));
    }
    for (int i = 0; i < FORCES; i++) {
        const int n = t->torque_slot[t->given[i]];
        lambda[n] = along[i] * dof_scale[t->given[i]];
        add_row(t, t->equal_row[n], lambda[n], rest);
    }
    for (int i = 0; i < WIDE; i++) push[i] = i < FORCES ? rest[t->given[i]] * dof_scale[t->given[i]] : 0.0;
    for (int k = 0; k < FORCES; k++) {
        four sum = {0};
        EACH_FORCE_GROUP(i) sum = MADD(GIVEN_FOUR(COLUMN(t, k) + i), GIVEN_FOUR(push + i), sum);
        lambda[k] = -SUM_OF_FOUR(sum) * t->equal_scale[k];
    }
}

#endif
