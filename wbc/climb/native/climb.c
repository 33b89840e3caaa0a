/* What the planner of climbing asks for many times. */
#include "along.h"
#include "close.h"
#include "time_law.h"

long long wbc_limb_size(void) { return (long long)sizeof(limb_t); }

/* Contact poses of n postures in the body's frame, 12 each */
void wbc_touches(const limb_t *l, long n, const double *angle, double *out) {
    placed_t placed;
    for (long k = 0; k < n; k++) {
        place_steps(l, AT_BODY, angle + k * l->angles, &placed);
        memcpy(out + 12 * k, placed.tip, sizeof placed.tip);
    }
}

/* Up to `most` postures of each of n wanted poses, and how many */
void wbc_postures(const limb_t *l, long n, const double *wanted, const double *seed, int most, double *out, int *count) {
    for (long k = 0; k < n; k++)
        count[k] = postures(l, wanted + 12 * k, seed ? seed + k * l->angles : 0, most, out + (size_t)k * most * l->angles);
}

long long wbc_climb_size(void) { return (long long)sizeof(climb_t); }

/* Frees what was kept of supports */
void wbc_climb_forget(climb_t *c) {
    for (int k = 0; k < c->places; k++) free(c->support[k]);
    free(c->support), free(c->work), free(c->gap);
    c->support = 0, c->work = c->gap = 0, c->places = c->supports = c->largest = 0;
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

/* As of largest_slack, -INFINITY where there is no memory */
double wbc_largest_slack(int n, int m, const double *G, const double *r, const double *A, const double *b, const double *s) {
    double bound[7], *work = malloc(balance_work(n, m) * sizeof *work);
    const double slack = work ? largest_slack(n, m, G, r, A, b, s, bound, work) : -INFINITY;
    free(work);
    return slack;
}

static void padded(const climb_t *c, const int *contact, int *out) {
    for (int l = 0; l < MOST_LIMBS; l++) out[l] = l < c->limbs ? contact[l] : -1;
}

/* A posture on contacts that is borne by one set of them. `body`: place and turn weights, then a pose; `followed`: whether the limbs
 * that hold are followed from the state given. `state`: pose of the body and angles, in place; `slack`: its own */
int wbc_stand(climb_t *c, const int *contact, const int *bears, double wanted, const double *body, int followed, double *state,
              double *slack) {
    int all[MOST_LIMBS];
    padded(c, bears, all);
    wish_t wish = {.support = support_of(c, all), .slack = wanted, .place = body[0], .turn = body[1], .rest = REST};
    memcpy(wish.pose, body + 2, sizeof wish.pose);
    if (!wish.support) return NOT_BORNE;
    double from[12 + MOST_LIMBS * MOST_ANGLES], far;
    int which[2];
    memcpy(from, state, (size_t)(12 + c->offset[c->limbs]) * sizeof *from);
    const int how = posture(c, contact, &wish, state, state + 12, slack, which);
    if (how != STANDS || !followed) return how;
    return follow(c, contact, contact, &wish, 1, from, from + 12, state, state + 12, slack, which, &far);
}

/* How many limbs cannot lift off a state without touching something, each by itself */
int wbc_stuck(climb_t *c, const int *contact, const double *state) {
    int all[MOST_LIMBS], kept[MOST_LIMBS], which[2], count = 0;
    padded(c, contact, all);
    for (int l = 0; l < c->limbs; l++) {
        memcpy(kept, all, sizeof kept);
        kept[l] = -1;
        count += all[l] >= 0 && (clear_once_up(c, all, kept, state, 0) < 0.0 || clear_once_up(c, all, kept, state, which) < 0.0);
    }
    return count;
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

int wbc_lift(climb_t *c, const int *contact, const int *kept, double wanted, const double *touch, int attempt, int *moves, double *state,
             double *slack) {
    int all[MOST_LIMBS], which[2];
    padded(c, kept, all);
    return lift_off(c, contact, all, wanted, (const double (*)[12])touch, attempt, state, slack, which, moves);
}

int wbc_land(climb_t *c, const int *next, const int *kept, double wanted, const double *touch, int attempt, double *state,
             double *slack) {
    int all[MOST_LIMBS], which[2];
    padded(c, kept, all);
    return land_on(c, next, all, wanted, (const double (*)[12])touch, attempt, state, slack, which);
}

/* Single limbs that may hold elsewhere next, as far (and turned) from rest as squared lengths from `least` on and below `most`:
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
            double far = dot3(apart, apart) / (c->limb[l].length * c->limb[l].length);
            for (int i = 0; i < 3 && c->limb[l].rows == 6; i++) { /* an angle of 1 rad counts as a length */
                const double turned = own[3 * i] - c->foothold[12 * f + 3 * i];
                far += turned * turned;
            }
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

/* What is known of a way: `rest`: contact poses at rest, 12 each; `body`: its poses at `end` + 1 instants; `every`: samples from rough
 * one to rough one; `numbers`: height and least instants of swings, least slack; `step`, `most`: of all angles, limb by limb */
along_t *wbc_along(climb_t *c, const double *rest, int end, const double *body, int every, const double *numbers, const double *step,
                   const double *most, int postures) {
    along_t *a = calloc(1, sizeof *a);
    if (!a) return 0;
    if (setjmp(a->no_memory)) return wbc_along_forget(a), (along_t *)0;
    a->climb = c, a->rest = rest, a->end = end, a->body = body, a->every = every;
    a->samples = (end + INTERVAL - 1) / INTERVAL + 1;
    a->height = numbers[0], a->shortest = (int)numbers[1], a->margin = numbers[2];
    a->work = got(a, malloc(sizeof *a->work * (MOST_ANGLES + 1) * ((size_t)a->samples + 8)));
    a->trunk = got(a, calloc((size_t)a->samples, 1));
    a->placed = got(a, malloc(sizeof *a->placed * MOST_LIMBS));
    begin_along(a, step, most, postures);
    return a;
}

/* Adds a span that begins with some angles; its row, -1: there is none, or -2: no memory, as with those below */
int wbc_along_begun(along_t *a, int limb, int place, const double *angle) {
    if (setjmp(a->no_memory)) return -2;
    const int row = a->spans;
    spans_at(a, limb, place, 1, angle);
    return a->spans > row ? row : -1;
}

/* Of each span the limb, the place, the first and last instant, and swings that are left (-1: it leads nowhere), 5 each; how many */
int wbc_along_spans(along_t *a, int *out) {
    if (!out) return a->spans;
    count_swings(a);
    for (int k = 0; k < a->spans; k++, out += 5) {
        const span_t *s = a->span + k;
        out[0] = s->limb, out[1] = s->place, out[2] = begins(a, s), out[3] = lasts(a, s), out[4] = isinf(s->left) ? -1 : (int)s->left;
    }
    return a->spans;
}

/* Begins anew, with so many standings kept, on the spans of `count` first ones */
int wbc_along_begin(along_t *a, int width, int count, const int *row) {
    if (setjmp(a->no_memory)) return -2;
    drop_levels(a, 0);
    a->width = width, a->alike = 1 + width / 32;
    add_level(a);
    for (int k = 0; k < count; k++) {
        standing_t s = {{0}, 0, 0, -1, 0, 0, 0, 0, 0, 0, WAITS, 0, 0.0};
        memcpy(s.row, row + (long)k * a->climb->limbs, sizeof(int) * a->climb->limbs);
        add_standing(a, a->level, &s);
    }
    return keep_some(a, width);
}

/* As along_way, with about so many standings looked at; of each standing its limb, lift, landing, and the place of each limb. How many */
int wbc_along_way(along_t *a, long most, double *angles, int *out) {
    if (setjmp(a->no_memory)) return -2;
    if (!along_way(a, most, angles)) return 0;
    standing_t *chain[a->levels];
    chain_of(a, arrived(a), chain);
    for (int d = 0; d < a->levels; d++) {
        *out++ = chain[d]->limb, *out++ = chain[d]->lift - chain[d]->early, *out++ = chain[d]->now + chain[d]->late;
        for (int l = 0; l < a->climb->limbs; l++) *out++ = a->span[chain[d]->row[l]].place;
    }
    return a->levels;
}

/* How far a way is known to lead, how many standings were looked at, and why others are none */
void wbc_along_told(const along_t *a, long *out) {
    *out++ = a->furthest, *out++ = a->looked;
    memcpy(out, a->why, sizeof a->why);
}

void wbc_along_refuse(along_t *a, int level) { refuse_found(a, level); }

/* Weight of pairs that are too near and of slack that lacks in bands: they come to rest where these still push */
#define PUSH 3e2

/* Of n states the normal equations of least squares over twist of the body and all angles, m = 6 + angles of them: H ``(m, m)``, its
 * lower half, and g. `closed`: limb by limb whether its contact is to be at the pose `wanted` (12 each); `bound` (4 each): of a slack;
 * `aside`: how much further apart than they have to be pairs are led [m]. `cost`: what rows cost; `far`: clearances [m]; `open`: squared errors of contacts [lengths squared]; `center`: of mass */
void wbc_band(climb_t *c, long n, const int *contact, const char *closed, const double *wanted, int bounds, const double *bound,
              double slack, double aside, const double *state, double *H, double *g, double *cost, double *far, double *open, double *center) {
    const int angles = c->offset[c->limbs], m = 6 + angles;
    placed_t placed[MOST_LIMBS];
    near_t near = {.seen = EVERYTHING, .of = EVERYTHING, .within = aside};
    int start[MOST_LIMBS], which[2];
    for (int l = 0; l < c->limbs; l++) start[l] = 6 + c->offset[l];
    memset(H, 0, sizeof *H * (size_t)(n * m * m)), memset(g, 0, sizeof *g * (size_t)(n * m));
    for (long k = 0; k < n; k++, state += 12 + angles, H += m * m, g += m, contact += c->limbs, closed += c->limbs, center += 3) {
        place_all(c, state, state + 12, placed, center);
        open[k] = 0.0;
        for (int l = 0; l < c->limbs; l++) {
            double by[3];
            minus3(placed[l].tip + 9, c->foothold + 12 * (contact[l] < 0 ? 0 : contact[l]) + 9, by);
            near.off[l] = sqrt(dot3(by, by));
            if (closed[l]) open[k] += add_contact(c, l, placed + l, wanted + (k * c->limbs + l) * 12, state, start[l], m, H, g);
        }
        cost[k] = HOLDS * open[k];
        near.count = 0;
        far[k] = clearance_near(c, contact, state, placed, which, &near);
        for (int i = 0; i < near.count; i++) cost[k] += add_avoided(c, contact, near.off, near.pair[i], (near.pair[i][1] < 0 ? OF_LINKS : 1.0) * aside, state, placed, start, PUSH, m, H, g);
        for (int i = 0; i < bounds; i++) cost[k] += add_bound(c, bound + 4 * i, slack, center, state, placed, start, PUSH, m, H, g);
    }
}

/* Of n states of a body and its limbs' angles the contacts of some limbs at poses in the world, 12 each, of which turns count or not:
 * closed in at most `steps` steps of `close_once`; the largest errors that are left */
void wbc_close(const limb_t *limbs, const int *offset, int size, int contacts, const int *which, const double *wanted, int turned,
               double body, double enough, int steps, long n, double *state, double *left) {
    limb_t limb[MOST_LIMBS];
    const climb_t c = {.length = 1.0, .limb = limb, .offset = offset};
    for (int k = 0; k < contacts; k++) {
        limb[which[k]] = limbs[which[k]];
        if (!turned) limb[which[k]].rows = 3;
    }
    for (long k = 0; k < n; k++) {
        double *at = state + k * size;
        for (int step = 0; step <= steps; step++) {
            left[k] = close_once(&c, size - 6, contacts, which, wanted + k * contacts * 12, body, step < steps ? enough : 1e300, at);
            if (!(left[k] >= enough) || !(left[k] < 1e3)) break;
        }
    }
}
