/* The first curve of a swing that is possible and clear, of all that are tried, as planner/swings/swings.py. */
#ifndef WBC_WALKING_CHOICE_H
#define WBC_WALKING_CHOICE_H

#include "curve.h"
#include "tracks.h"

/* Whether two arms are clear of each other between two instants, their points going straight from the one to the other. */
static int pair_clear(const double (*one)[POINTS][3], const double (*other)[POINTS][3], const double *least)
{
    double middle[2][POINTS][3], way[2] = { 0.0, 0.0 };
    for (int side = 0; side < 2; ++side) {
        const double (*ends)[POINTS][3] = side ? other : one;
        for (int p = 0; p < POINTS; ++p) {
            double half[3];
            for (int k = 0; k < 3; ++k) {
                half[k] = 0.5 * (ends[1][p][k] - ends[0][p][k]);
                middle[side][p][k] = ends[0][p][k] + half[k];
            }
            way[side] = larger(way[side], dot(half, half));
        }
    }
    const double both = sqrt(way[0]) + sqrt(way[1]);
    const double (*a)[3] = (const double (*)[3])middle[0], (*b)[3] = (const double (*)[3])middle[1];
    if (!near(a, b, least, both))
        return 1;
    if (near(a, b, least, 0.0))
        return 0;
    if (both < FINELY)
        return 1;
    double halves[2][2][2][POINTS][3];
    for (int side = 0; side < 2; ++side) {
        const double (*ends)[POINTS][3] = side ? other : one;
        memcpy(halves[0][side][0], ends[0], sizeof ends[0]);
        memcpy(halves[0][side][1], middle[side], sizeof ends[0]);
        memcpy(halves[1][side][0], middle[side], sizeof ends[0]);
        memcpy(halves[1][side][1], ends[1], sizeof ends[0]);
    }
    for (int half = 0; half < 2; ++half)
        if (!pair_clear((const double (*)[POINTS][3])halves[half][0], (const double (*)[POINTS][3])halves[half][1], least))
            return 0;
    return 1;
}

/* Whether m swinging arms, at n points each, stay clear of arms that hold `others`, with the bases (4 x 4). */
void swings_clear(const Arm *arm, const Grips *grips, long m, long n, const double *points, const double *samples,
                  const double *bases, const long *others, const double *least, unsigned char *out)
{
    for (long s = 0; s < m; ++s) {
        const Frame base = frame_of(bases + 16 * s);
        double held[2][POINTS][3];
        out[s] = 1;
        for (long i = 0; i < n && out[s]; ++i) {
            double posture[JOINTS];
            const double (*here)[3] = (const double (*)[3])(points + 3 * POINTS * (s * n + i));
            memcpy(held[0], held[1], sizeof held[0]);
            posture_at(grips, others[s], samples[s * n + i], 0, JOINTS, posture);
            arm_points(arm, &base, posture, held[1]);
            if (near(here, (const double (*)[3])held[1], least, 0.0)
                || (i && !pair_clear((const double (*)[POINTS][3])(here - POINTS), (const double (*)[POINTS][3])held, least)))
                out[s] = 0;
        }
    }
}

/* What all swings of a plan have in common. `bases` (4 x 4) of the arms; `path` has `count` poses (4 x 4), `spacing`
   apart; `places` and `normals` of the holds; `arms`, `holds` and `free` (the hand may roll) of the grips.

   Curves have n points: how far `across`, how far `raised`, and the part of the wrists' change, `blend`. The numbers of
   raise_curves: `span` at `spans` points, `look_across` and `look_raised` at `looks`, `steps` and `half` at `halves`.
   `alternatives` says how much higher and what part of the arc each of `tried` curves is. Clear: of what stands around,
   and `apart` of the links of two arms. The body is looked at `halfway` samples after the hand is lifted; a swing takes
   `extra` besides its law, of which the hand opens for `latch` [s]. */
typedef struct {
    const Arm *arm;
    const Rules *rules;
    const World *world;
    Grips grips;
    const double *bases, *path, *places, *normals;
    const long *arms, *holds, *free;
    const double *across, *raised, *blend, *span, *look_across, *look_raised, *steps, *half;
    const double *alternatives, *apart;
    long count, n, spans, looks, halves, tried, halfway, passes;
    double spacing, height, aside, upright, extra, latch;
} Scene;

