/* Shorter paths: cuts between any two of their points, corners pulled in, corners cut off. */
#pragma once

#include "trees.h"

/* What is gained must be more than this share */
#define GAIN 2e-3
/* Cuts end after so many that gained nothing */
#define IDLE 15
/* So many corners that went nowhere are known again while nothing about them has changed */
#define STUCK 16
/* Corners are pulled in by no less than this share */
#define PULLED 0.2
/* Paths that are longer than this against the best one after their cuts are left as they are */
#define HOPELESS 1.5

double wbc_plan_length(const plan_t *p, const double *x, int count) {
    double sum = 0.0;
    for (int k = 1; k < count; k++) sum += metric(p, x + (k - 1) * p->n, x + k * p->n);
    return sum;
}

/* Points i + 1 to j - 1 are replaced by `count` others where there is room; how many more points there are then */
static int splice(const plan_t *p, double *x, int points, int room, int i, int j, const double *others, int count) {
    const int more = count - (j - i - 1), n = p->n;
    if (points + more > room) return 0;
    memmove(x + (i + 1 + count) * n, x + j * n, (points - j) * n * sizeof *x);
    memcpy(x + (i + 1) * n, others, count * n * sizeof *x);
    return more;
}

/* The place at a length along a path: number of the point before it */
static int place_at(const plan_t *p, const double *x, int points, double at, double *out) {
    int k = 0;
    double piece;
    while (at > (piece = metric(p, x + k * p->n, x + (k + 1) * p->n)) && k < points - 2) at -= piece, k++;
    along_x(p, x + k * p->n, x + (k + 1) * p->n, piece > 0.0 ? fmin(at / piece, 1.0) : 0.0, out);
    return k;
}

/* One cut between two random places; this, as what pulls and cuts off below, returns how many more points there are then */
static int cut(plan_t *p, double *x, int points, int room, double *others, int most) {
    const int n = p->n;
    const double length = wbc_plan_length(p, x, points);
    const double first = uniform(p) * length, second = uniform(p) * length;
    double one = fmin(first, second), other = fmax(first, second);
    double *from = others, *to = others + n, *way = others + 2 * n;
    int i = place_at(p, x, points, one, from), j = place_at(p, x, points, other, to), reached;
    if (i == j) return 0;
    if (has_rows(p)) { /* between what keeps the rows already */
        if (j - i < 2) return 0;
        copy_x(p, x + i * n, from);
        copy_x(p, x + j * n, to);
        one = wbc_plan_length(p, x, i + 1), other = wbc_plan_length(p, x, j + 1);
    }
    if (metric(p, from, to) > (1.0 - GAIN) * (other - one)) return 0;
    const int count = walk(p, from, to, 4.0 * (other - one), way, most - 2, &reached);
    if (!reached || metric(p, from, way) + wbc_plan_length(p, way, count) > (1.0 - GAIN) * (other - one)) return 0;
    if (has_rows(p)) return splice(p, x, points, room, i, j, way, count - 1);
    copy_x(p, from, to);
    return splice(p, x, points, room, i, j + 1, to, count + 1);
}

/* Point k towards the line between its neighbours, as far as that is free; it goes where it may go there. `stuck`: how long ways through
 * points are that go nowhere */
static int pull(plan_t *p, double *x, int points, int k, double *stuck) {
    const int n = p->n;
    double line[n], to[n], share = 0.0, square = 0.0;
    double *before = x + (k - 1) * n, *here = x + k * n, *after = x + (k + 1) * n;
    for (int i = 0; i < n; i++) {
        share += p->weight[i] * (here[i] - before[i]) * (after[i] - before[i]);
        square += p->weight[i] * (after[i] - before[i]) * (after[i] - before[i]);
    }
    const double now = metric(p, before, here) + metric(p, here, after);
    const int stepped = has_rows(p);
    for (int m = 0; m < STUCK; m++)
        if (stuck[m] == now) return 0;
    if (sqrt(square) <= (stepped ? fmin(p->step, now) : now) && wbc_plan_edge(p, before, after))
        return splice(p, x, points, points, k - 1, k + 1, 0, 0);
    if (sqrt(square) > (1.0 - GAIN) * now) return 0;
    share = square > 0.0 ? fmin(fmax(share / square, 0.1), 0.9) : 0.5;
    along_x(p, before, after, share, line);
    if (p->rolls) memcpy(line, here, 3 * sizeof *line);
    for (double t = 1.0; t > PULLED; t *= 0.5) {
        along_x(p, here, line, t, to);
        if (stepped && !project(p, &p->path, to)) continue;
        if (metric(p, before, to) + metric(p, to, after) > (1.0 - GAIN) * now) continue;
        if (within(p, to) && way(p, (const double *[]){before, to, after}, 3)) return copy_x(p, to, here), 0;
    }
    memmove(stuck + 1, stuck, (STUCK - 1) * sizeof *stuck);
    *stuck = now;
    return 0;
}

