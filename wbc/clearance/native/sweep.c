/* The least distance of many pairs of moving bodies over a motion, proven: by halving it in time, over and over.
 *
 * In the middle of a piece of the motion a pair has a distance; at no instant of the piece it is less by more than both bodies'
 * points may be off the middle. What is not far enough apart for that is looked at in both halves. No memory is allocated. */
#include "distance.h"

/* Pieces of a motion between two knots are not halved more often */
#define HALVES 48

long long wbc_sweep_size(void) { return (long long)sizeof(sweep_t); }

static void ready(sweep_t *s, int b) {
    if (s->stamp[b] != s->node && !(s->body_frame[b] < 0 && s->stamp[b])) place_body(s, b);
}

/* What counts of a pair at the present place: its distance less what is required; where an exemption holds from the one time to
 * the other [knots], less is. `proven`: in parts by which it changes no faster than the bodies move */
static double margin(const sweep_t *s, int p, double from, double to, double gap, int proven) {
    double most = gap - s->required[p];
    for (int e = s->exempt_start[p]; e < s->exempt_start[p + 1]; e++) {
        if (from < s->exempt_from[e] || to > s->exempt_to[e]) continue;
        const int i = s->exempt_side[e] ? s->second[p] : s->first[p], j = s->exempt_side[e] ? s->first[p] : s->second[p];
        static const double still[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
        const double *A = s->body_frame[i] < 0 ? still : s->pose + 12 * s->body_frame[i], *x = s->exempt_point + 8 * e;
        const double *B = s->body_frame[j] < 0 ? still : s->pose + 12 * s->body_frame[j];
        double a[3], b[3];
        turn(A, x, a);
        turn(B, x + 3, b);
        for (int k = 0; k < 3; k++) a[k] += A[9 + k] - b[k] - B[9 + k];
        most = fmax(most, (gap + x[7] - x[6] * sqrt(dot3(a, a))) / (proven ? 1.0 + x[6] : 1.0));
    }
    return most;
}

/* Whether the exemptions of a pair begin or end within a piece, which is then looked at in halves */
static int changes(const sweep_t *s, int p, const piece_t *piece) {
    for (int e = s->exempt_start[p]; e < s->exempt_start[p + 1]; e++)
        if ((piece->i < s->exempt_from[e] && s->exempt_from[e] < piece->j) ||
            (piece->i < s->exempt_to[e] && s->exempt_to[e] < piece->j))
            return 1;
    return 0;
}

/* Above this nothing of a pair needs a closer look */
static double enough_of(const sweep_t *s, int p) {
    return fmin(s->far, (s->aim == LEAST ? s->least : s->high[p]) - s->tolerance);
}

static double middle_of(const piece_t *p) { return whole(p) ? (p->i + p->j) / 2 : p->i + 0.5 * (p->low + p->high); }

/* One pair over one piece: 1 where both halves must be looked at */
static int look(sweep_t *s, int p, const piece_t *piece, int last) {
    const int i = s->first[p], j = s->second[p];
    ready(s, i);
    ready(s, j);
    const double *a = s->moved + 2 * ((s->depth + 1) * i + s->stop_first[p]);
    const double *b = s->moved + 2 * ((s->depth + 1) * j + s->stop_second[p]);
    const double off = a[0] + b[0], rest = off - a[1] - b[1], enough = enough_of(s, p);
    const double middle = middle_of(piece);
    double quick = bound_of(s, i, j) - s->required[p];
    const int ends = rest <= s->tolerance || last;
    if (quick - off < enough && convex(s->shape + i) && convex(s->shape + j)) {
        /* Their centres lie within them: what is too near by these is too near */
        double d[3];
        minus3(s->body_pose + 12 * i + 9, s->body_pose + 12 * j + 9, d);
        if (!ends && sqrt(dot3(d, d)) - s->required[p] - off < enough) return 1;
        if (!is_round(s->shape + i) || !is_round(s->shape + j)) quick = fmax(quick, capsules_of(s, i, j) - s->required[p]);
    }
    if (quick - off >= enough) {
        s->low[p] = fmin(s->low[p], quick - off);
        return 0;
    }
    answer_t found;
    distance_of(s, i, j, &found);
    s->measured++;
    const double here = margin(s, p, middle, middle, found.gap, 1);
    const double all = margin(s, p, whole(piece) ? piece->i : middle, whole(piece) ? piece->j : middle, found.gap, 1);
    if (here < s->high[p]) {
        s->high[p] = here;
        s->when[p] = middle;
        s->least = fmin(s->least, here);
        if (s->aim == ANY && here < 0.0) s->stopped = p;
    }
    if (all - off < enough_of(s, p) && (!ends || (all < here && changes(s, p, piece)))) return 1;
    s->low[p] = fmin(s->low[p], all - off);
    return 0;
}

static void refine(sweep_t *s, piece_t piece, const int *pairs, int count, int depth, int *room) {
    int left = 0;
    s->node++;
    s->nodes++;
    place_frames(s, &piece);
    for (int k = 0; k < count && s->stopped < 0; k++)
        if (look(s, pairs[k], &piece, depth >= HALVES)) room[left++] = pairs[k];
    if (!left || s->stopped >= 0) return;
    piece_t one = piece, two = piece;
    if (whole(&piece)) {
        one.j = two.i = (piece.i + piece.j) / 2;
        depth = 0;
    } else {
        one.high = two.low = 0.5 * (piece.low + piece.high);
    }
    refine(s, one, room, left, depth + 1, room + left);
    if (s->stopped < 0) refine(s, two, room, left, depth + 1, room + left);
}

/* `count` of the pairs in `chosen`, into low, high and when [knots]; `list` has room for 128 times as many */
void wbc_sweep(sweep_t *s, int count) {
    const piece_t all = {0, s->knots - 1, 0.0, 1.0};
    s->stopped = -1;
    s->least = INFINITY;
    s->measured = s->nodes = 0;
    refine(s, all, s->chosen, count, 0, s->list);
}

/* A pair at a time [knots]: distance and nearest points, and what counts of it */
void wbc_sweep_at(sweep_t *s, int p, double time, double *out) {
    piece_t here = {(int)time, (int)time + 1, 0.0, 0.0};
    answer_t found;
    if (here.i > s->knots - 2) here.i = s->knots - 2, here.j = s->knots - 1;
    here.low = here.high = time - here.i;
    s->node++;
    place_frames(s, &here);
    ready(s, s->first[p]);
    ready(s, s->second[p]);
    distance_of(s, s->first[p], s->second[p], &found);
    out[0] = found.gap;
    copy3(found.point, out + 1);
    along3(found.point, found.gap, found.normal, out + 4);
    out[7] = margin(s, p, time, time, found.gap, 0);
}
