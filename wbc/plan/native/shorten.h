/* Shorter paths: cuts between any two of their points, corners pulled in, corners cut off. */
#ifndef WBC_SHORTEN_H
#define WBC_SHORTEN_H

#include "trees.h"

/* What is gained must be more than this share */
#define GAIN 1e-3
/* Cuts end after so many that gained nothing */
#define IDLE 15
/* Corners are pulled in by no less than this share */
#define PULLED 0.2

static double length_of(const plan_t *p, const double *x, int count) {
    double sum = 0.0;
    for (int k = 1; k < count; k++) sum += metric(p, x + (k - 1) * p->n, x + k * p->n);
    return sum;
}

/* Points i + 1 to j - 1 are replaced by `count` others where there is room; the number of points */
static int splice(const plan_t *p, double *x, int points, int room, int i, int j, const double *others, int count) {
    const int now = points - (j - i - 1) + count, n = p->n;
    if (now > room) return points;
    memmove(x + (i + 1 + count) * n, x + j * n, (points - j) * n * sizeof *x);
    memcpy(x + (i + 1) * n, others, count * n * sizeof *x);
    return now;
}

/* The place at a length along a path: number of the point before it */
static int place_at(const plan_t *p, const double *x, int points, double at, double *out) {
    int k = 0;
    double piece = metric(p, x, x + p->n);
    while (at > piece && k < points - 2) {
        at -= piece, k++;
        piece = metric(p, x + k * p->n, x + (k + 1) * p->n);
    }
    along_x(p, x + k * p->n, x + (k + 1) * p->n, piece > 0.0 ? fmin(at / piece, 1.0) : 0.0, out);
    return k;
}

/* One cut between two random places */
static int cut(plan_t *p, double *x, int points, int room, double *others, int most) {
    const int n = p->n;
    const double length = length_of(p, x, points);
    const double first = uniform(p) * length, second = uniform(p) * length;
    double one = fmin(first, second), other = fmax(first, second);
    double *from = others, *to = others + n, *way = others + 2 * n;
    int i = place_at(p, x, points, one, from), j = place_at(p, x, points, other, to), reached;
    if (i == j) return points;
    if (has_rows(p)) { /* between what keeps the rows already */
        if (j - i < 2) return points;
        copy_x(p, x + i * n, from);
        copy_x(p, x + j * n, to);
        one = length_of(p, x, i + 1), other = length_of(p, x, j + 1);
    }
    if (metric(p, from, to) > (1.0 - GAIN) * (other - one)) return points;
    const int count = walk(p, from, to, 4.0 * (other - one), way, most - 2, &reached);
    if (!reached || metric(p, from, way) + length_of(p, way, count) > (1.0 - GAIN) * (other - one)) return points;
    return has_rows(p) ? splice(p, x, points, room, i, j, way, count - 1) : splice(p, x, points, room, i, j + 1, others, 2);
}

/* Point k towards the line between its neighbours, as far as that is free; it goes where it may go there */
static int pull(plan_t *p, double *x, int points, int k) {
    const int n = p->n;
    double line[n], to[n], share = 0.0, square = 0.0;
    double *before = x + (k - 1) * n, *here = x + k * n, *after = x + (k + 1) * n;
    for (int i = 0; i < n; i++) {
        share += p->weight[i] * (here[i] - before[i]) * (after[i] - before[i]);
        square += p->weight[i] * (after[i] - before[i]) * (after[i] - before[i]);
    }
    const double now = metric(p, before, here) + metric(p, here, after);
    const int stepped = has_rows(p);
    if (sqrt(square) <= (stepped ? fmin(p->step, now) : now) && edge(p, before, after))
        return splice(p, x, points, points, k - 1, k + 1, 0, 0);
    if (sqrt(square) > (1.0 - GAIN) * now) return points;
    share = square > 0.0 ? fmin(fmax(share / square, 0.1), 0.9) : 0.5;
    along_x(p, before, after, share, line);
    for (double t = 1.0; t > PULLED; t *= 0.5) {
        along_x(p, here, line, t, to);
        if (stepped && !project(p, &p->path, to)) continue;
        if (metric(p, before, to) + metric(p, to, after) > (1.0 - GAIN) * now) continue;
        if (within(p, to) && edge(p, before, to) && edge(p, to, after)) {
            copy_x(p, to, here);
            return points;
        }
    }
    return points;
}

/* The corner at point k becomes an edge from one of its sides to the other */
static int bevel(plan_t *p, double *x, int points, int room, int k) {
    const int n = p->n;
    double two[2 * n];
    for (double t = 0.5; t > 0.1; t *= 0.5) {
        along_x(p, x + k * n, x + (k - 1) * n, t, two);
        along_x(p, x + k * n, x + (k + 1) * n, t, two + n);
        const double was = metric(p, two, x + k * n) + metric(p, x + k * n, two + n);
        if (metric(p, two, two + n) > (1.0 - 5.0 * GAIN) * was) return points;
        if (!edge(p, two, two + n)) continue;
        return splice(p, x, points, room, k - 1, k + 1, two, 2);
    }
    return points;
}

/* One coordinate of points i + 1 to j - 1 goes evenly, over the length of the path, from where it is at i to where it is at j; 1: it is so
 * free, and shorter */
static int level(plan_t *p, double *x, int i, int j, int k, double *others) {
    const int n = p->n, count = j - i + 1;
    double *from = x + i * n, gone = 0.0;
    const double length = length_of(p, from, count), first = from[k], last = x[j * n + k];
    memcpy(others, from, count * n * sizeof *x);
    for (int m = 1; m < count - 1; m++) {
        gone += metric(p, from + (m - 1) * n, from + m * n);
        others[m * n + k] = first + gone / length * (last - first);
    }
    if (length_of(p, others, count) > (1.0 - 3.0 * GAIN) * length) return 0;
    for (int m = 1; m < count; m++)
        if (!edge(p, others + (m - 1) * n, others + m * n)) return 0;
    memcpy(from, others, count * n * sizeof *x);
    return 1;
}

/* A path with `cuts` tries, then with corners pulled in and cut off `rounds` times; the number of points */
static int shorten(plan_t *p, double *x, int points, int room, int cuts, int rounds, double *others, int most) {
    int idle = 0;
    for (int k = 0; k < cuts && points > 2 && idle < IDLE; k++) {
        const double before = length_of(p, x, points);
        points = cut(p, x, points, room, others, most);
        idle = length_of(p, x, points) < (1.0 - GAIN) * before ? 0 : idle + 1;
    }
    for (int round = 0; round < rounds; round++) {
        const double before = length_of(p, x, points);
        for (int k = 1; k < points - 1; k++) {
            const int now = pull(p, x, points, k);
            if (now < points) k--;
            points = now;
        }
        for (int k = 0; !has_rows(p) && round == 0 && k < p->n && points > 2; k++)
            if (!level(p, x, 0, points - 1, k, others))
                for (int i = 0; i + 2 < points; i++) level(p, x, i, i + 2, k, others);
        if (!has_rows(p) && round % 2 == 0)
            for (int k = 1; k < points - 1; k++) {
                const int now = bevel(p, x, points, room, k);
                if (now > points) k++;
                points = now;
            }
        if (length_of(p, x, points) > (1.0 - 5.0 * GAIN) * before) break;
    }
    return points;
}

#endif
