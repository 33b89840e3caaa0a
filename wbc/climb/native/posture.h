/* A posture of the whole robot on its contacts: least squares over the body's pose and the angles of the limbs that hold. */
#ifndef WBC_POSTURE_H
#define WBC_POSTURE_H

#include "stand.h"

#define MOST_VARIABLES (6 + MOST_LIMBS * 8)
/* Iterations of Gauss and Newton between two looks at the equilibrium, and looks */
#define SWEEPS 25
#define LOOKS 10
/* Moves below this end the sweeps: what contacts lack then is made up by their limbs [rad, m of the length] */
#define NEAR_ENOUGH 2e-2
/* How often a sweep is solved again for angles that would go beyond their limits */
#define ROUNDS 6
/* Longest step of a sweep [rad, lengths of the robot] */
#define LONGEST_SWEEP 0.6
/* Sweeps end where so many of them leave more than this share of the sum of squared errors of contacts, if that is more than enough
 * [lengths squared] */
#define STALLED 4
#define STALLS 0.5
#define CLOSE 1e-10
/* Contacts that limbs alone leave open by less are closed by the body too: what sweeps leave at limits of joints [lengths] */
#define GIVES 1e-5
/* Weights of contacts and of the equilibrium's bounds over those of angles from rest [1/m^2 of the robot's length] */
#define HOLDS 1e4
#define BEARS 1e3
/* What a centre of mass is led beyond a bound, in weights */
#define BEYOND 2e-3

/* Pairs that are kept apart in one posture, and what they are led beyond [lengths of the robot] */
#define AVOIDED 6
#define ASIDE 1e-2
/* How much clearer of bodies postures are than they have to be, where that can be [lengths of the robot] */
#define CLEARER 7e-3

/* What is wanted: the slack of a support (0: none), which `more` is aimed at above, and the body at a pose by weights of place and turn */
typedef struct {
    support_t *support;
    double slack, more, place, turn, rest, pose[12];
    int avoided, avoid[AVOIDED][2]; /* pairs, as of link_clearance, that are kept apart */
    double aside;                   /* how much further than ASIDE [m] */
    double raised[MOST_LIMBS];      /* how far above its place each contact is wanted [m] */
} wish_t;

enum { STANDS, NOT_REACHED, NOT_BORNE, TOUCHES, BREAKS };

/* All limbs at a configuration, and the centre of mass */
static void place_all(const climb_t *c, const double *base, const double *angle, placed_t *placed, double *center) {
    double at[3];
    turn(base, c->trunk + 1, at);
    for (int i = 0; i < 3; i++) center[i] = c->trunk[0] * (at[i] + base[9 + i]);
    for (int l = 0; l < c->limbs; l++) {
        place_limb(c->limb + l, base, angle + c->offset[l], placed + l);
        for (int i = 0; i < 3; i++) center[i] += placed[l].moment[0][i];
    }
    for (int i = 0; i < 3; i++) center[i] /= c->mass;
}

/* H += w row row', g += w r row over the chosen columns */
static void add_row(int n, double *H, double *g, const int *column, const double *value, int count, double r, double w) {
    for (int i = 0; i < count; i++) {
        const double by = w * value[i];
        g[column[i]] -= by * r;
        for (int k = 0; k < count; k++)
            if (column[k] <= column[i]) H[column[i] * n + column[k]] += by * value[k];
    }
}

/* Moves the body by a twist (linear, angular) */
static void move_body(double *base, const double *twist) {
    const double angle = sqrt(dot3(twist + 3, twist + 3));
    for (int i = 0; i < 3; i++) base[9 + i] += twist[i];
    if (angle < 1e-15) return;
    double R[9], next[9];
    const double u[3] = {twist[3] / angle, twist[4] / angle, twist[5] / angle};
    axis_angle(u, cos(angle), sin(angle), R);
    turns(R, base, next);
    memcpy(base, next, sizeof next);
}