/* The place at point k, where a base that rolls turns, towards the straight line between the places before and behind it */
static int pull_place(plan_t *p, double *x, int points, int room, int k, double *others, int most) {
    const int n = p->n;
    int i = k, j = k, first, second;
    while (i > 0 && !rolled_by(x + i * n, x + k * n)) i--;
    while (i > 0 && !rolled_by(x + (i - 1) * n, x + i * n)) i--;
    while (j < points - 1 && !rolled_by(x + j * n, x + k * n)) j++;
    while (j < points - 1 && !rolled_by(x + (j + 1) * n, x + j * n)) j++;
    const double *from = x + i * n, *target = x + j * n, *here = x + k * n, length = wbc_plan_length(p, from, j - i + 1);
    const double dx = target[0] - from[0], dy = target[1] - from[1], square = dx * dx + dy * dy;
    const double share = square > 0.0 ? fmin(fmax((dx * (here[0] - from[0]) + dy * (here[1] - from[1])) / square, 0.1), 0.9) : 0.5;
    double to[n];
    for (double t = 1.0; t > 0.5 * PULLED; t *= 0.5) {
        copy_x(p, here, to);
        to[0] += t * (from[0] + share * dx - here[0]), to[1] += t * (from[1] + share * dy - here[1]);
        steer(p, from, to, others);
        to[2] = others[2];
        int count = walk(p, from, to, 4.0 * length, others, most / 2, &first);
        if (!first) continue;
        count += walk(p, to, target, 4.0 * length, others + count * n, most - count, &second);
        if (second && metric(p, from, others) + wbc_plan_length(p, others, count) < (1.0 - GAIN) * length)
            return splice(p, x, points, room, i, j, others, count - 1);
    }
    return 0;
}

/* The corner at point k becomes an edge from one of its sides to the other */
static int bevel(plan_t *p, double *x, int points, int room, int k) {
    const int n = p->n;
    double two[2 * n];
    for (double t = 0.5; t > 0.1; t *= 0.5) {
        along_x(p, x + k * n, x + (k - 1) * n, t, two);
        along_x(p, x + k * n, x + (k + 1) * n, t, two + n);
        const double was = metric(p, two, x + k * n) + metric(p, x + k * n, two + n);
        if (metric(p, two, two + n) > (1.0 - 5.0 * GAIN) * was) return 0;
        if (wbc_plan_edge(p, two, two + n)) return splice(p, x, points, room, k - 1, k + 1, two, 2);
    }
    return 0;
}

/* One coordinate of points i + 1 to j - 1 goes evenly, over the length of the path, from where it is at i to where it is at j; 1: it is so
 * free, and shorter */
static int level(plan_t *p, double *x, int i, int j, int k, double *others) {
    const int n = p->n, count = j - i + 1;
    double *from = x + i * n, gone = 0.0;
    const double length = wbc_plan_length(p, from, count), first = from[k], last = x[j * n + k];
    memcpy(others, from, count * n * sizeof *x);
    for (int m = 1; m < count - 1; m++) {
        gone += metric(p, from + (m - 1) * n, from + m * n);
        others[m * n + k] = first + gone / length * (last - first);
    }
    if (wbc_plan_length(p, others, count) > (1.0 - 5.0 * GAIN) * length) return 0;
    const double *point[count];
    for (int m = 0; m < count; m++) point[m] = others + m * n;
    if (!way(p, point, count)) return 0;
    memcpy(from, others, count * n * sizeof *x);
    return 1;
}

/* A path with `cuts` tries, then with corners pulled in and cut off `rounds` times; the number of points */
int wbc_plan_shorten(plan_t *p, double *x, int points, int room, int cuts, int rounds, double *others, int most) {
    double stuck[STUCK] = {0.0};
    int idle = 0;
    for (int k = 0; k < cuts && points > 2 && idle < IDLE; k++) {
        const double before = wbc_plan_length(p, x, points);
        points += cut(p, x, points, room, others, most);
        idle = wbc_plan_length(p, x, points) < (1.0 - GAIN) * before ? 0 : idle + 1;
    }
    if (wbc_plan_length(p, x, points) > HOPELESS * p->longest) return points;
    for (int round = 0; round < rounds; round++) {
        const double before = wbc_plan_length(p, x, points);
        for (int k = 1, more; k < points - 1; k += 1 + more)
            points += more = pull(p, x, points, k, stuck);
        for (int k = 1; p->rolls && k < points - 1; k++) points += pull_place(p, x, points, room, k, others, most);
        for (int k = 0; !has_rows(p) && round == 0 && k < p->n && points > 2; k++)
            if (!level(p, x, 0, points - 1, k, others))
                for (int i = 0; i + 2 < points; i++) level(p, x, i, i + 2, k, others);
        for (int k = 1, more; !has_rows(p) && round % 2 == 0 && k < points - 1; k += 1 + more)
            points += more = bevel(p, x, points, room, k);
        if (wbc_plan_length(p, x, points) > (1.0 - 5.0 * GAIN) * before) break;
    }
    return points;
}
