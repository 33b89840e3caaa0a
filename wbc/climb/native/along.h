/* Which limb goes to which foothold when, while the body goes a given way: spans of the way over which a limb can hold a foothold,
 * and a beam over standings, swing by swing. */
#ifndef WBC_ALONG_H
#define WBC_ALONG_H

#include <limits.h>
#include <setjmp.h>

#include "moves.h"
#include "spans.h"
#include "swings.h"

/* Instants between samples, at which limbs that hold are looked at */
#define INTERVAL 3
/* Samples of a limb's table from which postures are sought at a foothold */
#define SPAN_TRIES 6
/* Ways over that swings try: its height alone or straight over, then both higher, HIGHER times */
#define SHAPES 4
#define HIGHER 1.6
/* How much higher than over its footholds a contact is half-way, as a share of its way */
#define ARCH 0.04
/* Instants before its span begins at which a limb lifts, as the search guesses at first */
#define EARLY 30
/* Instants for which a limb is in the air at most, as it guesses how many swings are left */
#define FLIGHT 40
/* How much longer than it should be a swing may be too short for: the whole motion is slowed there */
#define SHORT 1.05
/* The same of swings of a way that was found, of which another one is looked at first */
#define QUICK 1.15
/* By how much limbs that hold may exceed their rates, and changes of rates, from instant to instant: the motion is slowed there */
#define HURRIED 2.0
/* How often a swing is made longer, how many times longer each time at most */
#define LONGER 3
#define LONGEST 1.5
/* What time until limbs have to lift is worth, as a part of the way's, beside a swing; and what time that has passed costs */
#define LEFT_OVER 1.0
#define PASSED 0.5
/* How many times more standings than are kept are looked at */
#define MORE_LOOKED_AT 10
/* How many ways that were found and then refused are followed by another one */
#define REFUSED_WAYS 40

/* A limb at a place from the first to the last sample: angles at rough ones, from `rough` on and `rough_by` apart, and once it is
 * `followed` at all from `begin` on. `left`: swings that the limb needs at least from there on */
typedef struct beside {
    struct beside *next;
    int other, first, count;
    char mark[];
} beside_t;
typedef struct {
    int limb, place, first, last, begun, followed, begin, rough, roughs;
    double left, *rough_angle, *angle;
    beside_t *beside;
} span_t;

/* All limbs hold, from the instant `now` on and until another one; `limb` (-1: none) swung from the standing `before` of the level
 * before, lifted at `lift`, over by one of SHAPES, none that is
 * `refused`; of the way found it lifts and lands `early` and `late` by so many instants */
typedef struct {
    int row[MOST_LIMBS], now, until, limb, lift, before, early, late, shape, refused, state, order;
    double cost;
} standing_t;
enum { WAITS, KEPT, REFUSED };

typedef struct {
    standing_t *some;
    int *kept, count, room, kepts;
} level_t;

enum { NOT_BORNE_THERE, TOO_SLOW, NO_SWING, LINKS_TOUCH, WHYS };

typedef struct block {
    struct block *next;
    double at[];
} block_t;

typedef struct {
    climb_t *climb;
    const double *body;             /* its poses at all instants, 12 each */
    const double *rest;             /* contact poses at rest in its frame, limb by limb */
    const double *step[MOST_LIMBS]; /* how far angles may go in an instant */
    const double *most[MOST_LIMBS]; /* rates of swings, then their changes, by instants */
    int end, samples, every, shortest, width, alike;
    double height, margin, lifted[MOST_LIMBS];
    span_t *span;
    int spans, span_room;
    level_t *level;
    int levels, level_room;
    int (*forbidden)[2], forbiddens;
    char *trunk;
    block_t *blocks;
    double *work;
    placed_t *placed; /* of all limbs: too large for a stack that may not grow */
    long looked, why[WHYS];
    int furthest;
    jmp_buf no_memory; /* where a call goes back to that lacks memory; nothing but wbc_along_forget may follow */
} along_t;


/* Memory that was asked for, or none and the call ends */
static void *got(const along_t *a, void *memory) {
    if (!memory) longjmp(*(jmp_buf *)&a->no_memory, 1);
    return memory;
}

static void *kept_memory(along_t *a, size_t bytes) {
    block_t *made = got(a, malloc(sizeof *made + bytes));
    made->next = a->blocks, a->blocks = made;
    return made->at;
}

static void *more_room(const along_t *a, void *at, int count, int *room, size_t size) {
    if (count < *room) return at;
    at = got(a, realloc(at, (size_t)(*room ? 2 * *room : 64) * size));
    *room = *room ? 2 * *room : 64;
    return at;
}

