/* From one stance to the next, and which next ones there may be. */
#ifndef WBC_MOVES_H
#define WBC_MOVES_H

#include "posture.h"

/* Poses between two postures at which limbs that hold are followed */
#define BETWEEN 8
/* From this attempt on links may touch on the way of the body, which may then not be straight */
#define LAST_ATTEMPT 3
/* How far limbs that lift or land are to reach over their contact, but in that attempt [lengths of the limb] */
#define RISEN 0.03
/* Other postures are sought so often where links touch on the way, or as limbs rise; and what these are led apart further then, of what
 * they lack */
#define RISING 3
#define FURTHER 1.5
/* Farther from its even way no angle may have to go [rad, m] */
#define JUMP 1.0
/* How much lower and higher the body begins in other attempts [lengths of the robot] */
#define LOWER 0.15
/* Pull of angles to rest, and of a guess's turn to the present one, beside weights of 1 */
#define REST 1e-2
#define UPRIGHT 2e-2
/* Lengths of a limb that a contact turned by 1 rad from rest counts for */
#define TURNED 0.15
/* Distance from rest from which on stretch grows with its fourth power [lengths of a limb] */
#define COMFORT 0.4
/* Samples from which a limb that lands begins, besides rest */
#define BEGINNINGS 3
/* Steps of a guess; weight in it of what a contact is out of a limb's reach, and in the stretch [1/lengths of a limb squared] */
#define GUESSES 3
#define REACHES 10.0
#define BEYOND_REACH 20.0

/* How far a contact is out of the shell that a limb reaches with the body at a pose [m], below 0 where it is too near; `n`: the
 * direction from the limb's root, `arm`: from the body to that root, along the axes of the world */
static double out_of_reach(const limb_t *l, const double *base, const double *contact, double *arm, double *n) {
    double at[3], by[3];
    turn(base, l->step[0].place + 9, arm);
    turn(contact, l->wrist, at);
    for (int i = 0; i < 3; i++) by[i] = contact[9 + i] + at[i] - base[9 + i] - arm[i];
    const double far = sqrt(dot3(by, by));
    for (int i = 0; i < 3; i++) n[i] = far > 0.0 ? by[i] / far : 0.0;
    return far > l->far ? far - l->far : far < l->near ? far - l->near : 0.0;
}

/* The body's pose for which contacts are nearest to where they are at rest, within reach: some steps of least squares from `base` on,
 * in place. `touch`: contact poses at rest in the body's frame. The stretch: sum of squared distances from there in lengths of the
 * limbs, and more beyond COMFORT, or out of reach */
