/* The robot, the footholds and the bodies in the world; which centres of mass contacts bear, as bounds that are kept; and
 * whether links are clear. */
#ifndef WBC_STAND_H
#define WBC_STAND_H

#include "balance.h"
#include "measure.h"
#include "reach.h"

/* Bounds on the slack that are kept of a set of contacts */
#define BOUNDS 12
/* Bounding spheres from which on shapes have no end [m] */
#define ENDLESS 1e6

/* Wrenches of a contact: w = N x with A x + s t <= b, in weights */
typedef struct {
    int forces, rows;
    const double *N, *A, *b, *s;
} cone_t;

/* Contacts that bear: slack <= bound[0] + bound[1..3] center, and -INFINITY where they never do */
typedef struct {
    int contact[MOST_LIMBS], bounds, never;
    double bound[BOUNDS][4];
} support_t;

/* A shape of the robot on a step of a limb (-1, -1: on the body); `tip`: whether it is on the limb's last link, `depth`: then how
 * deep it may be in what the limb holds */
typedef struct {
    int limb, step, shape, tip;
    double depth, place[12];
} piece_t;

typedef struct {
    int limbs, footholds, pieces, bodies, pairs, weightless;
    double mass, length, clear, apart, down[3], trunk[4];
    const limb_t *limb;
    const int *offset;        /* of a limb's angles among all */
    const double *foothold;   /* poses, 12 each */
    const int *cone_of;       /* limb by limb the cone at each foothold, -1: it may not hold there */
    const cone_t *cone;
    const int *on;            /* the body that each foothold is on, -1: none */
    const int *hold;          /* footholds of one number here are one place, held at different turns */
    const piece_t *piece;
    const shape_t *shape;     /* of the pieces, then of the bodies */
    const double *body;       /* poses of their centres, 12 each */
    const int *pair;          /* of pieces, 2 each */
    support_t **support;      /* hashed by contacts */
    int places, supports, largest;
    double *work, *gap;
    long programs; /* so far */
} climb_t;

static unsigned hashed(const int *contact, int limbs) {
    unsigned h = 2166136261u;
    for (int k = 0; k < limbs; k++) h = (h ^ (unsigned)(contact[k] + 1)) * 16777619u;
    return h ^ (h >> 15);
}

static int place_of(support_t **table, int places, const int *contact, int limbs) {
    unsigned at = hashed(contact, limbs) & (unsigned)(places - 1);
    while (table[at] && memcmp(table[at]->contact, contact, (size_t)limbs * sizeof *contact)) at = (at + 1) & (unsigned)(places - 1);
    return (int)at;
}

/* What is known of some contacts; 0: there is no memory */
static support_t *support_of(climb_t *c, const int *contact) {
    if (2 * c->supports >= c->places) {
        const int places = c->places ? 2 * c->places : 256;
        support_t **table = calloc((size_t)places, sizeof *table);
        if (!table) return 0;
        for (int k = 0; k < c->places; k++)
            if (c->support[k]) table[place_of(table, places, c->support[k]->contact, c->limbs)] = c->support[k];
        free(c->support);
        c->support = table, c->places = places;
    }
    const int at = place_of(c->support, c->places, contact, c->limbs);
    if (c->support[at]) return c->support[at];
    support_t *made = calloc(1, sizeof *made);
    if (!made) return 0;
    memcpy(made->contact, contact, (size_t)c->limbs * sizeof *contact);
    c->supports++;
    return c->support[at] = made;
}

/* The slack [1] of wrenches of contacts that give `wrench`: force, then moment about `point` [weights, weights m]; `bound` b, with which
 * slack <= b0 + b1..6 wrench for every wrench about that point. `poses`: of the contacts, limb by limb; 0: those of their places */