static int instant_of(const along_t *a, int sample) { return sample * INTERVAL < a->end ? sample * INTERVAL : a->end; }
static int begins(const along_t *a, const span_t *s) { return instant_of(a, s->first); }
static int lasts(const along_t *a, const span_t *s) { return instant_of(a, s->last); }
static const limb_t *limb_of(const along_t *a, const span_t *s) { return a->climb->limb + s->limb; }
static int hold_of(const along_t *a, int row) { return a->climb->hold[a->span[row].place]; }

static void wanted_at(const along_t *a, const span_t *s, int instant, double *out) {
    own_pose(a->body + 12L * instant, a->climb->foothold + 12 * s->place, out);
}

/* The longest part without marks of some of n, or that with which it begins */
static void longest_clear(const char *mark, int n, int begun, int *first, int *last) {
    *first = 0, *last = -1;
    for (int k = 0, low = 0; k <= n; k++)
        if (k == n || mark[k]) {
            if (k - 1 - low > *last - *first) *first = low, *last = k - 1;
            if (begun) break;
            low = k + 1;
        }
    if (begun && *last < 0) *last = 0;
}

/* Whether a limb (-1: the body) at a place touches the scene, the body or itself at an instant; `angle`: its angles */
static int touches_alone(const along_t *a, int limb, int place, int instant, const double *angle) {
    near_t near = {.seen = BODY | bit_of(limb), .of = bit_of(limb)};
    placed_t *placed = a->placed;
    int contact[MOST_LIMBS], which[2];
    for (int l = 0; l < MOST_LIMBS; l++) contact[l] = l == limb ? place : -1;
    const double *base = a->body + 12L * instant;
    if (limb >= 0) place_steps(a->climb->limb + limb, base, angle, placed + limb);
    return clearance_near(a->climb, contact, base, placed, which, &near) < 0.0;
}

/* Marks n samples from `first` on, `by` apart, at which a limb that holds, or the body, touches what it may not; `angle`: row by row */
static void mark_held(const along_t *a, const span_t *s, int first, int by, int n, const double *angle, char *mark) {
    for (int k = 0; k < n; k++, angle += limb_of(a, s)->angles) {
        const int sample = first + by * k < a->samples ? first + by * k : a->samples - 1;
        mark[k] = a->trunk[sample] || touches_alone(a, s->limb, s->place, instant_of(a, sample), angle);
    }
}

/* Adds spans of a limb at a place that last from a rough sample to another; `start`: posture with which it begins, or 0 */
static void spans_at(along_t *a, int limb, int place, int postures, const double *start) {
    const limb_t *l = a->climb->limb + limb;
    const int n = l->angles, count = (a->samples - 2) / a->every + 2;
    int first[TRIES], last[TRIES], at = -1;
    double *wanted = malloc(sizeof *wanted * count * (12 + (size_t)postures * n)), *angles = wanted + 12L * count, nearest = INFINITY, step[MOST_ANGLES];
    char *mark = malloc((size_t)count);
    got(a, wanted), got(a, mark);
    span_t made = {limb, place, 0, 0, start != 0, 0, 0, 0, 0, INFINITY, 0, 0, 0};
    for (int k = 0; k < count; k++) {
        double by[3], *w = wanted + 12 * k;
        wanted_at(a, &made, instant_of(a, k * a->every), w);
        minus3(w + 9, l->step[0].place + 9, by);
        if (dot3(by, by) > l->length * l->length) continue;
        minus3(w + 9, a->rest + 12 * limb + 9, by);
        if (dot3(by, by) < nearest) nearest = dot3(by, by), at = k;
    }
    for (int i = 0; i < n; i++) step[i] = a->step[limb][i] * INTERVAL * a->every;
    if (start) at = 0;
    const int many = at < 0 ? 0 : hold_spans(l, count, wanted, at, start, SPAN_TRIES, postures, step, angles, first, last);
    for (int j = 0; j < many; j++) {
        const int size = last[j] - first[j] + 1;
        int low, high;
        const double *some = angles + ((long)j * count + first[j]) * n;
        mark_held(a, &made, first[j] * a->every, a->every, size, some, mark);
        longest_clear(mark, size, start != 0, &low, &high);
        if (high <= low) continue;
        made.rough = first[j] + low, made.roughs = high - low + 1;
        made.first = made.rough * a->every, made.last = (first[j] + high) * a->every;
        if (made.last >= a->samples) made.last = a->samples - 1;
        made.rough_angle = kept_memory(a, sizeof(double) * made.roughs * n);
        memcpy(made.rough_angle, some + (long)low * n, sizeof(double) * made.roughs * n);
        a->span = more_room(a, a->span, a->spans, &a->span_room, sizeof *a->span);
        a->span[a->spans++] = made;
    }
    free(wanted), free(mark);
}