/* How a point of a piece moves along n with the angles of its limb, times a sign, added to a row */
static void along_limb(const climb_t *c, int piece, const placed_t *placed, const double *point, const double *n,
                       double sign, const int *start, double *value, int *column, int *count) {
    const piece_t *p = c->piece + piece;
    if (p->limb < 0 || start[p->limb] < 0) return;
    for (int s = 0; s <= p->step; s++, ++*count) {
        const step_t *step = c->limb[p->limb].step + s;
        double arm[3], by[3];
        minus3(point, placed[p->limb].at[s], arm);
        cross3(placed[p->limb].axis[s], arm, by);
        value[*count] = sign * step->scale * dot3(n, step->shifts ? placed[p->limb].axis[s] : by);
        column[*count] = start[p->limb] + step->angle;
    }
}

/* The distance of a pair less what it keeps, and its row; `start`: of each limb its first column, -1: its angles stay */
static double avoiding(const climb_t *c, const int *contact, const double *off, const int *pair, const double *base,
                       const placed_t *placed, const int *start, double *value, int *column, int *count) {
    const tolerance_t how = {1e-10 * c->length, 1e-9 * c->length, 1e-5 * c->length};
    const int own = pair[1] < 0, other = own ? -1 - pair[1] : pair[1];
    double a[12], b[12], arm[3], lever[3], far_point[3];
    answer_t found;
    place_piece(c, pair[0], base, placed, a);
    if (own) place_piece(c, other, base, placed, b);
    measure_shapes(&how, c->shape + pair[0], a, c->shape + (own ? other : c->pieces + other), own ? b : c->body + 12 * other, &found);
    minus3(found.point, base + 9, arm);
    cross3(arm, found.normal, lever);
    for (int k = 0; k < 3; k++) {
        value[k] = own ? 0.0 : -found.normal[k], value[3 + k] = own ? 0.0 : -lever[k];
        column[k] = k, column[3 + k] = 3 + k;
    }
    along_limb(c, pair[0], placed, found.point, found.normal, -1.0, start, value, column, count);
    along3(found.point, found.gap, found.normal, far_point);
    if (own) along_limb(c, other, placed, far_point, found.normal, 1.0, start, value, column, count);
    return found.gap - kept_distance(c, contact, off, pair[0], pair[1]);
}

/* Rows that bring a contact to a pose; its squared error [lengths squared] */
static double add_contact(const climb_t *c, int l, const placed_t *placed, const double *goal, const double *base, int start, int n,
                          double *H, double *g) {
    const limb_t *limb = c->limb + l;
    const int k0 = limb->angles;
    double arm[3], A[6][MOST_ANGLES], E[6][6], r[6], value[6 + MOST_ANGLES], left = 0.0;
    int column[6 + MOST_ANGLES];
    const double unit = 1.0 / (c->length * c->length);
    contact_rows(limb, placed, goal, r, E, A);
    minus3(placed->tip + 9, base + 9, arm);
    for (int i = 0; i < limb->rows; i++) {
        double lever[3];
        cross3(arm, E[i], lever); /* E (w x arm) = w (arm x E) */
        for (int k = 0; k < 3; k++) {
            value[k] = E[i][k], value[3 + k] = lever[k] + E[i][3 + k];
            column[k] = k, column[3 + k] = 3 + k;
        }
        for (int k = 0; k < k0; k++) value[6 + k] = A[i][k], column[6 + k] = start + k;
        add_row(n, H, g, column, value, 6 + k0, r[i], HOLDS * unit);
        left += unit * r[i] * r[i];
    }
    return left;
}