static double slack_of_wrench(climb_t *c, const int *contact, const double *poses, const double *point, const double *wrench,
                              double *bound) {
    int n = 0, m = 0, count = 0;
    double middle[3] = {0};
    for (int l = 0; l < c->limbs; l++) {
        if (contact[l] < 0) continue;
        const cone_t *cone = c->cone + c->cone_of[l * c->footholds + contact[l]];
        n += cone->forces, m += cone->rows, count++;
        const double *pose = poses ? poses + 12 * l : c->foothold + 12 * contact[l];
        for (int i = 0; i < 3; i++) middle[i] += pose[9 + i];
    }
    memset(bound, 0, 7 * sizeof *bound);
    if (n < 6) return bound[0] = -INFINITY;
    const size_t needed = 6 * (size_t)n + (size_t)m * n + 2 * (size_t)m + balance_work(n, m);
    if ((size_t)c->largest < needed) {
        double *work = realloc(c->work, needed * sizeof *work);
        if (!work) return bound[0] = -INFINITY;
        c->work = work, c->largest = (int)needed;
    }
    double *G = c->work, *A = G + 6 * n, *b = A + (size_t)m * n, *s = b + m, r[6];
    memset(G, 0, sizeof *G * (6 * (size_t)n + (size_t)m * n));
    for (int i = 0; i < 3; i++) middle[i] /= count;
    int column = 0, row = 0;
    for (int l = 0; l < c->limbs; l++) {
        if (contact[l] < 0) continue;
        const cone_t *cone = c->cone + c->cone_of[l * c->footholds + contact[l]];
        const double *pose = poses ? poses + 12 * l : c->foothold + 12 * contact[l];
        double arm[3], force[3], moment[3], by[3];
        minus3(pose + 9, middle, arm);
        for (int k = 0; k < cone->forces; k++) {
            const double own[6] = {cone->N[k], cone->N[cone->forces + k], cone->N[2 * cone->forces + k],
                                   cone->N[3 * cone->forces + k], cone->N[4 * cone->forces + k], cone->N[5 * cone->forces + k]};
            turn(pose, own, force), turn(pose, own + 3, moment);
            cross3(arm, force, by);
            for (int i = 0; i < 3; i++) {
                G[i * n + column + k] = force[i];
                G[(3 + i) * n + column + k] = (moment[i] + by[i]) / c->length;
            }
        }
        for (int j = 0; j < cone->rows; j++, row++) {
            memcpy(A + row * n + column, cone->A + j * cone->forces, (size_t)cone->forces * sizeof *A);
            b[row] = cone->b[j], s[row] = cone->s[j];
        }
        column += cone->forces;
    }
    double arm[3], moment[3], by[3];
    minus3(point, middle, arm);
    cross3(arm, wrench, moment);
    for (int i = 0; i < 3; i++) r[i] = wrench[i], r[3 + i] = (wrench[3 + i] + moment[i]) / c->length;
    c->programs++;
    const double slack = largest_slack(n, m, G, r, A, b, s, bound, s + m);
    for (int i = 4; i < 7; i++) bound[i] /= c->length;
    cross3(bound + 4, arm, by);
    for (int i = 0; i < 3; i++) bound[1 + i] += by[i];
    if (slack == -INFINITY) bound[0] = slack;
    return slack;
}

/* The same where they bear the robot at rest with a centre of mass; `bound` over that, 4 numbers */
static double slack_by_program(climb_t *c, const int *contact, const double *poses, const double *center, double *bound) {
    const double weight[6] = {-c->down[0], -c->down[1], -c->down[2]};
    double all[7];
    const double slack = slack_of_wrench(c, contact, poses, center, weight, all);
    /* Moved by d the weight has the moment d x (-down) about the old centre */
    cross3(all + 4, c->down, bound + 1);
    bound[0] = all[0] + dot3(all + 1, weight) - dot3(bound + 1, center);
    return slack;
}

/* The slack where bounds leave at least `wanted`, else the least of them; INFINITY where nothing weighs and contacts hold */
static double slack_of(climb_t *c, support_t *known, const double *center, double wanted) {
    double least = INFINITY, bound[4];
    if (known->never) return -INFINITY;
    for (int k = 0; k < known->bounds; k++) least = fmin(least, known->bound[k][0] + dot3(known->bound[k] + 1, center));
    if (least < wanted) return least;
    if (c->weightless && known->bounds) return INFINITY;
    const double slack = slack_by_program(c, known->contact, 0, center, bound);
    if (slack == -INFINITY || (c->weightless && slack < 1e-9)) {
        known->never = 1;
        return -INFINITY;
    }
    const int at = known->bounds < BOUNDS ? known->bounds++ : (int)(c->programs % BOUNDS);
    memcpy(known->bound[at], bound, sizeof bound);
    if (!c->weightless) return slack;
    known->bound[at][0] = INFINITY;
    return INFINITY;
}

static void place_piece(const climb_t *c, int k, const double *base, const placed_t *placed, double *out) {
    const piece_t *p = c->piece + k;
    compose(p->limb < 0 ? base : placed[p->limb].pose[p->step], p->place, out);
}

