/* Distance, normal and witness of the pairs of a scene, and bounds of their distances. */
#ifndef WBC_PAIRS_H
#define WBC_PAIRS_H

#include "scene.h"

/* Measure pair k at the bodies' present places: distance, normal and point in the world */
static void measure(scene_t *s, int k) {
    const int a = s->first[k], b = s->second[k];
    answer_t found;
    measure_shapes(&s->how, s->shape + a, s->body_pose + 12 * a, s->shape + b, s->body_pose + 12 * b, &found);
    double *out = s->answer + 7 * k;
    out[0] = found.gap;
    copy3(found.normal, out + 1);
    copy3(found.point, out + 4);
    s->doubtful[k] = (signed char)found.doubtful;
    s->measured++;
}

/* Distance that counts for the margin: of a pair that keeps less than the margin it is larger by the difference */
static inline double gap_of(const scene_t *s, int k) { return s->answer[7 * k] + fmax(0.0, s->margin[0] - s->most[k]); }

/* No ball at this offset from the centre of a map of heights is closer to the box about it */
static double above_field(const shape_t *field, const double *F, const double *offset, double radius) {
    double p[3], square = 0.0;
    turn_back(F, offset, p);
    for (int k = 0; k < 3; k++) {
        const double off = fmax(0.0, fmax(field->box[k] - p[k], p[k] - field->box[3 + k]));
        square += off * off;
    }
    return sqrt(square) - radius;
}

/* No pair is closer than this: along the line of centres, over a plane, or beside a map of heights */
static double bound(const scene_t *s, int k) {
    const int a = s->first[k], b = s->second[k], flat = s->shape[a].kind == PLANE;
    const double *A = s->body_pose + 12 * a, *B = s->body_pose + 12 * b;
    double offset[3];
    minus3(B + 9, A + 9, offset);
    if (flat || s->shape[b].kind == PLANE) {
        const double *P = flat ? A : B, sign = flat ? 1.0 : -1.0;
        return sign * (P[2] * offset[0] + P[5] * offset[1] + P[8] * offset[2]) - s->shape[flat ? b : a].size[5];
    }
    if (s->shape[a].kind == FIELD || s->shape[b].kind == FIELD) {
        const int turned = s->shape[a].kind == FIELD;
        for (int i = 0; i < 3; i++) offset[i] = turned ? offset[i] : -offset[i];
        return above_field(s->shape + (turned ? a : b), turned ? A : B, offset, s->shape[turned ? b : a].size[5]);
    }
    return sqrt(dot3(offset, offset)) - s->shape[a].size[5] - s->shape[b].size[5];
}

#endif