static double guess_body(const climb_t *c, const int *contact, const double (*touch)[12], double *base) {
    double from[12], stretch = 0.0;
    memcpy(from, base, sizeof from);
    for (int round = 0; round < GUESSES; round++) {
        double H[36] = {0}, g[6], by[3], arm[3], moved[12];
        turn_between(from, base, by);
        const double unit = c->length * c->length;
        for (int i = 0; i < 3; i++) H[7 * i] = 1e-6, H[7 * (3 + i)] = UPRIGHT * unit, g[i] = 0.0, g[3 + i] = -UPRIGHT * unit * by[i];
        for (int l = 0; l < c->limbs; l++) {
            if (contact[l] < 0) continue;
            const double *goal = c->foothold + 12 * contact[l];
            compose(base, touch[l], moved);
            minus3(moved + 9, base + 9, arm);
            double r[3], lever[3];
            minus3(moved + 9, goal + 9, r);
            cross3(arm, r, lever);
            /* e = r + v + w x arm */
            for (int i = 0; i < 3; i++) {
                H[7 * i] += 1.0, g[i] -= r[i], g[3 + i] -= lever[i];
                for (int k = 0; k < 3; k++) H[6 * (3 + i) + 3 + k] += (i == k ? dot3(arm, arm) : 0.0) - arm[i] * arm[k];
            }
            H[19] -= arm[2], H[20] += arm[1], H[24] += arm[2], H[26] -= arm[0], H[30] -= arm[1], H[31] += arm[0];
            const double beyond = out_of_reach(c->limb + l, base, goal, arm, by);
            if (beyond != 0.0) { /* the root is to go along by */
                double row[6];
                copy3(by, row), cross3(arm, by, row + 3);
                for (int i = 0; i < 6; i++) {
                    g[i] += REACHES * beyond * row[i];
                    for (int k = 0; k <= i; k++) H[6 * i + k] += REACHES * row[i] * row[k];
                }
            }
            for (int axis = 2; axis >= 0 && c->limb[l].rows > (axis ? 3 : 5); axis -= 2) { /* z, then x where it counts */
                const double w = 0.1 * c->limb[l].length * c->limb[l].length;
                const double u[3] = {moved[axis], moved[3 + axis], moved[6 + axis]};
                const double wanted[3] = {goal[axis], goal[3 + axis], goal[6 + axis]};
                cross3(u, wanted, by);
                for (int i = 0; i < 3; i++) {
                    g[3 + i] += w * by[i];
                    for (int k = 0; k < 3; k++) H[6 * (3 + i) + 3 + k] += w * ((i == k) - u[i] * u[k]);
                }
            }
        }
        if (!solve_positive(6, H, g)) break;
        move_body(base, g);
    }
    for (int l = 0; l < c->limbs; l++) {
        if (contact[l] < 0) continue;
        double moved[12], by[3], arm[3];
        compose(base, touch[l], moved);
        minus3(moved + 9, c->foothold + 12 * contact[l] + 9, by);
        double far = sqrt(dot3(by, by)) / c->limb[l].length;
        if (c->limb[l].rows == 6) {
            turn_between(c->foothold + 12 * contact[l], moved, by);
            far += TURNED * sqrt(dot3(by, by));
        }
        const double beyond = out_of_reach(c->limb + l, base, c->foothold + 12 * contact[l], arm, by) / c->limb[l].length;
        stretch += far * far * (1.0 + far * far / (COMFORT * COMFORT)) + BEYOND_REACH * beyond * beyond;
    }
    return stretch;
}

static void own_pose(const double *base, const double *world, double *out) {
    double by[3];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) out[3 * i + k] = base[i] * world[k] + base[3 + i] * world[3 + k] + base[6 + i] * world[6 + k];
    minus3(world + 9, base + 9, by);
    turn_back(base, by, out + 9);
}

/* Angles of a limb near a contact with the body at a pose: there, if one of a few beginnings leads there */
static void begin_limb(const limb_t *l, const double *base, const double *contact, double *angle) {
    double own[12];
    int nearest[BEGINNINGS];
    const size_t size = (size_t)l->angles * sizeof *angle;
    memcpy(angle, l->rest, size);
    if (reach_from(l, base, contact, angle)) return;
    own_pose(base, contact, own);
    const int count = nearest_samples(l, own, BEGINNINGS, nearest);
    for (int k = 0; k < count; k++) {
        memcpy(angle, l->sample + (size_t)nearest[k] * l->angles, size);
        if (reach_from(l, base, contact, angle)) return;
    }
    memcpy(angle, l->rest, size);
}

static void pose_between(const double *a, const double *b, double part, double *out) {
    double twist[6];
    minus3(b + 9, a + 9, twist);
    turn_between(a, b, twist + 3);
    for (int i = 0; i < 6; i++) twist[i] *= part;
    memcpy(out, a, 12 * sizeof *out);
    move_body(out, twist);
}

/* Follows limbs that hold while the body goes from one posture to another, whose angles become what is come to; the slack and
 * clearance there, on contacts `at_last`, are looked at again where these differ. `clear`: whether links of the body and of limbs
 * that hold are to be clear on the way; `far`: what links that touch lack there [m], below 0 */