/* Follows a span at all its samples, and leaves out what is not continuous or touches; whether any of it lasts */
static int follow_span(along_t *a, span_t *s) {
    if (s->followed) return s->last > s->first;
    const limb_t *l = limb_of(a, s);
    const int n = l->angles, size = s->last - s->first + 1;
    double *wanted = malloc(sizeof *wanted * 12 * (size_t)size), step[MOST_ANGLES];
    char *mark = malloc((size_t)size);
    got(a, wanted), got(a, mark);
    s->followed = 1, s->begin = s->first;
    s->angle = kept_memory(a, sizeof(double) * size * n);
    for (int i = 0; i < n; i++) step[i] = a->step[s->limb][i] * INTERVAL;
    for (int k = 0; k < size; k++) wanted_at(a, s, instant_of(a, s->first + k), wanted + 12 * k);
    int low = 0, high = -1;
    for (int r = 0, done = 0; r < s->roughs && (!r || !s->begun); r++) {
        const int k = r * a->every < size ? r * a->every : size - 1;
        if (k < done) continue;
        memcpy(s->angle + (long)k * n, s->rough_angle + (long)r * n, sizeof(double) * n);
        done = k + follow_contact(l, size - k, wanted + 12 * k, 12, step, s->angle + (long)k * n);
        if (done - 1 - k > high - low) low = k, high = done - 1;
    }
    s->first = s->begin + low, s->last = s->begin + high;
    if (high > low) {
        int clear, last;
        mark_held(a, s, s->first, 1, high - low + 1, s->angle + (long)low * n, mark);
        longest_clear(mark, high - low + 1, s->begun, &clear, &last);
        s->last = s->first + last, s->first += clear;
    }
    free(wanted), free(mark);
    return s->last > s->first;
}

/* Angles of a span at an instant: cubics through those at the samples */
static void angles_at(const along_t *a, const span_t *s, int instant, double *out) {
    const int n = limb_of(a, s)->angles;
    int k = instant / INTERVAL;
    k = k < s->first ? s->first : k >= s->last ? s->last - 1 : k;
    const int from = instant_of(a, k), to = instant_of(a, k + 1);
    const double x = fmin(fmax((double)(instant - from) / (to - from), 0.0), 1.0), *p = s->angle + (long)(k - s->begin) * n, *q = p + n;
    for (int i = 0; i < n; i++) {
        const double step = q[i] - p[i];
        const double u = k > s->first ? 0.5 * (q[i] - p[i - n]) - step : 0.0, v = k + 1 < s->last ? step - 0.5 * (q[i + n] - p[i]) : 0.0;
        out[i] = p[i] + x * step + x * (1.0 - x) * ((1.0 - x) * u + x * v);
    }
}

/* Of a span that may not be followed yet, about */
static const double *about_angles(const along_t *a, const span_t *s, int instant) {
    const int n = limb_of(a, s)->angles, sample = (instant + INTERVAL / 2) / INTERVAL;
    if (s->followed) return s->angle + (long)((sample < s->first ? s->first : sample > s->last ? s->last : sample) - s->begin) * n;
    const int k = (sample + a->every / 2) / a->every - s->rough;
    return s->rough_angle + (long)(k < 0 ? 0 : k >= s->roughs ? s->roughs - 1 : k) * n;
}

/* Whether two limbs that hold touch each other at a sample, at which neither does by itself */
static int touch_both(const along_t *a, const span_t *s, const span_t *o, int sample) {
    near_t near = {.seen = bit_of(s->limb) | bit_of(o->limb), .of = bit_of(s->limb)};
    placed_t *placed = a->placed;
    int contact[MOST_LIMBS], which[2];
    const double *base = a->body + 12L * instant_of(a, sample);
    contact[s->limb] = s->place, contact[o->limb] = o->place;
    place_steps(limb_of(a, s), base, s->angle + (long)(sample - s->begin) * limb_of(a, s)->angles, placed + s->limb);
    place_steps(limb_of(a, o), base, o->angle + (long)(sample - o->begin) * limb_of(a, o)->angles, placed + o->limb);
    return clearance_near(a->climb, contact, base, placed, which, &near) < 0.0;
}

/* The first sample from one on at which two limbs that hold touch each other */
static int touch_after(along_t *a, int one, int other, int sample) {
    if (one > other) return touch_after(a, other, one, sample);
    span_t *s = a->span + one, *o = a->span + other;
    beside_t *b = s->beside;
    while (b && b->other != other) b = b->next;
    if (!b) {
        const int first = s->first > o->first ? s->first : o->first, last = s->last < o->last ? s->last : o->last;
        const int count = last >= first ? last - first + 1 : 0;
        b = kept_memory(a, sizeof *b + (size_t)count);
        *b = (beside_t){s->beside, other, first, count};
        s->beside = b;
        for (int k = 0; k < count; k++) b->mark[k] = touch_both(a, s, o, first + k);
    }
    for (int k = sample > b->first ? sample - b->first : 0; k < b->count; k++)
        if (b->mark[k]) return b->first + k;
    return INT_MAX / INTERVAL;
}