/* The row that brings the centre of mass to where a bound leaves a slack; what it costs not to be there, as below */
static double add_bound(const climb_t *c, const double *bound, double slack, const double *center, const double *base,
                      const placed_t *placed, const int *start, double weight, int n, double *H, double *g) {
    const double size = sqrt(dot3(bound + 1, bound + 1)), short_of = slack + BEYOND - bound[0] - dot3(bound + 1, center);
    if (!(short_of > -BEYOND) || !(size * c->length > 1e-6)) return 0.0;
    double arm[3], lever[3], M[MOST_ANGLES][3], value[MOST_VARIABLES];
    int column[MOST_VARIABLES], count = 6;
    const double u[3] = {bound[1] / size, bound[2] / size, bound[3] / size};
    minus3(center, base + 9, arm);
    cross3(arm, u, lever);
    for (int k = 0; k < 3; k++) value[k] = u[k], value[3 + k] = lever[k], column[k] = k, column[3 + k] = 3 + k;
    for (int l = 0; l < c->limbs; l++) {
        if (start[l] < 0) continue;
        moment_jacobian(c->limb + l, placed + l, M);
        for (int k = 0; k < c->limb[l].angles; k++, count++) value[count] = dot3(u, M[k]) / c->mass, column[count] = start[l] + k;
    }
    const double by = weight * (1.0 / (c->length * c->length));
    add_row(n, H, g, column, value, count, -short_of / size, by);
    return by * short_of * short_of / (size * size);
}

/* The row that keeps a pair further apart than it has to be */
static double add_avoided(const climb_t *c, const int *contact, const double *off, const int *pair, double aside, const double *base,
                        const placed_t *placed, const int *start, double weight, int n, double *H, double *g) {
    double value[MOST_VARIABLES];
    int column[MOST_VARIABLES], count = 6;
    const double short_of = avoiding(c, contact, off, pair, base, placed, start, value, column, &count) - aside;
    if (!(short_of < 0.0)) return 0.0;
    const double by = weight * (1.0 / (c->length * c->length));
    add_row(n, H, g, column, value, count, short_of, by);
    return by * short_of * short_of;
}

/* The least of x H x / 2 - g x, n x n and positive, within bounds, in place of g: what a round would bring beyond a bound goes to it, and
 * the others are sought again; a step that is too long is shortened, and cut off there. `unit`: of the first three; 0: H is not positive */
static int solve_within(int n, const double *H, double *g, const double *low, const double *high, double unit) {
    double L[MOST_VARIABLES * MOST_VARIABLES], x[MOST_VARIABLES];
    char out[MOST_VARIABLES] = {0};
    for (int k = 0; k < n; k++) {
        out[k] = (low[k] >= 0.0 && g[k] < 0.0) || (high[k] <= 0.0 && g[k] > 0.0);
        x[k] = 0.0;
    }
    for (int round = 0; round < ROUNDS; round++) {
        double y[MOST_VARIABLES];
        int beyond = 0;
        memcpy(L, H, (size_t)(n * n) * sizeof *L), memcpy(y, g, (size_t)n * sizeof *y);
        for (int i = 0; i < n; i++) {
            if (!out[i]) continue;
            for (int k = 0; k < n; k++) {
                if (!out[k]) y[k] -= (i > k ? H[i * n + k] : H[k * n + i]) * x[i];
                L[(i > k ? i * n + k : k * n + i)] = 0.0;
            }
            L[i * (n + 1)] = 1.0, y[i] = x[i];
        }
        if (!solve_positive(n, L, y)) return 0;
        double longest = 0.0;
        for (int k = 0; k < n; k++) longest = fmax(longest, fabs(y[k]) / (k < 3 ? unit : 1.0));
        const int far = longest > LONGEST_SWEEP;
        for (int k = 0; k < n; k++) {
            if (far) y[k] *= LONGEST_SWEEP / longest;
            x[k] = fmin(fmax(y[k], low[k]), high[k]);
            if (x[k] != y[k]) out[k] = beyond = 1;
        }
        if (far || !beyond) break;
    }
    memcpy(g, x, (size_t)n * sizeof *g);
    return 1;
}

/* Where a contact is wanted */
static void contact_goal(const climb_t *c, const int *contact, const wish_t *wish, int l, double *goal) {
    const double *at = c->foothold + 12 * contact[l], normal[3] = {at[2], at[5], at[8]};
    memcpy(goal, at, 12 * sizeof *goal);
    along3(at + 9, wish->raised[l], normal, goal + 9);
}