/* A swing to be examined: row of the arm, grips, sample at which it is lifted, last sample of the body, sample at
   which it may land. */
typedef struct {
    long arm, source, target, lift, last, soonest;
} Swing;

/* Joint 1 of a grip at a sample, clipped to the grip. */
static double first_joint(const Grips *grips, long grip, long sample)
{
    const long last = grips->last[grip], at = sample > last ? last : sample;
    const long since = at > grips->first[grip] ? at - grips->first[grip] : 0;
    return grips->postures[JOINTS * (grips->offset[grip] + since)];
}

/* The hand's curve over n points. */
static void curve_of(const Scene *scene, const Swing *swing, long which, double *place)
{
    const long a = scene->holds[swing->source], b = scene->holds[swing->target];
    const long then = swing->lift + scene->halfway, later = then < scene->count - 1 ? then : scene->count - 1;
    const double turn = first_joint(&scene->grips, swing->target, later + scene->halfway)
                        - first_joint(&scene->grips, swing->source, swing->lift);
    const Frame body = frame_of(scene->path + 16 * later), frame = product(&body, scene->bases + 16 * swing->arm);
    const double part = scene->alternatives[2 * which + 1], *pivot = &frame.row[0][0];
    const double *begin = scene->places + 3 * a, *end = scene->places + 3 * b;
    const double *leave = scene->normals + 3 * a, *arrive = scene->normals + 3 * b;
    double rise[2], lift;
    raise_curves(scene->world, 1, begin, end, leave, arrive, pivot, &turn, part, scene->height, scene->aside,
                 scene->upright, scene->spans, scene->span, scene->looks, scene->look_across, scene->look_raised,
                 scene->halves, scene->steps, scene->half, rise, &lift);
    lift += scene->alternatives[2 * which];
    curves_at(1, scene->n, begin, end, leave, arrive, rise, &lift, pivot, &turn, part, scene->across, scene->raised,
              place);
}

/* Whether a swing along one curve is possible and clear of what stands around and of `others`, so many grips; its law's
   duration. */
static int clear_along(const Scene *scene, const Swing *swing, long which, const long *others, long count,
                       double *duration)
{
    const long n = scene->n, hold[2] = { scene->holds[swing->source], scene->holds[swing->target] };
    const int guided = scene->free[swing->source] && scene->free[swing->target] ? 2 : 3;
    const double begin = (double)swing->lift + scene->latch / scene->spacing;
    const double least = (double)(swing->soonest - swing->lift) * scene->spacing - scene->extra;
    const double *base = scene->bases + 16 * swing->arm;
    double place[3 * MOST], samples[MOST], points[3 * POINTS * MOST], bodies[16 * MOST];
    unsigned char fits = 0;
    curve_of(scene, swing, which, place);
    swing_tracks(scene->arm, scene->rules, &scene->grips, 1, n, guided, scene->passes, base, scene->path, scene->count,
                 scene->spacing, place, scene->blend, &swing->source, &swing->target, &begin, &swing->last, &least,
                 &fits, duration, samples, points);
    if (!fits)
        return 0;
    for (long i = 0; i < n; ++i) {
        const Frame body = blended(scene->path, scene->count, samples[i]);
        memcpy(bodies + 16 * i, body.row, sizeof body.row);
    }
    swings_meet(scene->world, 1, n, &swing->arm, points, base, bodies, hold, &fits);
    for (long k = 0; k < count && fits; ++k)
        swings_clear(scene->arm, &scene->grips, 1, n, points, samples, scene->bases + 16 * scene->arms[others[k]],
                     others + k, scene->apart, &fits);
    return fits;
}

/* For m swings the first of the curves that is not `barred` (m x tried), possible, and clear of what stands around and
   of the grips `others`, `count` of each; -1 for none. `duration` is its law's. Returns 1 where n is too large. */
int choose_swings(const Scene *scene, long m, const Swing *swings, long count, const long *others,
               const unsigned char *barred, long *chosen, double *duration)
{
    if (scene->n > MOST || scene->n < 3)
        return 1;
    for (long s = 0; s < m; ++s) {
        chosen[s] = -1;
        for (long which = 0; which < scene->tried && chosen[s] < 0; ++which)
            if (!barred[scene->tried * s + which]
                && clear_along(scene, swings + s, which, others + count * s, count, duration + s))
                chosen[s] = which;
    }
    return 0;
}

#endif