/* The last instant to which limbs can hold together, from one on; `without`: one that does not count; -1: they cannot there */
static int until(along_t *a, const int *row, int now, int without) {
    int last = a->end;
    for (int l = 0; l < a->climb->limbs; l++) {
        if (l == without) continue;
        if (!follow_span(a, a->span + row[l]) || begins(a, a->span + row[l]) > now) return -1;
        const int end = lasts(a, a->span + row[l]);
        if (end < last) last = end;
    }
    for (int l = 0; l < a->climb->limbs; l++)
        for (int k = 0; k < l; k++) {
            if (l == without || k == without) continue;
            const int end = INTERVAL * (touch_after(a, row[k], row[l], (now + INTERVAL - 1) / INTERVAL) - 1);
            if (end < last) last = end;
        }
    return last >= now ? last : -1;
}

/* Whether limbs but one that swings bear the robot; that one is where it would hold its own span */
static int bear(along_t *a, const int *row, int swinging, int instant) {
    climb_t *c = a->climb;
    int contact[MOST_LIMBS];
    double angle[MOST_LIMBS * MOST_ANGLES], center[3] = {0};
    placed_t *placed = a->placed;
    for (int l = 0; l < MOST_LIMBS; l++) contact[l] = l < c->limbs && l != swinging ? a->span[row[l]].place : -1;
    support_t *known = support_of(c, contact);
    got(a, known);
    if (!c->weightless) {
        for (int l = 0; l < c->limbs; l++) angles_at(a, a->span + row[l], instant, angle + c->offset[l]);
        place_all(c, a->body + 12L * instant, angle, placed, center);
    }
    return slack_of(c, known, center, a->margin) >= a->margin;
}

/* Of a swing from span to span `shape`: how many times longer it should be, and angles in so many parts at which instants */
static double swing_between(const along_t *a, const span_t *from, const span_t *onto, int shape, int lift, int land, int parts,
                            const double *exact, double *angle, int *at) {
    const limb_t *l = limb_of(a, from);
    const int n = l->angles;
    double ends[4 * MOST_ANGLES], by[3];
    angles_at(a, from, lift, ends), angles_at(a, from, lift - 1, ends + n);
    angles_at(a, onto, land, ends + 2 * n), angles_at(a, onto, land + 1, ends + 3 * n);
    for (int i = 0; i < n; i++) ends[n + i] = ends[i] - ends[n + i], ends[3 * n + i] -= ends[2 * n + i];
    if (exact) memcpy(ends, exact, sizeof(double) * n), memcpy(ends + 2 * n, exact + n, sizeof(double) * n);
    const double *f = a->climb->foothold + 12 * from->place, *o = a->climb->foothold + 12 * onto->place;
    minus3(o + 9, f + 9, by);
    const double over = (a->height + ARCH * sqrt(dot3(by, by))) * (shape > 1 ? HIGHER : 1.0);
    const double used = swing(l, land - lift, parts, a->body + 12L * lift, f, o, ends, over, shape & 1, a->most[from->limb], angle, at);
    for (int j = 0; j <= parts; j++) at[j] += lift;
    return used;
}

/* Whether a swing is clear of the scene, of the body and of the limbs that hold, at n instants */
static int swing_clear(const along_t *a, const int *row, const span_t *from, const span_t *onto, int n, const int *at, const double *angle) {
    climb_t *c = a->climb;
    placed_t *placed = a->placed;
    int contact[MOST_LIMBS], which[2];
    near_t near = {.seen = EVERYTHING, .of = bit_of(from->limb)};
    for (int j = 0; j < n; j++) {
        const double *base = a->body + 12L * at[j];
        double by[3], far[2], held[MOST_ANGLES];
        for (int l = 0; l < c->limbs; l++) {
            contact[l] = a->span[row[l]].place;
            if (l != from->limb) angles_at(a, a->span + row[l], at[j], held);
            place_steps(c->limb + l, base, l == from->limb ? angle + (long)j * c->limb[l].angles : held, placed + l);
        }
        for (int k = 0; k < 2; k++) {
            minus3(placed[from->limb].tip + 9, c->foothold + 12 * (k ? onto : from)->place + 9, by);
            far[k] = sqrt(dot3(by, by));
        }
        contact[from->limb] = far[1] < far[0] ? onto->place : from->place, near.off[from->limb] = fmin(far[0], far[1]);
        if (clearance_near(c, contact, base, placed, which, &near) < 0.0) return 0;
    }
    return 1;
}

static const standing_t *before(const along_t *a, int level, const standing_t *s) { return a->level[level - 1].some + s->before; }

static int is_forbidden(const along_t *a, int from, int onto) {
    for (int k = 0; k < a->forbiddens; k++)
        if (a->forbidden[k][0] == from && a->forbidden[k][1] == onto) return 1;
    return 0;
}

