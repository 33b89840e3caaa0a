/* Sensors of a tick: they measure before it, and look at its command for pairs without a row that it brings too near. */
#ifndef WBC_WATCH_H
#define WBC_WATCH_H

#include "margins.h"

/* An item whose rows a sensor measures: wbc/controller/sensors.py fills it. Addresses of wbc/proximity/native/sensor.c */
typedef struct {
    void (*sense)(void *scene, const double *q);
    int (*missing)(void *scene, const double *screws, const double *v, double dt, const double *braking);
    void *scene;
    const double *on; /* 1 or 0 */
    /* Where it stands in a moving frame, else 0: pose and twist of that; pose and velocity in it, and those in the world */
    const double *frame, *twist, *local, *drift;
    double *pose, *velocity;
} wbc_sensor;

typedef struct {
    const wbc_sensor *sensors;
    long long count;
} wbc_watch;

/* From here on a pair needs a row that it has not: TOO_MUCH of wbc/proximity/missing.py */
#define MISSED 3

/* R R_o, p + R p_o; v + w x R p_o + R v_o, w + R w_o. Rotations stand by columns. */
static void carry(const wbc_sensor *s) {
    const double *R = s->frame, *w = s->twist + 3;
    double turned[18]; /* R_o, p_o, v_o, w_o */
    for (int c = 0; c < 18; c += 3) {
        const double *x = c < 12 ? s->local + c : s->drift + c - 12;
        for (int i = 0; i < 3; i++) turned[c + i] = R[i] * x[0] + R[3 + i] * x[1] + R[6 + i] * x[2];
    }
    const double *arm = turned + 9;
    memcpy(s->pose, turned, 9 * sizeof(double));
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        s->pose[9 + i] = R[9 + i] + arm[i];
        s->velocity[i] = s->twist[i] + (w[j] * arm[k] - w[k] * arm[j]) + turned[12 + i];
        s->velocity[3 + i] = w[i] + turned[15 + i];
    }
}

/* Measure what enabled items sense at q; not at numbers that the tick will refuse */
EXPORT void wbc_tick_sense(wbc_tick *t, const wbc_watch *watch) {
    if (!all_finite(t->q, NQ)) return;
    for (long long k = 0; k < watch->count; k++) {
        const wbc_sensor *s = watch->sensors + k;
        if (*s->on == 0.0) continue;
        if (s->frame) carry(s);
        s->sense(s->scene, t->q);
    }
}

/* The most that a pair without a row uses, at the reported command, of what its row would allow */
EXPORT int wbc_tick_missed(wbc_tick *t, const wbc_watch *watch) {
    double braking[NV];
    int most = 0;
    if (!CALM || !find_braking(t, braking))
        for (int i = 0; i < NV; i++) braking[i] = WBC_INF;
    for (int i = 0; i < NV; i++)
        if (braking[i] >= WBC_INF) braking[i] = INFINITY;
    for (long long k = 0; k < watch->count; k++) {
        const wbc_sensor *s = watch->sensors + k;
        const int used = *s->on == 0.0 ? 0 : s->missing(s->scene, t->screw, t->report.v, t->dt, braking);
        most = used > most ? used : most;
    }
    return most;
}

#endif
