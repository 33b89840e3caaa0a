/* Spaces of solutions and the best of them, by Householder reflections. Arrays of Python come as buffers, in any layout.
 * A matrix in here is one vector after another, each of `length` numbers. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

typedef struct _object PyObject;
/* Part of Python's stable interface since 3.11 */
typedef struct {
    void *buf;
    PyObject *obj;
    ptrdiff_t len, itemsize;
    int readonly, ndim;
    char *format;
    ptrdiff_t *shape, *strides, *suboffsets;
    void *internal;
} Py_buffer;
int PyObject_GetBuffer(PyObject *, Py_buffer *, int);
void PyBuffer_Release(Py_buffer *);
extern PyObject *PyExc_TypeError;
void PyErr_SetString(PyObject *, const char *);
/* PyBUF_STRIDES with PyBUF_FORMAT, and PyBUF_WRITABLE */
enum { READ = 0x1c, WRITE = 0x01 };

/* As in space.py and blocking.py */
#define RANK 1e-10
#define NOISE 1e-14
#define IDLE 1e-15
#define NEW 1e-8
#define SOUND 0.1

/* Reflections that make `count` vectors triangular: each in place of the vector it came from, with its factor. */
typedef struct {
    double *vectors, *diagonal, *factor;
    int *order, length, count, steps;
} triangle_t;

static double inner(const double *x, const double *y, int count) {
    double sum = 0.0;
    for (int i = 0; i < count; i++) sum += x[i] * y[i];
    return sum;
}

/* Rows of a matrix, or one vector, into `out`: so many numbers. Not 0: it is something else, which Python is told. */
static int load(PyObject *array, int count, double *out) {
    Py_buffer b;
    if (PyObject_GetBuffer(array, &b, READ)) return -1;
    const int fits = strcmp(b.format, "d") == 0 && b.len == (ptrdiff_t)8 * count && (b.ndim == 1 || b.ndim == 2);
    if (fits) {
        const ptrdiff_t rows = b.ndim > 1 ? b.shape[0] : 1, length = b.shape[b.ndim - 1];
        const ptrdiff_t down = b.ndim > 1 ? b.strides[0] : 0, along = b.strides[b.ndim - 1];
        for (ptrdiff_t i = 0; i < rows; i++)
            for (ptrdiff_t j = 0; j < length; j++) *out++ = *(double *)((char *)b.buf + i * down + j * along);
    } else {
        PyErr_SetString(PyExc_TypeError, "expected matrices and vectors of float64 that fit each other");
    }
    PyBuffer_Release(&b);
    return !fits;
}

static int store(PyObject *array, const void *data, size_t bytes) {
    Py_buffer b;
    if (PyObject_GetBuffer(array, &b, WRITE)) return -1;
    memcpy(b.buf, data, bytes);
    PyBuffer_Release(&b);
    return 0;
}

/* y := H y of reflection k */
static void reflect(const triangle_t *t, int k, double *y) {
    const double *v = t->vectors + k * t->length;
    const int left = t->length - k;
    const double by = t->factor[k] * inner(v + k, y + k, left);
    for (int i = k; i < t->length; i++) y[i] -= by * v[i];
}

static void to_axes(const triangle_t *t, int steps, double *y) {
    for (int k = 0; k < steps; k++) reflect(t, k, y);
}

static void from_axes(const triangle_t *t, int steps, double *y) {
    for (int k = steps - 1; k >= 0; k--) reflect(t, k, y);
}

