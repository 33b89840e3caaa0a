/* Which pairs have which rows: the closest ones, and those that were close enough to stay.
 *
 * A pair's score is its distance, less what lets it keep a row that it has; urgent ones come before all others. The `rows`
 * least scores are chosen, of equal ones the pair named first. Pairs that are not urgent and whose bound is above the greatest
 * score chosen so far are not measured. */
#ifndef WBC_CHOOSE_H
#define WBC_CHOOSE_H

#include "pairs.h"

/* Whether pair i is chosen after pair k */
static inline int after(const scene_t *s, int i, int k) {
    return s->score[i] > s->score[k] || (s->score[i] == s->score[k] && i > k);
}

/* The heap's top is the pair that goes first; it has room for `rows` */
static void sink(const scene_t *s, int count, int at) {
    for (;;) {
        int last = at, left = 2 * at + 1;
        for (int k = left; k < count && k < left + 2; k++)
            if (after(s, s->heap[k], s->heap[last])) last = k;
        if (last == at) return;
        const int pair = s->heap[at];
        s->heap[at] = s->heap[last];
        s->heap[last] = pair;
        at = last;
    }
}

static int offer(scene_t *s, int count, int pair) {
    measure(s, pair);
    const double gap = gap_of(s, pair);
    s->score[pair] = gap - s->far * s->urgent[pair] - (s->has_row[pair] ? s->keep_share * fmax(gap, 0.0) + s->keep_length : 0.0);
    s->is_measured[pair] = 1;
    if (count < s->rows) {
        s->heap[count] = pair;
        if (count + 1 == s->rows)
            for (int k = s->rows / 2; k >= 0; k--) sink(s, s->rows, k);
        return count + 1;
    }
    if (after(s, s->heap[0], pair)) {
        s->heap[0] = pair;
        sink(s, count, 0);
    }
    return count;
}

static void assign(scene_t *s, int count) {
    for (int k = 0; k < s->pairs; k++) s->has_row[k] = 0;
    for (int k = 0; k < count; k++) s->has_row[s->heap[k]] = 1;
    for (int r = 0; r < s->rows; r++) {
        s->row_fresh[r] = s->row_pair[r] < 0 || !s->has_row[s->row_pair[r]];
        if (!s->row_fresh[r]) s->has_row[s->row_pair[r]] = 2; /* it stays where it is */
    }
    for (int r = 0; r < s->rows; r++) {
        if (!s->row_fresh[r]) continue;
        int least = -1;
        for (int k = 0; k < count; k++)
            if (s->has_row[s->heap[k]] == 1 && (least < 0 || after(s, least, s->heap[k]))) least = s->heap[k];
        s->row_pair[r] = least;
        if (least >= 0) s->has_row[least] = 2;
    }
}

static void choose(scene_t *s) {
    int count = 0;
    if (s->pairs <= s->rows) { /* all have one, in the order of the pairs */
        for (int k = 0; k < s->pairs; k++) {
            measure(s, k);
            s->row_fresh[k] = s->row_pair[k] < 0;
            s->row_pair[k] = k;
        }
        return;
    }
    for (int k = 0; k < s->pairs; k++) s->is_measured[k] = 0;
    for (int r = 0; r < s->rows; r++) {
        const int pair = s->row_pair[r];
        if (pair < 0) continue;
        count = offer(s, count, pair);
        s->least[pair] = s->answer[7 * pair];
    }
    for (int k = 0; k < s->pairs; k++) {
        if (s->is_measured[k]) continue;
        s->least[k] = bound(s, k) - s->off;
        if (!s->urgent[k] && count == s->rows && s->least[k] > s->score[s->heap[0]]) continue;
        count = offer(s, count, k);
    }
    assign(s, count);
}

#endif