/* Whether a standing can be, and until when */
static int holds(along_t *a, standing_t *s) {
    s->until = until(a, s->row, s->now, -1);
    if (s->until < s->now) a->why[LINKS_TOUCH]++;
    return s->until >= s->now;
}

/* Whether a standing can be come to: with its swing, and perhaps a later landing */
static int can_be(along_t *a, int level, standing_t *s) {
    if (!level) return until(a, s->row, 0, -1) >= 0 && bear(a, s->row, -1, 0) ? holds(a, s) : 0;
    const standing_t *b = before(a, level, s);
    const span_t *from = a->span + b->row[s->limb];
    span_t *onto = a->span + s->row[s->limb];
    if (is_forbidden(a, b->row[s->limb], s->row[s->limb]) || !follow_span(a, onto)) return 0;
    const int others = until(a, b->row, b->now, s->limb), end = lasts(a, onto), latest = (others < end ? others : end) - 1;
    if (s->now < begins(a, onto)) s->now = begins(a, onto);
    if (s->now > latest || s->lift > lasts(a, from)) return a->why[TOO_SLOW]++, 0;
    if (!bear(a, b->row, s->limb, s->lift) || !bear(a, s->row, s->limb, s->now)) return a->why[NOT_BORNE_THERE]++, 0;
    int why = -1;
    const int land = s->now;
    for (s->shape = 0; s->shape < 2; s->shape++) {
        double used = INFINITY, *angle = a->work;
        int parts = 0, *at = (int *)(angle + (long)MOST_ANGLES * (a->samples + 8));
        s->now = land;
        for (int k = 0; k <= LONGER; k++) {
            const int takes = s->now - s->lift;
            if (takes < 1) { used = INFINITY; break; }
            parts = takes / INTERVAL > 6 ? takes / INTERVAL : takes < 6 ? takes : 6;
            used = swing_between(a, from, onto, s->shape, s->lift, s->now, parts, 0, angle, at);
            if (used <= SHORT || used == INFINITY || k == LONGER) break;
            s->now = s->lift + (int)ceil(takes * fmin(used, LONGEST));
            if (s->now > latest) break;
        }
        /* The body has gone on by the time of a later landing */
        int how = used == INFINITY ? NO_SWING : used > SHORT ? TOO_SLOW : -1;
        if (how < 0 && s->now > land && !bear(a, s->row, s->limb, s->now)) how = NOT_BORNE_THERE;
        if (how < 0 && !swing_clear(a, b->row, from, onto, parts + 1, at, angle)) how = LINKS_TOUCH;
        if (how < 0) return holds(a, s);
        if (why < 0) why = how;
    }
    a->why[why]++;
    return 0;
}

/* About how many instants a swing takes whose joints go from some angles to others */
static int swing_takes(const along_t *a, int limb, const double *from, const double *onto) {
    const int n = a->climb->limb[limb].angles;
    double takes = a->shortest;
    for (int i = 0; i < n; i++) {
        const double size = fabs(onto[i] - from[i]), *most = a->most[limb];
        takes = fmax(takes, fmax(1.875 * size / most[i], sqrt((5.0 * size + 4.0 / (COMING_UP * COMING_UP) * a->lifted[limb]) / most[n + i])));
    }
    return (int)ceil(takes);
}

static double cost_of(const along_t *a, const standing_t *s) {
    double end[MOST_LIMBS], cost = PASSED * s->now;
    for (int l = 0; l < a->climb->limbs; l++) {
        int k = l;
        const span_t *span = a->span + s->row[l];
        for (; k > 0 && end[k - 1] > lasts(a, span); k--) end[k] = end[k - 1];
        end[k] = lasts(a, span);
    }
    for (int l = 0; l < a->climb->limbs; l++) cost -= end[l] / (l + 1.0);
    cost *= LEFT_OVER / (a->end > 1 ? a->end : 1);
    for (int l = 0; l < a->climb->limbs; l++) cost += a->span[s->row[l]].left;
    return cost;
}

static void add_standing(const along_t *a, level_t *level, const standing_t *s) {
    level->some = more_room(a, level->some, level->count, &level->room, sizeof *s);
    level->some[level->count] = *s;
    level->some[level->count].order = level->count;
    level->count++;
}