/* With `order` the vector of which most is left comes next */
static void factorise(triangle_t *t) {
    const int length = t->length;
    t->steps = length < t->count ? length : t->count;
    for (int k = 0; k < t->steps; k++) {
        if (t->order) {
            int best = k;
            double most = -1.0;
            for (int j = k; j < t->count; j++) {
                const double *w = t->vectors + j * length + k, size = inner(w, w, length - k);
                if (size > most) most = size, best = j;
            }
            if (best != k) {
                double *a = t->vectors + k * length, *b = t->vectors + best * length;
                for (int i = 0; i < length; i++) { const double kept = a[i]; a[i] = b[i]; b[i] = kept; }
                const int kept = t->order[k];
                t->order[k] = t->order[best], t->order[best] = kept;
            }
        }
        double *v = t->vectors + k * length;
        const double first = v[k], rest = inner(v + k + 1, v + k + 1, length - k - 1), size = sqrt(first * first + rest);
        /* A vector that is along its axis stays, so that zeros stay zeros */
        t->diagonal[k] = rest == 0.0 ? first : first > 0.0 ? -size : size;
        v[k] = first - t->diagonal[k];
        t->factor[k] = rest == 0.0 ? 0.0 : -1.0 / (t->diagonal[k] * v[k]);
        for (int j = k + 1; j < t->count; j++) reflect(t, k, t->vectors + j * length);
    }
}

/* R' y = b, and R y = b, in place, of the first `count` vectors */
static void solve_down(const triangle_t *t, int count, double *b) {
    for (int k = 0; k < count; k++) b[k] = (b[k] - inner(t->vectors + k * t->length, b, k)) / t->diagonal[k];
}

static void solve_up(const triangle_t *t, int count, double *b) {
    for (int k = count - 1; k >= 0; k--) {
        b[k] /= t->diagonal[k];
        for (int i = 0; i < k; i++) b[i] -= t->vectors[k * t->length + i] * b[k];
    }
}

static int rank_of(const triangle_t *t) {
    int rank = 0;
    while (rank < t->steps && fabs(t->diagonal[rank]) > RANK * fabs(t->diagonal[0])) rank++;
    return rank;
}

/* The least y with C y = b, rows of C as vectors; sizes: of each row before it was restricted. 1: rows depend. */
static int least(double *C, double *b, const double *sizes, int rows, int length, double *y) {
    double numbers[2 * rows + 1], most = 0.0;
    triangle_t t = {C, numbers, numbers + rows, 0, length, rows, 0};
    if (rows > length) return 1;
    factorise(&t);
    for (int k = 0; k < rows; k++) most = sizes[k] > most ? sizes[k] : most;
    for (int k = 0; k < rows; k++)
        if (!(fabs(t.diagonal[k]) > fmax(RANK * sizes[k], NOISE * most))) return 1;
    solve_down(&t, rows, b);
    memset(y, 0, length * sizeof *y);
    memcpy(y, b, rows * sizeof *y);
    from_axes(&t, rows, y);
    return 0;
}

/* The least u with J u = x and A u = values; `n`, `p` rows of `m`. 1: they depend on each other. */
int wbc_least(PyObject *J, PyObject *x, PyObject *A, PyObject *values, PyObject *out, int n, int p, int m) {
    double F[(n + p) * m + 1], b[n + p + 1], sizes[n + p + 1], u[m];
    if (load(J, n * m, F) || load(x, n, b) || load(A, p * m, F + n * m) || load(values, p, b + n)) return -1;
    for (int i = 0; i < n + p; i++) sizes[i] = sqrt(inner(F + i * m, F + i * m, m));
    return least(F, b, sizes, n + p, m, u) ? 1 : store(out, u, sizeof u);
}

/* Coordinates of the point of a space [K, m] that is nearest to `r` [m], with A v = values: 1: A's rows depend on each
 * other within the space, 2: the vectors of the space do. */
