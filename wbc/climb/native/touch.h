/* When pieces of limbs come too near to each other or to bodies of the scene, along motions of single limbs. */
#ifndef WBC_TOUCH_H
#define WBC_TOUCH_H

#include "stand.h"

/* Marks the instants at which two shapes are nearer than `keep` (of instant k: kept[kept_by * k]); their poses are `a_by` and `b_by`
 * numbers apart, 0: it stands */
static void mark_touch(const tolerance_t *how, const shape_t *a, const double *A, long a_by, const shape_t *b, const double *B,
                       long b_by, const double *kept, int kept_by, long n, char *mark) {
    const int known_way = convex(a) && (convex(b) || b->kind == ROD);
    double gap = -INFINITY, normal[3];
    long last = 0, measured = 0;
    for (long k = 0; k < n; k++) {
        const double *one = A + k * a_by, *other = B + k * b_by, keep = kept[kept_by * k];
        if (mark[k]) continue;
        if (gap > keep) {
            const double moved = (a_by ? moved_within(one, A + last * a_by, a->size[5]) : 0.0) + (b_by ? moved_within(other, B + last * b_by, b->size[5]) : 0.0);
            if (gap - moved > keep) continue;
        }
        last = k;
        if (b->size[5] < 1e6) {
            double apart[3];
            minus3(one + 9, other + 9, apart);
            gap = sqrt(dot3(apart, apart)) - a->size[5] - b->size[5];
            if (gap > fmax(keep, 0.0)) continue;
        }
        if (known_way && measured && (gap = gap_along(a, one, b, other, normal)) > keep) continue;
        answer_t found;
        measure_shapes(how, a, one, b, other, &found);
        gap = found.gap, measured = 1;
        copy3(found.normal, normal);
        mark[k] = gap < keep;
    }
}

/* Poses of the centres of a limb's pieces (-1: of the body's) in the body's frame at n postures, 12 each, posture by posture; how
 * many pieces it has. `out` 0: that alone */
static int pieces_of(const climb_t *c, int limb, long n, const double *angle, double *out) {
    int count = 0;
    for (int k = 0; k < c->pieces; k++) count += c->piece[k].limb == limb;
    placed_t placed;
    for (long j = 0; out && j < n; j++) {
        if (limb >= 0) place_steps(c->limb + limb, AT_BODY, angle + j * c->limb[limb].angles, &placed);
        for (int k = 0; k < c->pieces; k++) {
            if (c->piece[k].limb != limb) continue;
            compose(limb < 0 ? AT_BODY : placed.pose[c->piece[k].step], c->piece[k].place, out);
            out += 12;
        }
    }
    return count;
}

static int own_row(const climb_t *c, int piece) {
    int row = 0;
    for (int k = 0; k < piece; k++) row += c->piece[k].limb == c->piece[piece].limb;
    return row;
}

/* Marks the instants at which pieces of one limb (or the body) and another are too near; `b_by`: 0 where the other one stands */
static void mark_limbs(const climb_t *c, int a, const double *A, int b, const double *B, int b_stands, long n, char *mark) {
    const tolerance_t how = {1e-10 * c->length, 1e-9 * c->length, 1e-5 * c->length};
    const long a_by = 12 * pieces_of(c, a, 0, 0, 0), b_by = b_stands ? 0 : 12 * pieces_of(c, b, 0, 0, 0);
    for (int k = 0; k < c->pairs; k++) {
        int i = c->pair[2 * k], j = c->pair[2 * k + 1];
        if (c->piece[i].limb != a || c->piece[j].limb != b) {
            const int other = i;
            i = j, j = other;
        }
        if (c->piece[i].limb != a || c->piece[j].limb != b) continue;
        mark_touch(&how, c->shape + c->piece[i].shape, A + 12 * own_row(c, i), a_by, c->shape + c->piece[j].shape,
                   B + 12 * own_row(c, j), b_by, &c->apart, 0, n, mark);
    }
}

/* Marks the instants at which pieces of a limb (-1: of the body) are too near to bodies of the scene, to the body, or to each other.
 * `base`: poses of the body; `contact`: places that the limb holds, or comes from or to, and -1; `off`: how far it is from there; `stop`: whether one mark
 * is enough */
static void mark_alone(const climb_t *c, int limb, const double *A, const double *base, const int *contact, const double *off, long n,
                       int stop, char *mark, double *work) {
    const tolerance_t how = {1e-10 * c->length, 1e-9 * c->length, 1e-5 * c->length};
    const int count = pieces_of(c, limb, 0, 0, 0), trunk = pieces_of(c, -1, 0, 0, 0);
    double *kept = work, *pose = kept + n, own[trunk ? trunk : 1][12];
    for (int i = 0, row = 0; i < c->pieces; i++) {
        if (c->piece[i].limb != limb) continue;
        const piece_t *p = c->piece + i;
        const shape_t *shape = c->shape + p->shape;
        double middle[3] = {0}, around = 0.0, by[3];
        for (long k = 0; k < n; k++) {
            compose(base + 12 * k, A + (k * count + row) * 12, pose + 12 * k);
            along3(middle, 1.0 / n, pose + 12 * k + 9, middle);
        }
        for (long k = 0; k < n; k++) {
            minus3(pose + 12 * k + 9, middle, by);
            around = fmax(around, sqrt(dot3(by, by)));
        }
        row++;
        for (int j = 0; j < c->bodies; j++) {
            const shape_t *body = c->shape + c->pieces + j;
            minus3(c->body + 12 * j + 9, middle, by);
            if (body->size[5] < 1e6 && sqrt(dot3(by, by)) > around + shape->size[5] + body->size[5] + c->clear) continue;
            for (long k = 0; k < n; k++)
                kept[k] = p->tip && contact[k] >= 0 && c->on[contact[k]] == j ? tip_distance(c, p, off[k]) : c->clear;
            mark_touch(&how, shape, pose, 12, body, c->body + 12 * j, 0, kept, 1, n, mark);
            if (stop && memchr(mark, 1, (size_t)n)) return;
        }
    }
    mark_limbs(c, limb, A, limb, A, 0, n, mark);
    if (limb < 0) return;
    pieces_of(c, -1, 1, 0, own[0]);
    mark_limbs(c, limb, A, -1, own[0], 1, n, mark);
}

#endif
