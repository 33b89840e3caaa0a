/* The sensor of the closest pairs: one call a tick, from the configuration to the rows. No memory is allocated. */
#include "scene.h"
#include "steps.h"
#include "pairs.h"
#include "choose.h"
#include "corners.h"
#include "missing.h"

long long wbc_scene_size(void) { return (long long)sizeof(scene_t); }

/* All pairs, into `answer` and `doubtful` */
void wbc_measure(scene_t *s, const double *q) {
    place_bodies(s, q);
    s->measured = 0;
    for (int k = 0; k < s->pairs; k++) measure(s, k);
}

/* Measure what can be among the closest, and write the rows */
void wbc_sense(scene_t *s, const double *q) {
    double twist[6];
    place_bodies(s, q);
    s->measured = 0;
    choose(s);
    const int moves = outside_twist(s, twist);
    for (int r = 0; r < s->rows; r++) {
        const int pair = s->row_pair[r];
        if (pair < 0) continue;
        const double *found = s->answer + 7 * pair, gap = gap_of(s, pair);
        s->distance[r] = gap;
        line_through(found + 4, found + 1, s->line + 6 * r);
        s->drift[r] = moves ? drift_of(s, twist, pair, s->line + 6 * r) : 0.0;
        if (s->row_fresh[r])
            memcpy(s->side + (size_t)s->nv * r, s->pair_side + (size_t)s->nv * pair, s->nv * sizeof(double));
        if (!s->corners) continue;
        if (gap < s->margin[0] + s->near) {
            corner_rows(s, r);
            for (int k = 0; k < s->corners; k++) {
                const int at = s->rows + r * s->corners + k;
                s->drift[at] = moves ? drift_of(s, twist, pair, s->line + 6 * at) : 0.0;
            }
            s->row_near[r] = 1;
        } else if (s->row_near[r]) {
            no_corner_rows(s, r);
            s->row_near[r] = 0;
        }
    }
}

/* The most that a pair without a row uses of what its row would allow, at the command v where the last `wbc_sense` was;
 * such pairs are urgent from now on. Where there are as many rows as pairs `choose` gives each pair one. */
int wbc_missing(scene_t *s, const double *screws, const double *v, double dt, const double *braking) {
    if (s->pairs <= s->rows) return LITTLE;
    s->screws = screws, s->v = v, s->braking = braking;
    return missing(s, dt);
}