static int follow(climb_t *c, const int *contact, const int *at_last, const wish_t *wish, int clear, const double *base,
                  const double *angle, const double *to, double *reached, double *slack, int *which, double *far) {
    double pose[BETWEEN][12], now[MOST_ANGLES], center[3], way[BETWEEN][MOST_LIMBS * MOST_ANGLES], last[MOST_LIMBS * MOST_ANGLES];
    placed_t placed[MOST_LIMBS];
    near_t near = {.seen = BODY, .of = EVERYTHING};
    const wish_t level = {0};
    const int angles = c->offset[c->limbs];
    int other = 0, gives = yields(c, contact);
    memcpy(last, reached, (size_t)angles * sizeof *last);
    for (int k = 1; k < BETWEEN; k++) pose_between(base, to, (double)k / BETWEEN, pose[k]), memset(way[k], 0, sizeof way[k]);
    for (int l = 0; l < c->limbs; l++) {
        if (contact[l] < 0) continue;
        near.seen |= bit_of(l);
        const limb_t *limb = c->limb + l;
        double *end = last + c->offset[l];
        memcpy(now, angle + c->offset[l], (size_t)limb->angles * sizeof *now);
        for (int k = 1; k <= BETWEEN && !gives; k++) {
            /* Limbs with angles to spare are led to where they end */
            if (limb->angles > limb->rows)
                for (int i = 0; i < limb->angles; i++) now[i] += (end[i] - now[i]) / (BETWEEN - k + 1);
            gives = !reach_from(limb, k < BETWEEN ? pose[k] : to, c->foothold + 12 * contact[l], now);
            if (k < BETWEEN) memcpy(way[k] + c->offset[l], now, (size_t)limb->angles * sizeof *now);
        }
        for (int i = 0; i < limb->angles; i++) other |= fabs(end[i] - now[i]) > 1e-3;
        memcpy(end, now, (size_t)limb->angles * sizeof *now);
    }
    /* Where limbs cannot follow that all go evenly, and the body gives way */
    for (int k = 1; k < BETWEEN && gives; k++) {
        const double part = (double)k / BETWEEN;
        pose_between(base, to, part, pose[k]);
        for (int i = 0; i < angles; i++) way[k][i] = angle[i] + part * (reached[i] - angle[i]);
        if (!tighten_whole(c, contact, &level, pose[k], way[k])) return BREAKS;
        for (int i = 0; i < angles; i++)
            if (fabs(way[k][i] - angle[i] - part * (reached[i] - angle[i])) > JUMP) return BREAKS;
    }
    if (gives) return STANDS;
    memcpy(reached, last, (size_t)angles * sizeof *last);
    for (int k = 1; k < BETWEEN && clear; k++) {
        place_all(c, pose[k], way[k], placed, center);
        if ((*far = clearance_near(c, contact, pose[k], placed, which, &near)) < 0.0) return TOUCHES;
    }
    if (!other) return STANDS;
    place_all(c, to, reached, placed, center);
    *slack = slack_of(c, wish->support, center, wish->slack);
    if (*slack < wish->slack) return NOT_BORNE;
    return (*far = link_clearance(c, at_last, to, placed, which)) >= 0.0 ? STANDS : TOUCHES;
}

/* How clear links are, at the least, once limbs that are not kept are raised off their contacts with the body as it is, where it need not
 * go along [m]; -INFINITY where one does not reach there, all that is asked where `which`, as of link_clearance, is 0 */