/* One sweep of least squares; the largest move [m, rad]. `left`: sum of squared errors of the contacts before it [lengths squared] */
static double sweep(const climb_t *c, const int *contact, const wish_t *wish, double *base, double *angle, placed_t *placed,
                    double *left) {
    double H[MOST_VARIABLES * MOST_VARIABLES], g[MOST_VARIABLES], center[3], goal[12];
    int start[MOST_LIMBS], n = 6;
    place_all(c, base, angle, placed, center);
    for (int l = 0; l < c->limbs; l++) {
        start[l] = contact[l] < 0 ? -1 : n;
        if (contact[l] >= 0) n += c->limb[l].angles;
    }
    memset(H, 0, (size_t)(n * n) * sizeof *H), memset(g, 0, (size_t)n * sizeof *g);
    for (int k = 0; k < n; k++) H[k * n + k] = 1e-6;
    const double unit = 1.0 / (c->length * c->length);
    *left = 0.0;
    for (int l = 0; l < c->limbs; l++) {
        if (contact[l] < 0) continue;
        contact_goal(c, contact, wish, l, goal);
        *left += add_contact(c, l, placed + l, goal, base, start[l], n, H, g);
        for (int k = 0; k < c->limb[l].angles; k++) {
            const double off = angle[c->offset[l] + k] - c->limb[l].rest[k];
            H[(start[l] + k) * (n + 1)] += wish->rest, g[start[l] + k] -= wish->rest * off;
        }
    }
    if (wish->place > 0.0)
        for (int i = 0; i < 3; i++)
            H[i * (n + 1)] += wish->place * unit, g[i] -= wish->place * unit * (base[9 + i] - wish->pose[9 + i]);
    if (wish->turn > 0.0) {
        double by[3];
        turn_between(wish->pose, base, by);
        for (int i = 0; i < 3; i++) H[(3 + i) * (n + 1)] += wish->turn, g[3 + i] -= wish->turn * by[i];
    }
    for (int b = 0; wish->support && b < wish->support->bounds; b++)
        add_bound(c, wish->support->bound[b], wish->slack + wish->more, center, base, placed, start, BEARS, n, H, g);
    for (int k = 0; k < wish->avoided; k++)
        add_avoided(c, contact, 0, wish->avoid[k], ASIDE * c->length + wish->aside, base, placed, start, BEARS, n, H, g);
    /* Angles at a limit against which they are pulled stay there; those that a step would bring beyond one go to it, and the others with
     * them */
    double low[MOST_VARIABLES], high[MOST_VARIABLES];
    for (int k = 0; k < 6; k++) low[k] = -INFINITY, high[k] = INFINITY;
    for (int l = 0; l < c->limbs; l++)
        for (int k = 0; contact[l] >= 0 && k < c->limb[l].angles; k++) {
            const double now = angle[c->offset[l] + k];
            low[start[l] + k] = c->limb[l].lower[k] - now, high[start[l] + k] = c->limb[l].upper[k] - now;
        }
    if (!solve_within(n, H, g, low, high, c->length)) return 0.0;
    double moved = 0.0;
    for (int k = 0; k < 6; k++) moved = fmax(moved, k < 3 ? fabs(g[k]) / c->length : fabs(g[k]));
    move_body(base, g);
    for (int l = 0; l < c->limbs; l++)
        for (int k = 0; contact[l] >= 0 && k < c->limb[l].angles; k++) {
            double *now = angle + c->offset[l] + k, next = fmin(fmax(*now + g[start[l] + k], c->limb[l].lower[k]), c->limb[l].upper[k]);
            moved = fmax(moved, fabs(next - *now)), *now = next;
        }
    return moved;
}

/* Whether a limb that holds fixes more rows than it has angles, so that the body has to give way */
static int yields(const climb_t *c, const int *contact) {
    for (int l = 0; l < c->limbs; l++)
        if (contact[l] >= 0 && c->limb[l].angles < c->limb[l].rows) return 1;
    return 0;
}

/* Largest row of the errors of contacts at their places, turns times a length [m] */
static double most_open(const climb_t *c, const int *contact, const wish_t *wish, const double *base, const double *angle) {
    placed_t placed;
    double r[6], E[6][6], goal[12], most = 0.0;
    for (int l = 0; l < c->limbs; l++) {
        if (contact[l] < 0) continue;
        place_steps(c->limb + l, base, angle + c->offset[l], &placed);
        contact_goal(c, contact, wish, l, goal);
        contact_error(c->limb + l, placed.tip, goal, r, E);
        for (int i = 0; i < c->limb[l].rows; i++) most = fmax(most, fabs(r[i]));
    }
    return most;
}