int wbc_coordinates(PyObject *space, PyObject *r, PyObject *A, PyObject *values, PyObject *out, int K, int p, int m) {
    const int k = K - 1;
    double V[K * m], y[m], off[p + 1], C[p * m + 1], held[p * k + 1], sizes[p + 1], more[k + 1], t[K];
    double numbers[2 * k + 1], square[k + 1], *D = V + m;
    triangle_t tri = {D, numbers, numbers + k, 0, m, k, 0};
    if (load(space, K * m, V) || load(r, m, y) || load(A, p * m, C) || load(values, p, off)) return -1;
    for (int j = 0; j < k; j++) {
        for (int i = 0; i < m; i++) D[j * m + i] -= V[i];
        square[j] = inner(D + j * m, D + j * m, m);
    }
    if (k > m) return 2;
    factorise(&tri);
    for (int j = 0; j < k; j++)
        if (!(fabs(tri.diagonal[j]) > RANK * sqrt(square[j]))) return 2;
    for (int i = 0; i < m; i++) y[i] -= V[i];
    to_axes(&tri, k, y);
    for (int i = 0; i < p; i++) {
        double *c = C + i * m;
        sizes[i] = sqrt(inner(c, c, m));
        off[i] -= inner(c, V, m);
        to_axes(&tri, k, c);
        memcpy(held + i * k, c, k * sizeof *c);
        off[i] -= inner(c, y, k);
    }
    if (p) {
        if (least(held, off, sizes, p, k, more)) return 1;
        for (int j = 0; j < k; j++) y[j] += more[j];
    }
    solve_up(&tri, k, y);
    t[0] = 1.0;
    for (int j = 0; j < k; j++) t[0] -= y[j], t[j + 1] = y[j];
    return store(out, t, sizeof t);
}

/* J and x with each row by its own size, rows that are rounding beside others as zeros, and only columns that move:
 * not held, and, where they are not free, not zero. How many there are. */
static int prepare(double *J, double *x, int n, int m, const char *held, int loose, int *active) {
    double most = 0.0, largest = 0.0, size[m];
    int count = 0, moves = 0;
    for (int i = 0; i < n; i++) most = fmax(most, inner(J + i * m, J + i * m, m));
    memset(size, 0, sizeof size);
    for (int i = 0; i < n; i++) {
        double *row = J + i * m, norm = sqrt(inner(row, row, m)), by = norm > NOISE * sqrt(most) ? 1.0 / norm : 0.0;
        x[i] *= by;
        for (int j = 0; j < m; j++) {
            row[j] *= by;
            size[j] = fmax(size[j], fabs(row[j]));
            largest = fmax(largest, size[j]);
        }
    }
    for (int j = 0; j < m; j++) {
        const int zero = !(size[j] > IDLE * largest);
        if (held[j] || (zero && !loose)) continue;
        active[count++] = j;
        moves |= !zero;
    }
    return moves ? count : 0;
}

/* Rows of a task in `loaded`; what both generators begin with: J' in triangular form by rows, the largest first. */
static int begin(PyObject *J, PyObject *x, PyObject *held, int n, int m, int loose, triangle_t *t, double *rates,
                 double *rows, int *active) {
    Py_buffer b;
    if (load(J, n * m, rows) || load(x, n, rates) || PyObject_GetBuffer(held, &b, 0)) return -1;
    const int count = prepare(rows, rates, n, m, b.buf, loose, active);
    PyBuffer_Release(&b);
    for (int i = 0; i < n; i++) {
        t->order[i] = i;
        for (int j = 0; j < count; j++) t->vectors[i * count + j] = rows[i * m + active[j]];
    }
    t->length = count, t->count = n;
    if (count) factorise(t);
    return count;
}

/* Into `out` [m + 1, m] the least solution, and that plus one orthonormal self-motion each; `found`: rank, how many
 * columns move, these columns, order of the rows. */
int wbc_orthogonal(PyObject *J, PyObject *x, PyObject *held, PyObject *out, PyObject *found, int n, int m, int loose) {
    double rows[n * m], rates[n], vectors[n * m], numbers[2 * n], result[(m + 1) * m], y[m];
    int info[2 + m + n], *active = info + 2, order[n];
    triangle_t t = {vectors, numbers, numbers + n, order, 0, 0, 0};
    const int count = begin(J, x, held, n, m, loose, &t, rates, rows, active);
    if (count <= 0) return count;
    const int rank = rank_of(&t);
    memset(result, 0, sizeof result);
    for (int k = 0; k <= count - rank; k++) {
        memset(y, 0, sizeof y);
        if (k) {
            y[rank + k - 1] = 1.0;
        } else {
            for (int i = 0; i < rank; i++) y[i] = rates[order[i]];
            solve_down(&t, rank, y);
        }
        from_axes(&t, t.steps, y);
        for (int j = 0; j < count; j++) result[k * m + active[j]] = y[j] + (k ? result[active[j]] : 0.0);
    }
    info[0] = rank, info[1] = count;
    memcpy(info + 2 + m, order, sizeof order);
    return store(out, result, sizeof result) || store(found, info, sizeof info) ? -1 : count;
}