static double clear_once_up(climb_t *c, const int *contact, const int *kept, const double *state, int *which) {
    placed_t placed[MOST_LIMBS];
    double center[3], risen[12 + MOST_LIMBS * MOST_ANGLES], wanted[12];
    memcpy(risen, state, (size_t)(12 + c->offset[c->limbs]) * sizeof *risen);
    for (int l = 0; l < c->limbs; l++) {
        const limb_t *limb = c->limb + l;
        if (contact[l] < 0 || contact[l] == kept[l] || limb->angles < limb->rows) continue;
        const double *at = c->foothold + 12 * contact[l], normal[3] = {at[2], at[5], at[8]};
        memcpy(wanted, at, sizeof wanted);
        along3(at + 9, RISEN * limb->length, normal, wanted + 9);
        if (!reach_from(limb, state, wanted, risen + 12 + c->offset[l]) && !which) return -INFINITY;
    }
    if (!which) return 0.0;
    place_all(c, risen, risen + 12, placed, center);
    return link_clearance(c, contact, risen, placed, which);
}

/* Keeps a pair that lacks some distance further apart */
static void keep_apart(wish_t *wish, const int *which, double far) {
    wish->aside -= FURTHER * far;
    if (!is_avoided(wish, which)) memcpy(wish->avoid[wish->avoided++], which, sizeof wish->avoid[0]);
}

/* A posture as of posture(), in place, from which limbs that are not kept can be raised with the body as it is: where one cannot, that is
 * sought in which they are raised, and lowered from there */
static int posture_to_rise(climb_t *c, const int *contact, const int *kept, const wish_t *given, double *state, double *slack, int *which) {
    wish_t wish = *given;
    placed_t placed[MOST_LIMBS];
    double center[3];
    const int how = posture(c, contact, &wish, state, state + 12, slack, which);
    if (how != STANDS || clear_once_up(c, contact, kept, state, 0) >= 0.0) return how;
    for (int l = 0; l < c->limbs; l++)
        if (contact[l] >= 0 && contact[l] != kept[l] && c->limb[l].angles >= c->limb[l].rows) wish.raised[l] = RISEN * c->limb[l].length;
    for (int look = 0; look <= RISING; look++) {
        if (posture(c, contact, &wish, state, state + 12, slack, which) != STANDS || !tighten(c, contact, given, state, state + 12)) break;
        place_all(c, state, state + 12, placed, center);
        *slack = slack_of(c, wish.support, center, wish.slack);
        if (*slack >= wish.slack) return link_clearance(c, contact, state, placed, which) >= 0.0 ? STANDS : TOUCHES;
        /* A limb that is lowered takes the centre of mass along */
        wish.more += wish.slack - *slack;
    }
    return NOT_REACHED;
}

/* A posture near `state`, in place, to which limbs come from `from` on that hold all the time, `held`, and from which those that are
 * not kept rise: links that touch on that way, or once those are up, are kept apart in another posture, if there is one. `strict`:
 * whether limbs have to rise, and links that hold to be clear on the way */
static int posture_from(climb_t *c, const int *contact, const int *kept, const int *held, const wish_t *given, int strict,
                        const double *from, double *state, double *slack, int *which) {
    wish_t wish = *given;
    double own[12 + MOST_LIMBS * MOST_ANGLES], least, far;
    const size_t size = (size_t)(12 + c->offset[c->limbs]) * sizeof *own;
    int first = STANDS, stands = 0, pair[4];
    memcpy(own, state, size);
    for (int look = 0; look <= RISING; look++) {
        int how = strict ? posture_to_rise(c, contact, kept, &wish, own, &least, pair) : posture(c, contact, &wish, own, own + 12, &least, pair);
        const int found = how == STANDS;
        if (found) how = follow(c, held, contact, &wish, strict, from, from + 12, own, own + 12, &least, pair, &far);
        if (how == STANDS || !look) memcpy(state, own, size), memcpy(which, pair, 2 * sizeof *pair), *slack = least;
        if (!look) first = how;
        stands |= how == STANDS;
        if (!strict || !found || (how != STANDS && how != TOUCHES)) break;
        if (how == STANDS && (far = clear_once_up(c, contact, kept, own, pair)) >= 0.0) break;
        keep_apart(&wish, pair, far);
    }
    return stands ? STANDS : first;
}