/* What may come after a standing: one limb goes to another span */
static void add_after(along_t *a, int level, int which) {
    const standing_t now = a->level[level - 1].some[which];
    const int soonest = now.now + (level > 1); /* at first it is at rest, and a limb may lift at once */
    for (int l = 0; l < a->climb->limbs; l++) {
        const span_t *from = a->span + now.row[l];
        const int others = until(a, now.row, now.now, l), latest = lasts(a, from) < now.until ? lasts(a, from) : now.until;
        for (int r = 0; r < a->spans; r++) {
            const span_t *s = a->span + r;
            if (s->limb != l) continue;
            const int begin = begins(a, s), end = lasts(a, s);
            if (r == now.row[l] || end <= lasts(a, from) || s->last <= s->first || isinf(s->left) || begin > others) continue;
            int lift = begin - EARLY > soonest ? begin - EARLY : soonest, taken = 0;
            if (lift > latest) lift = latest;
            if (lift < soonest) continue;
            for (int k = 0; k < a->climb->limbs; k++) taken |= k != l && hold_of(a, now.row[k]) == a->climb->hold[s->place];
            if (taken) continue;
            const double *leaves = about_angles(a, from, lift);
            int land = lift + EARLY > begin ? lift + EARLY : begin;
            for (int k = 0; k < 2; k++) {
                const int takes = swing_takes(a, l, leaves, about_angles(a, s, land));
                land = lift + takes > begin ? lift + takes : begin;
                lift = land - takes > soonest ? land - takes : soonest;
                if (lift > latest) lift = latest;
            }
            if (land >= others || land >= end) continue;
            standing_t after = {{0}, land, 0, l, lift, which, 0, 0, 0, 0, WAITS, 0, 0.0};
            memcpy(after.row, now.row, sizeof after.row);
            after.row[l] = r;
            after.cost = cost_of(a, &after);
            if (isfinite(after.cost)) add_standing(a, a->level + level, &after);
        }
    }
}

static int by_cost(const void *one, const void *other) {
    const standing_t *a = one, *b = other;
    return a->cost != b->cost ? (a->cost < b->cost ? -1 : 1) : a->order - b->order;
}

/* Whether a standing on the same spans is known that is not later */
static int is_known(const along_t *a, const standing_t *s) {
    for (int d = 0; d < a->levels; d++)
        for (int k = 0; k < a->level[d].kepts; k++) {
            const standing_t *o = a->level[d].some + a->level[d].kept[k];
            if (o != s && o->now <= s->now && !memcmp(o->row, s->row, sizeof(int) * a->climb->limbs)) return 1;
        }
    return 0;
}

/* How many of a level are kept on the same places as a standing */
static int same_places(const along_t *a, const level_t *level, const standing_t *s) {
    int count = 0;
    for (int k = 0; k < level->kepts; k++) {
        const standing_t *o = level->some + level->kept[k];
        int same = 1;
        for (int l = 0; l < a->climb->limbs && same; l++) same = a->span[o->row[l]].place == a->span[s->row[l]].place;
        count += same;
    }
    return count;
}

/* Keeps so many of the last level at most, of each one before half of them at most; how many */
static int keep_some(along_t *a, int width) {
    level_t *level = a->level + a->levels - 1;
    const int d = a->levels - 1, most = d ? a->level[d - 1].count : 1;
    int tries = 0, *following = calloc((size_t)most + 1, sizeof *following);
    level->kept = realloc(level->kept, sizeof(int) * (size_t)width);
    got(a, following), got(a, level->kept);
    level->kepts = 0;
    for (int k = 0; k < level->count && level->kepts < width && tries < MORE_LOOKED_AT * width; k++) {
        standing_t *s = level->some + k;
        if (s->state == REFUSED || is_known(a, s) || (d && following[s->before] > width / 2) || (a->alike && same_places(a, level, s) >= a->alike)) continue;
        if (s->state == WAITS) {
            tries++, a->looked++;
            s->state = can_be(a, d, s) ? KEPT : REFUSED;
            if (s->state == REFUSED || is_known(a, s)) continue;
        }
        if (d) following[s->before]++;
        level->kept[level->kepts++] = k;
    }
    free(following);
    return level->kepts;
}

static void drop_levels(along_t *a, int from) {
    for (int d = from; d < a->levels; d++) free(a->level[d].some), free(a->level[d].kept);
    if (from < a->levels) a->levels = from;
}

static level_t *add_level(along_t *a) {
    a->level = more_room(a, a->level, a->levels, &a->level_room, sizeof *a->level);
    a->level[a->levels] = (level_t){0};
    return a->level + a->levels++;
}

/* The standing of the last level that lasts to the end, or -1 */
static int arrived(along_t *a) {
    const level_t *level = a->level + a->levels - 1;
    int out = -1;
    for (int k = level->kepts - 1; k >= 0; k--) {
        const standing_t *s = level->some + level->kept[k];
        if (s->until > a->furthest) a->furthest = s->until;
        if (s->until >= a->end) out = level->kept[k];
    }
    return out;
}

/* Goes on until a standing lasts to the end: its place in the last level, or -1 */
static int search_along(along_t *a, int width, long most) {
    const long last = a->looked + most;
    int found;
    while ((found = arrived(a)) < 0) {
        level_t *level = a->level + a->levels - 1;
        if (a->looked >= last || !level->kepts) return -1;
        const int count = level->kepts, d = a->levels;
        add_level(a);
        for (int k = 0; k < count; k++) add_after(a, d, a->level[d - 1].kept[k]);
        if (a->level[d].count) qsort(a->level[d].some, (size_t)a->level[d].count, sizeof(standing_t), by_cost);
        if (!keep_some(a, width)) return -1;
    }
    return found;
}