/* Brings all contacts to where they are wanted by limbs and body, which move as little as that takes; whether they are */
static int tighten_whole(const climb_t *c, const int *contact, const wish_t *wish, double *base, double *angle) {
    wish_t none = {0};
    placed_t placed[MOST_LIMBS];
    double left;
    memcpy(none.raised, wish->raised, sizeof none.raised);
    for (int k = 0; k < ITERATIONS; k++) {
        sweep(c, contact, &none, base, angle, placed, &left);
        if (most_open(c, contact, &none, base, angle) < 0.5 * EXACT * c->length) return 1;
    }
    return 0;
}

/* The same by limbs alone; by the body too where limbs have fewer angles than rows, or end at a limit so near that it gives way by as
 * little */
static int tighten(const climb_t *c, const int *contact, const wish_t *wish, double *base, double *angle) {
    int reached = 1;
    for (int l = 0; l < c->limbs && !yields(c, contact); l++) {
        double goal[12];
        if (contact[l] < 0) continue;
        contact_goal(c, contact, wish, l, goal);
        reached = reach_from(c->limb + l, base, goal, angle + c->offset[l]) && reached;
    }
    if (!yields(c, contact) && (reached || most_open(c, contact, wish, base, angle) > GIVES * c->length)) return reached;
    return tighten_whole(c, contact, wish, base, angle);
}

/* Whether a pair is kept apart already, or there is no place for one more */
static int is_avoided(const wish_t *wish, const int *which) {
    int known = wish->avoided == AVOIDED;
    for (int k = 0; k < wish->avoided && !known; k++) known = !memcmp(wish->avoid[k], which, sizeof wish->avoid[k]);
    return known;
}

/* Finds a posture from the given one on, in place. `slack`: that of the support [1]; `which`: as of clearance */
static int posture(climb_t *c, const int *contact, const wish_t *given, double *base, double *angle, double *slack, int *which) {
    placed_t placed[MOST_LIMBS];
    wish_t more = *given, *wish = &more;
    double center[3];
    int how = NOT_BORNE;
    *slack = INFINITY;
    for (int look = 0; look < LOOKS; look++) {
        double left, before = INFINITY;
        for (int k = 0; k < SWEEPS; k++) {
            if (sweep(c, contact, wish, base, angle, placed, &left) < NEAR_ENOUGH) break;
            if (k % STALLED || (look && !k)) continue; /* contacts that are closed open at first, for a new bound */
            if (left > CLOSE && left > STALLS * before) break;
            before = left;
        }
        /* Out of reach only where nothing but the contacts was asked for: what is led elsewhere for the equilibrium, or apart, was there */
        if (!tighten(c, contact, wish, base, angle)) return look ? how : NOT_REACHED;
        place_all(c, base, angle, placed, center);
        *slack = slack_of(c, wish->support, center, wish->slack);
        how = NOT_BORNE;
        if (*slack == -INFINITY) return how;
        if (*slack < wish->slack) {
            /* What pulls at a bound takes the same again once the aim is beyond it by as much */
            more.more += fmin(wish->slack - *slack, BEYOND);
            continue;
        }
        const double clear = c->clear;
        c->clear += CLEARER * c->length;
        const double far = link_clearance(c, contact, base, placed, which);
        c->clear = clear;
        if (far >= 0.0) return STANDS;
        how = TOUCHES;
        int known = is_avoided(wish, which);
        if (known || look >= LOOKS / 2) {
            if (link_clearance(c, contact, base, placed, which) >= 0.0) return STANDS;
            /* A pair that touches in spite of its row gets one more look */
            if ((known = is_avoided(wish, which)) && look >= LOOKS / 2) return how;
        }
        if (!known) memcpy(wish->avoid[wish->avoided++], which, sizeof wish->avoid[0]);
    }
    return how;
}

#endif
