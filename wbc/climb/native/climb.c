/* What the planner of climbing asks for many times. */
#include "close.h"
#include "moves.h"
#include "spans.h"
#include "swings.h"
#include "time_law.h"
#include "touch.h"

long long wbc_step_size(void) { return (long long)sizeof(step_t); }
long long wbc_limb_size(void) { return (long long)sizeof(limb_t); }

/* Contact poses of n postures in the body's frame, 12 each */
void wbc_touches(const limb_t *l, long n, const double *angle, double *out) {
    static const double here[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    placed_t placed;
    for (long k = 0; k < n; k++) {
        place_limb(l, here, angle + k * l->angles, &placed);
        memcpy(out + 12 * k, placed.tip, sizeof placed.tip);
    }
}

/* Up to `most` postures of each of n wanted poses, and how many */
void wbc_postures(const limb_t *l, long n, const double *wanted, const double *seed, int most, double *out, int *count) {
    for (long k = 0; k < n; k++)
        count[k] = postures(l, wanted + 12 * k, seed ? seed + k * l->angles : 0, most, out + (size_t)k * most * l->angles);
}

long wbc_reach_each(const limb_t *l, long n, const double *wanted, int rows, double *angle) {
    return reach_each(l, n, wanted, rows, angle);
}

long long wbc_piece_size(void) { return (long long)sizeof(piece_t); }
long long wbc_cone_size(void) { return (long long)sizeof(cone_t); }
long long wbc_climb_size(void) { return (long long)sizeof(climb_t); }

/* Frees what was kept of supports */
void wbc_climb_forget(climb_t *c) {
    for (int k = 0; k < c->places; k++) free(c->support[k]);
    free(c->support), free(c->work);
    c->support = 0, c->work = 0, c->places = c->supports = c->largest = 0;
}

/* The slack of contacts at a centre of mass and its bound over that, 4; `poses` of contacts: 0 for those of their places */
double wbc_slack(climb_t *c, const int *contact, const double *poses, const double *center, double *bound) {
    return slack_by_program(c, contact, poses, center, bound);
}

/* The slacks of contacts for n wrenches about a point, 6 each, and their bounds over these, 7 each */
void wbc_wrench_slacks(climb_t *c, const int *contact, const double *poses, const double *point, long n, const double *wrench,
                       double *slack, double *bound) {
    for (long k = 0; k < n; k++) slack[k] = slack_of_wrench(c, contact, poses, point, wrench + 6 * k, bound + 7 * k);
}

static void padded(const climb_t *c, const int *contact, int *out) {
    for (int l = 0; l < MOST_LIMBS; l++) out[l] = l < c->limbs ? contact[l] : -1;
}

/* A posture on contacts that is borne by one set of them. `body`: place and turn weights, then a pose. `state`: pose of the body and
 * angles, in place; `followed`: whether the limbs that
 * hold are followed from the state given; `numbers`: the slack; `which`: what touches */
int wbc_stand(climb_t *c, const int *contact, const int *bears, double wanted, const double *body, int followed, double *state,
              double *numbers, int *which) {
    int all[MOST_LIMBS];
    padded(c, bears, all);
    wish_t wish = {1, {support_of(c, all)}, wanted, body[0], body[1], REST, {0}, 0, {{0}}};
    memcpy(wish.pose, body + 2, sizeof wish.pose);
    if (!wish.support[0]) return NOT_BORNE;
    double from[12 + MOST_LIMBS * MOST_ANGLES];
    memcpy(from, state, (size_t)(12 + c->offset[c->limbs]) * sizeof *from);
    int how = posture(c, contact, &wish, state, state + 12, numbers, which);
    if (how == STANDS && followed) how = follow(c, contact, contact, &wish, 1, from, from + 12, state, state + 12, numbers, which);
    return how;
}

/* The slack, clearance and contact errors of a configuration as it is: 2 + limbs numbers */
void wbc_look(climb_t *c, const int *contact, const double *state, double *numbers, int *which) {
    placed_t placed[MOST_LIMBS];
    double center[3], bound[4], r[6], E[6][6];
    place_all(c, state, state + 12, placed, center);
    numbers[0] = slack_by_program(c, contact, 0, center, bound);
    numbers[1] = link_clearance(c, contact, state, placed, which);
    for (int l = 0; l < c->limbs; l++) {
        numbers[2 + l] = 0.0;
        if (contact[l] < 0) continue;
        contact_error(c->limb + l, placed[l].tip, c->foothold + 12 * contact[l], r, E);
        for (int i = 0; i < c->limb[l].rows; i++) numbers[2 + l] += r[i] * r[i];
        numbers[2 + l] = sqrt(numbers[2 + l]);
    }
}

int wbc_lift(climb_t *c, const int *contact, const int *kept, double wanted, const double *touch, int attempt, double *state,
             double *slack, int *which, int *moves) {
    int all[MOST_LIMBS];
    padded(c, kept, all);
    return lift_off(c, contact, all, wanted, (const double (*)[12])touch, attempt, state, slack, which, moves);
}

int wbc_land(climb_t *c, const int *next, const int *kept, double wanted, const double *touch, int attempt, double *state,
             double *slack, int *which) {
    int all[MOST_LIMBS];
    padded(c, kept, all);
    return land_on(c, next, all, wanted, (const double (*)[12])touch, attempt, state, slack, which);
}

/* Single limbs that may hold elsewhere next, as far from where they are at rest as squared lengths from `least` on and below `most`:
 * limb and foothold, 2 each; the stretch after that and the body's place, 4 each, or the squared length alone and where
 * the body is, where `guesses` is 0. How many */
long wbc_candidates(climb_t *c, const int *contact, const double *touch, const double *base, double least, double most, int guesses,
                    int *out, double *stretch) {
    long count = 0;
    int next[MOST_LIMBS];
    padded(c, contact, next);
    for (int l = 0; l < c->limbs; l++) {
        double own[12], apart[3];
        compose(base, touch + 12 * l, own);
        for (int f = 0; f < c->footholds; f++) {
            minus3(own + 9, c->foothold + 12 * f + 9, apart);
            const double far = dot3(apart, apart) / (c->limb[l].length * c->limb[l].length);
            if (far < least || far >= most || c->cone_of[l * c->footholds + f] < 0) continue;
            if (contact[l] >= 0 && c->hold[f] == c->hold[contact[l]]) continue;
            int near = 1;
            for (int k = 0; k < c->limbs && near; k++) {
                if (k == l || contact[k] < 0) continue;
                near = c->hold[contact[k]] != c->hold[f];
                double roots[3];
                minus3(c->foothold + 12 * f + 9, c->foothold + 12 * contact[k] + 9, apart);
                minus3(c->limb[l].step[0].place + 9, c->limb[k].step[0].place + 9, roots);
                const double sum = c->limb[l].length + c->limb[k].length + sqrt(dot3(roots, roots));
                near = near && dot3(apart, apart) <= sum * sum;
            }
            if (!near) continue;
            double body[12];
            memcpy(body, base, sizeof body);
            next[l] = f;
            out[2 * count] = l, out[2 * count + 1] = f;
            stretch[4 * count] = guesses ? guess_body(c, next, (const double (*)[12])touch, body) : far;
            copy3(body + 9, stretch + 4 * count++ + 1);
        }
        next[l] = contact[l];
    }
    return count;
}

double wbc_stretch(const climb_t *c, const int *contact, const double *touch, const double *base) {
    double body[12];
    memcpy(body, base, sizeof body);
    return guess_body(c, contact, (const double (*)[12])touch, body);
}

void wbc_center(const climb_t *c, const double *state, double *center) {
    placed_t placed[MOST_LIMBS];
    place_all(c, state, state + 12, placed, center);
}

int wbc_hold_spans(const limb_t *l, int count, const double *wanted, int at, const double *start, int tries, int most,
                   const double *step, double *angles, int *first, int *last) {
    return hold_spans(l, count, wanted, at, start, tries, most, step, angles, first, last);
}

/* As swing */
double wbc_swing(const limb_t *l, int count, int parts, const double *body, const double *from, const double *onto,
                 const double *ends, double over, int straight, const double *most, double *angle, int *at) {
    return swing(l, count, parts, body, from, onto, ends, over, straight, most, angle, at);
}

/* As pieces_of */
int wbc_pieces_of(const climb_t *c, int limb, long n, const double *angle, double *out) {
    return pieces_of(c, limb, n, angle, out);
}

/* As mark_alone; `work`: 13 n numbers */
void wbc_mark_alone(const climb_t *c, int limb, const double *pieces, const double *base, const int *contact, const double *off,
                    long n, char *mark, double *work) {
    mark_alone(c, limb, pieces, base, contact, off, n, mark, work);
}

/* As mark_limbs */
void wbc_mark_limbs(const climb_t *c, int one, const double *pieces, int other, const double *others, long n, char *mark) {
    mark_limbs(c, one, pieces, other, others, 0, n, mark);
}

int wbc_fastest(long n, int rows, int sided, const double *s, const double *a, const double *b, const double *squared, double *x) {
    return fastest_law(n, rows, sided, s, a, b, squared, x);
}

/* The first of n configurations in which links are nearer than they may be, n for none; `which`: what touches there, `lacks`: by
 * how much, and the direction in which the first of them has to go */
long wbc_first_touch(climb_t *c, long n, const int *contact, const double *state, int *which, double *lacks) {
    placed_t placed[MOST_LIMBS];
    double center[3], value[MOST_VARIABLES];
    int column[MOST_VARIABLES], count = 6;
    const int start[MOST_LIMBS] = {0};
    for (long k = 0; k < n; k++) {
        const double *at = state + k * (12 + c->offset[c->limbs]);
        place_all(c, at, at + 12, placed, center);
        if ((lacks[0] = -link_clearance(c, contact + k * c->limbs, at, placed, which)) <= 0.0) continue;
        avoiding(c, contact + k * c->limbs, which, at, placed, start, value, column, &count);
        copy3(value, lacks + 1);
        return k;
    }
    return n;
}

/* Of n states of a body and its limbs' angles the contacts of some limbs at poses in the world, 12 each: closed in at most `steps`
 * steps of `close_once`; the largest errors that are left */
void wbc_close(const limb_t *limbs, const int *offset, int size, int contacts, const int *which, const double *wanted, int turned,
               double body, double enough, int steps, long n, double *state, double *left) {
    for (long k = 0; k < n; k++) {
        double *at = state + k * size;
        for (int step = 0; step <= steps; step++) {
            left[k] = close_once(limbs, offset, contacts, which, wanted + k * contacts * 12, turned, body, step < steps ? enough : 1e300, at);
            if (!(left[k] >= enough) || !(left[k] < 1e3)) break;
        }
    }
}