/* The standings that lead to one of the last level, from the first on */
static void chain_of(along_t *a, int last, standing_t **chain) {
    for (int d = a->levels - 1; d >= 0; d--) chain[d] = a->level[d].some + last, last = chain[d]->before;
}

/* Refuses a standing of a level, or has it looked at anew, with all that came after it */
static void refuse(along_t *a, int level, standing_t *s, int state) {
    s->state = state;
    drop_levels(a, level + 1);
    keep_some(a, a->width);
}

/* Angles of a span at all instants from one to another, rows `by` apart; the instant at which it fails, or -1 */
static int exact_angles(const along_t *a, const span_t *s, int first, int last, long by, double *out) {
    const limb_t *l = limb_of(a, s);
    double wanted[12];
    for (int k = first; k <= last; k++) {
        double *now = out + by * k;
        angles_at(a, s, k, now);
        wanted_at(a, s, k, wanted);
        if (!reach_from(l, AT_BODY, wanted, now)) return k;
        const double *one = now - by, *two = one - by, *bend = a->most[s->limb] + l->angles;
        for (int i = 0; i < l->angles && k > first; i++) {
            if (fabs(now[i] - one[i]) > HURRIED * a->step[s->limb][i]) return k;
            if (k > first + 1 && fabs(now[i] - 2.0 * one[i] + two[i]) > HURRIED * bend[i]) return k;
        }
    }
    return -1;
}

/* Of the ways over of a swing the first that is quick enough and clear at all instants, or else the quickest one; where there is time
 * before or after it, it takes what it needs. `held`: angles of its limb, `by` apart. Whether there is one */
static int settle_swing(along_t *a, standing_t **chain, int d, long by, const double *held, double *swung, int *at) {
    standing_t *s = chain[d];
    const int *row = chain[d - 1]->row, l = s->limb, n = a->climb->limb[l].angles;
    const span_t *from = a->span + row[l], *onto = a->span + s->row[l];
    const int others = until(a, row, chain[d - 1]->now, l), end = lasts(a, onto);
    int latest = (d + 1 < a->levels ? chain[d + 1]->lift : others) - 1, best = -1, early = 0, late = 0;
    if (latest > others - 1) latest = others - 1;
    if (latest > end - 1) latest = end - 1;
    const int before = s->lift - chain[d - 1]->now - chain[d - 1]->late - (d > 1), after = latest > s->now ? latest - s->now : 0;
    double quickest = LONGEST;
    for (int k = 0; k <= SHAPES; k++) { /* at last the quickest again */
        const int shape = k < SHAPES ? k : best;
        double used = INFINITY, ends[2 * MOST_ANGLES];
        if (shape < 0 || (s->refused >> shape) & 1) continue;
        if (k < SHAPES) s->early = s->late = 0;
        else s->early = early, s->late = late;
        for (int round = 0; round < 2; round++) {
            const int lift = s->lift - s->early, land = s->now + s->late;
            memcpy(ends, held + by * lift, sizeof(double) * n), memcpy(ends + n, held + by * land, sizeof(double) * n);
            used = swing_between(a, from, onto, shape, lift, land, land - lift, ends, swung, at);
            const int needs = used > SHORT && used < 2.0 ? (int)ceil((used - 1.0) * (land - lift)) : 0;
            if (round || k == SHAPES || !needs || before + after < 1) break;
            s->late = needs < after ? needs : after;
            s->early = needs - s->late < before ? needs - s->late : before;
            if (s->early < 0) s->early = 0;
            if (!bear(a, row, l, s->lift - s->early) || !bear(a, s->row, l, s->now + s->late)) s->early = s->late = 0;
        }
        s->shape = shape;
        if (k == SHAPES) return 1;
        if (used >= quickest || !swing_clear(a, row, from, onto, s->now + s->late - s->lift + s->early + 1, at, swung)) continue;
        if (used <= QUICK) return 1;
        quickest = used, best = shape, early = s->early, late = s->late;
    }
    return 0;
}

/* Swings that each limb needs at least from each of its spans on, were it alone */
static void count_swings(along_t *a) {
    for (int k = 0; k < a->spans; k++) a->span[k].left = lasts(a, a->span + k) >= a->end ? 0.0 : INFINITY;
    for (int l = 0; l < a->climb->limbs; l++)
        for (int count = 1, more = 1; more; count++) {
            int first = INT_MAX;
            more = 0;
            for (int k = 0; k < a->spans; k++) {
                const span_t *s = a->span + k;
                if (s->limb == l && s->left == count - 1 && begins(a, s) < first) first = begins(a, s);
            }
            for (int k = 0; k < a->spans && first < INT_MAX; k++) {
                span_t *s = a->span + k;
                if (s->limb == l && isinf(s->left) && lasts(a, s) + FLIGHT >= first) s->left = count, more = 1;
            }
        }
}