/* The same by blocked columns: the solution of the best conditioned block, and for each of the other columns the one in
 * which it takes the place of the column that moves most, by a sound pivot. `found` has besides, for each vector, which
 * column of the first block is blocked. -2: some column finds no place in the first block that way. */
int wbc_blocked(PyObject *J, PyObject *x, PyObject *held, PyObject *out, PyObject *found, int n, int m, int loose) {
    double rows[n * m], rates[n], vectors[n * m], numbers[2 * n + 2 * m], result[(m + 1) * m], y[m], size[m];
    int info[2 + 2 * m + n], *active = info + 2, *blocks = info + 2 + m + n, order[n], columns[m];
    triangle_t t = {vectors, numbers, numbers + n, order, 0, 0, 0};
    const int count = begin(J, x, held, n, m, loose, &t, rates, rows, active);
    if (count <= 0) return count;
    const int rank = rank_of(&t);
    memset(result, 0, sizeof result);
    memset(info + 2 + m + n, 0, m * sizeof *info);
    /* Columns of the independent rows as vectors, those of the block first */
    for (int j = 0; j < count; j++) {
        columns[j] = j, size[j] = 0.0;
        for (int i = 0; i < rank; i++) {
            const double value = rows[order[i] * m + active[j]];
            vectors[j * rank + i] = value;
            size[j] += value * value;
        }
        size[j] = sqrt(size[j]);
    }
    for (int i = 0; i < rank; i++) y[i] = rates[order[i]];
    triangle_t c = {vectors, numbers, numbers + m, columns, rank, count, 0};
    factorise(&c);
    to_axes(&c, rank, y);
    solve_up(&c, rank, y);
    double most = 0.0;
    for (int i = 0; i < rank; i++) {
        result[active[columns[i]]] = y[i];
        most = fmax(most, fabs(y[i]) * size[columns[i]]);
    }
    for (int k = 1; k <= count - rank; k++) {
        const int j = columns[rank + k - 1];
        double *turn = vectors + (rank + k - 1) * rank, sound = 0.0, moved = -1.0, length;
        int leaves = -1;
        solve_up(&c, rank, turn);
        for (int i = 0; i < rank; i++) sound = fmax(sound, fabs(turn[i]) * size[columns[i]]);
        for (int i = 0; i < rank; i++) {
            const double by = fabs(y[i]) * size[columns[i]];
            if (fabs(turn[i]) * size[columns[i]] > SOUND * sound && by > moved) moved = by, leaves = i;
        }
        if (leaves < 0 || !(sound > RANK * size[j])) return -2;
        length = y[leaves] / turn[leaves];
        double *g = result + k * m, far = most;
        for (int i = 0; i < rank; i++) {
            g[active[columns[i]]] = i == leaves ? 0.0 : y[i] - length * turn[i];
            far = fmax(far, fabs(g[active[columns[i]]]) * size[columns[i]]);
        }
        g[active[j]] = length;
        if (!(fabs(length) * size[j] > NEW * rank * far)) return -2;
        blocks[k - 1] = active[columns[leaves]];
    }
    info[0] = rank, info[1] = count;
    memcpy(info + 2 + m, order, sizeof order);
    /* Columns of the first block, then the others in the order of the vectors */
    int sorted[m];
    for (int k = 0; k < count; k++) sorted[k] = active[columns[k]];
    memcpy(active, sorted, count * sizeof *sorted);
    return store(out, result, sizeof result) || store(found, info, sizeof info) ? -1 : count;
}