/* Another beginning than the present state: the body as guessed and lower or higher, all limbs as from rest; in place */
static void begin_anew(const climb_t *c, const int *contact, const double (*touch)[12], int attempt, double *state) {
    double own[12];
    guess_body(c, contact, touch, state);
    for (int i = 0; i < 3; i++) state[9 + i] += (attempt == 1 ? 0.0 : attempt == 2 ? LOWER : -LOWER) * c->length * c->down[i];
    for (int l = 0; l < c->limbs; l++) {
        double *now = state + 12 + c->offset[l];
        if (contact[l] < 0) continue;
        own_pose(state, c->foothold + 12 * contact[l], own);
        if (!postures(c->limb + l, own, c->limb[l].rest, 1, now))
            memcpy(now, c->limb[l].rest, (size_t)c->limb[l].angles * sizeof *now);
    }
}

/* The posture from which limbs of which others are kept let go, which is the present one where those bear it; in place. `slack`:
 * the least; `moves`: whether it is another one */
static int lift_off(climb_t *c, const int *contact, const int *kept, double wanted, const double (*touch)[12], int attempt,
                    double *state, double *slack, int *which, int *moves) {
    wish_t wish = {.support = support_of(c, kept), .slack = wanted, .rest = REST};
    if (!wish.support) return NOT_BORNE;
    placed_t placed[MOST_LIMBS];
    double center[3], from[12 + MOST_LIMBS * MOST_ANGLES];
    const size_t size = (size_t)(12 + c->offset[c->limbs]) * sizeof *from;
    place_all(c, state, state + 12, placed, center);
    *moves = 0;
    *slack = slack_of(c, wish.support, center, wanted);
    if (*slack == -INFINITY) return NOT_BORNE;
    memcpy(from, state, size);
    if (*slack >= wanted) {
        if (attempt == LAST_ATTEMPT) return STANDS;
        const int rises = clear_once_up(c, contact, kept, state, 0) >= 0.0;
        const double far = rises ? clear_once_up(c, contact, kept, state, which) : 0.0, had = *slack;
        if (rises && far >= 0.0) return STANDS;
        if (rises) keep_apart(&wish, which, far);
        *moves = posture_from(c, contact, kept, contact, &wish, 1, from, state, slack, which) == STANDS &&
                 clear_once_up(c, contact, kept, state, which) >= 0.0;
        if (!*moves) memcpy(state, from, size), *slack = had;
        return rises || *moves ? STANDS : NOT_REACHED;
    }
    *moves = 1;
    if (attempt) begin_anew(c, contact, touch, attempt, state);
    return posture_from(c, contact, kept, contact, &wish, attempt < LAST_ATTEMPT, from, state, slack, which);
}

/* From there, the posture at which limbs hold again or are at rest in the air; in place */
static int land_on(climb_t *c, const int *next, const int *kept, double wanted, const double (*touch)[12], int attempt,
                   double *state, double *slack, int *which) {
    wish_t wish = {.support = support_of(c, kept), .slack = wanted, .rest = REST};
    if (!wish.support) return NOT_BORNE;
    double from[12 + MOST_LIMBS * MOST_ANGLES];
    memcpy(from, state, (size_t)(12 + c->offset[c->limbs]) * sizeof *from);
    guess_body(c, next, touch, state);
    for (int l = 0; l < c->limbs; l++) {
        double *now = state + 12 + c->offset[l];
        if (next[l] >= 0 && next[l] == kept[l]) continue;
        if (next[l] < 0) memcpy(now, c->limb[l].rest, (size_t)c->limb[l].angles * sizeof *now);
        else begin_limb(c->limb + l, state, c->foothold + 12 * next[l], now);
    }
    if (attempt) begin_anew(c, next, touch, attempt, state);
    return posture_from(c, next, kept, kept, &wish, attempt < LAST_ATTEMPT, from, state, slack, which);
}

#endif