/* Parts a span where it fails: the rest of it is another one */
static void part_span(along_t *a, int row, int wrong) {
    span_t rest = a->span[row];
    rest.first = wrong / INTERVAL + 1, rest.begun = 0, rest.beside = 0;
    a->span[row].last = (wrong - 1) / INTERVAL;
    if (rest.last > rest.first) {
        a->span = more_room(a, a->span, a->spans, &a->span_room, sizeof *a->span);
        a->span[a->spans++] = rest;
    }
    count_swings(a);
}

/* Angles of all limbs at all instants of the way found, `angles` of a row; 0: one cannot go so, which is refused */
static int settle(along_t *a, standing_t **chain, double *out) {
    const int levels = a->levels, angles = a->climb->offset[a->climb->limbs];
    int *at = malloc(sizeof(int) * ((size_t)a->end + 1)), ok = 1;
    double *swung = malloc(sizeof(double) * MOST_ANGLES * ((size_t)a->end + 1));
    got(a, at), got(a, swung);
    for (int l = 0; l < a->climb->limbs && ok; l++)
        for (int d = 0, now = 0, since = 0; d < levels && ok; d++) {
            if (d + 1 < levels && chain[d + 1]->limb != l) continue;
            span_t *s = a->span + chain[d]->row[l];
            const int last = d + 1 < levels ? chain[d + 1]->lift : a->end;
            const int wrong = exact_angles(a, s, now, last, angles, out + a->climb->offset[l]);
            if (wrong >= 0) {
                part_span(a, chain[d]->row[l], wrong);
                refuse(a, since, chain[since], WAITS);
                ok = 0;
            } else if (d + 1 < levels) {
                now = chain[d + 1]->now, since = d + 1;
            }
        }
    for (int d = 1; d < levels && ok; d++) {
        const int l = chain[d]->limb, n = a->climb->limb[l].angles;
        if (!settle_swing(a, chain, d, angles, out + a->climb->offset[l], swung, at)) {
            a->forbidden = realloc(a->forbidden, sizeof *a->forbidden * ((size_t)a->forbiddens + 1));
            got(a, a->forbidden);
            a->forbidden[a->forbiddens][0] = chain[d - 1]->row[l], a->forbidden[a->forbiddens++][1] = chain[d]->row[l];
            refuse(a, d, chain[d], REFUSED);
            ok = 0;
            break;
        }
        double *begin = out + (long)angles * (chain[d]->lift - chain[d]->early) + a->climb->offset[l];
        for (int k = 0; k <= chain[d]->now + chain[d]->late - chain[d]->lift + chain[d]->early; k++)
            memcpy(begin + (long)angles * k, swung + (long)n * k, sizeof(double) * n);
    }
    free(at), free(swung);
    return ok;
}

/* Finds a way, or goes on from the one that was refused: angles at all instants; whether there is one */
static int along_way(along_t *a, long most, double *out) {
    for (int k = 0; k < REFUSED_WAYS && a->levels; k++) {
        const int found = search_along(a, a->width, most);
        if (found < 0) return 0;
        standing_t *chain[a->levels];
        chain_of(a, found, chain);
        if (settle(a, chain, out)) return 1;
    }
    return 0;
}

/* Refuses the swing that leads to a standing of the way found */
static void refuse_found(along_t *a, int level) {
    standing_t *chain[a->levels];
    chain_of(a, arrived(a), chain);
    chain[level]->refused |= 1 << chain[level]->shape;
}

/* Fills in the spans of all limbs, with at most so many postures at a place */
static void begin_along(along_t *a, const double *step, const double *most, int postures) {
    climb_t *c = a->climb;
    for (int k = 0; k < a->samples; k++) a->trunk[k] = (char)touches_alone(a, -1, -1, instant_of(a, k), 0);
    for (int l = 0; l < c->limbs; l++) {
        a->step[l] = step + c->offset[l], a->most[l] = most + 2 * c->offset[l];
        a->lifted[l] = 4.0 * a->height / c->limb[l].length;
        for (int f = 0; f < c->footholds; f++)
            if (c->cone_of[l * c->footholds + f] >= 0) spans_at(a, l, f, postures, 0);
    }
}

void wbc_along_forget(along_t *a) {
    drop_levels(a, 0);
    while (a->blocks) {
        block_t *next = a->blocks->next;
        free(a->blocks);
        a->blocks = next;
    }
    free(a->span), free(a->level), free(a->forbidden), free(a->trunk), free(a->work), free(a->placed), free(a);
}

#endif