/* The distance that a tip keeps from what its limb holds while the contact is `off` away from the foothold, as wbc/climb/clear.py
 * proves it */
static double tip_distance(const climb_t *c, const piece_t *p, double off) {
    return fmin(c->clear, 0.5 * off - p->depth);
}

/* The distance that a piece keeps from a body, or (-1 - piece) from another piece [m]; `off`: how far contacts are from their
 * footholds [m], 0: all are there */
static double kept_distance(const climb_t *c, const int *contact, const double *off, int piece, int other) {
    const piece_t *p = c->piece + piece;
    if (other < 0) return c->apart;
    return p->tip && contact[p->limb] >= 0 && c->on[contact[p->limb]] == other ? tip_distance(c, p, off ? off[p->limb] : 0.0) : c->clear;
}

/* Limbs as bits, and the body */
#define BODY 1u
#define EVERYTHING ~0u
static unsigned bit_of(int limb) { return BODY << (limb + 1); }

/* No more than the signed distance of two convex shapes, or of one from an endless cylinder: that along a direction in the world */
static double gap_along(const shape_t *a, const double *A, const shape_t *b, const double *B, const double *normal) {
    view_t v;
    shape_t piece;
    double own[3];
    view_of(a, A, b, B, &v);
    if (b->kind == ROD) beside_rod(&v, &piece);
    turn_back(A, normal, own);
    return clearance(&v, own) - a->size[4] - v.b->size[4];
}

/* A row for every piece and body, then for every pair: two poses, the second one of pairs only, the distance at these, and the normal
 * if that was measured; then the least and the greatest corner of every body along the axes of the world. 0: there is no memory */
#define GAP_ROW 29
static double *gap_rows(climb_t *c) {
    if (c->gap) return c->gap;
    const size_t rows = (size_t)c->pieces * c->bodies + c->pairs, numbers = rows * GAP_ROW;
    if (!(c->gap = malloc((numbers + 6 * (size_t)c->bodies + 1) * sizeof *c->gap))) return 0;
    for (size_t k = 0; k < rows; k++) c->gap[k * GAP_ROW + 24] = -INFINITY;
    for (int j = 0; j < c->bodies; j++) {
        const shape_t *b = c->shape + c->pieces + j;
        for (int i = 0; i < 3; i++) {
            const double *at = c->body + 12 * j, axis[3] = {at[3 * i], at[3 * i + 1], at[3 * i + 2]};
            const double far = b->size[5] >= ENDLESS ? INFINITY : convex(b) ? reach(b, axis) + b->size[4] : b->size[5];
            c->gap[numbers + 6 * j + i] = at[9 + i] - far, c->gap[numbers + 6 * j + 3 + i] = at[9 + i] + far;
        }
    }
    return c->gap;
}

/* The square of how far a point is outside of a box along the axes of the world [m^2] */
static double outside_of(const double *box, const double *point) {
    double square = 0.0;
    for (int i = 0; i < 3; i++) {
        const double out = fmax(fmax(box[i] - point[i], point[i] - box[3 + i]), 0.0);
        square += out * out;
    }
    return square;
}

/* How far no point of a ball round the origin of a pose moves on to another one [m] */
static double moved_within(const double *from, const double *to, double radius) {
    double turned = 0.0, by[3];
    minus3(to + 9, from + 9, by);
    for (int i = 0; i < 9; i++) turned += (to[i] - from[i]) * (to[i] - from[i]);
    return sqrt(dot3(by, by)) + radius * sqrt(turned);
}

/* Which links count: those that are `seen`, and of each pair one of those whose clearance it is, `of`. Pairs, as of link_clearance,
 * that keep less than `within` more than they have to [m], of links a share of that; `off`: as of kept_distance */
#define MOST_NEAR 64
#define OF_LINKS 0.2
typedef struct {
    unsigned seen, of;
    double within, off[MOST_LIMBS];
    int count, pair[MOST_NEAR][2];
} near_t;

/* Least distance less what is kept [m] of links from bodies and each other, as far as it may be below 0. `which`: piece, and body or
 * -1 - piece. `near`: all pairs that are; where `within` is 0, one that lacks is enough */
static double clearance_near(climb_t *c, const int *contact, const double *base, const placed_t *placed, int *which, near_t *near) {
    const tolerance_t how = {1e-10 * c->length, 1e-9 * c->length, 1e-5 * c->length};
    double pose[c->pieces ? c->pieces : 1][12], least = INFINITY, *const known = gap_rows(c), middle[3] = {0}, around = 0.0;
    const double *boxes = known ? known + ((size_t)c->pieces * c->bodies + c->pairs) * GAP_ROW : 0;
    unsigned bit[c->pieces ? c->pieces : 1];
    int beside_robot[c->bodies ? c->bodies : 1], count = 0, placed_pieces = 0;
    for (int k = 0; k < c->pieces; k++)
        if ((bit[k] = near->seen & bit_of(c->piece[k].limb))) {
            place_piece(c, k, base, placed, pose[k]);
            for (int i = 0; i < 3; i++) middle[i] += pose[k][9 + i];
            placed_pieces++;
        }
    for (int i = 0; i < 3 && placed_pieces; i++) middle[i] /= placed_pieces;
    for (int k = 0; k < c->pieces; k++) {
        double apart[3];
        if (!bit[k]) continue;
        minus3(pose[k] + 9, middle, apart);
        around = fmax(around, sqrt(dot3(apart, apart)) + c->shape[c->piece[k].shape].size[5]);
    }
    around += fmax(c->clear, 0.0) + near->within;
    for (int j = 0; j < c->bodies; j++)
        if (!boxes || outside_of(boxes + 6 * j, middle) <= around * around) beside_robot[count++] = j;
    for (int k = 0; k < c->pieces + c->pairs; k++) {
        const int own = k >= c->pieces;
        const int i = own ? c->pair[2 * (k - c->pieces)] : k, beside = own ? c->pair[2 * (k - c->pieces) + 1] : i;
        if (!bit[i] || !bit[beside] || !((bit[i] | bit[beside]) & near->of)) continue;
        const shape_t *a = c->shape + c->piece[i].shape;
        for (int body = 0; body < (own ? 1 : count); body++) {
            const int j = own ? 0 : beside_robot[body], other = own ? beside : j;
            const shape_t *b = c->shape + (own ? c->piece[other].shape : c->pieces + j);
            const double *at = own ? pose[other] : c->body + 12 * j;
            const double least_kept = kept_distance(c, contact, near->off, i, own ? -1 - other : j);
            const double keep = least_kept + near->within * (own ? OF_LINKS : 1.0), sum = a->size[5] + fmax(keep, 0.0);
            if (own && b->size[5] < ENDLESS) {
                double apart[3];
                minus3(pose[i] + 9, at + 9, apart);
                if (dot3(apart, apart) > (sum + b->size[5]) * (sum + b->size[5])) continue;
            }
            if (!own && boxes && outside_of(boxes + 6 * j, pose[i] + 9) > sum * sum) continue;
            /* Where neither has moved far since they were measured last they are not measured again */
            double *last = known ? known + ((size_t)(own ? c->pieces * c->bodies + k - c->pieces : k * c->bodies + j)) * GAP_ROW : 0;
            if (last && last[24] > keep) {
                double far = last[24] - keep - moved_within(last, pose[i], a->size[5]) - how.tie;
                if (own) far -= moved_within(last + 12, at, b->size[5]);
                if (far > 0.0) continue;
            }
            answer_t found;
            const int known_way = last && last[24] > -INFINITY && convex(a) && (convex(b) || b->kind == ROD);
            if (known_way && (found.gap = gap_along(a, pose[i], b, at, last + 25)) > keep + how.tie) {
                memcpy(last, pose[i], 12 * sizeof *last), memcpy(last + 12, at, 12 * sizeof *last), last[24] = found.gap;
                continue;
            }
            measure_shapes(&how, a, pose[i], b, at, &found);
            if (last) {
                memcpy(last, pose[i], 12 * sizeof *last), memcpy(last + 12, at, 12 * sizeof *last), last[24] = found.gap;
                copy3(found.normal, last + 25);
            }
            const int pair[2] = {i, own ? -1 - other : j};
            if (found.gap < keep && near->count < MOST_NEAR) memcpy(near->pair[near->count++], pair, sizeof pair);
            if (found.gap - least_kept < least) least = found.gap - least_kept, memcpy(which, pair, sizeof pair);
            if (near->within == 0.0 && least < 0.0) return least;
        }
    }
    return least;
}

static double link_clearance(climb_t *c, const int *contact, const double *base, const placed_t *placed, int *which) {
    near_t all = {.seen = EVERYTHING, .of = EVERYTHING};
    return clearance_near(c, contact, base, placed, which, &all);
}

#endif
