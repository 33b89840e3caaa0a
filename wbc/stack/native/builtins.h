/* Functions that Python calls as its own, in a third of the time that ctypes takes. Declared here is what they need of its
 * stable interface (of 3.11), so that no header of Python is needed. */
#ifndef WBC_BUILTINS_H
#define WBC_BUILTINS_H

#include "values.h"
#include "watch.h"

typedef struct _object PyObject;
typedef struct {
    void *buf;
    PyObject *obj;
    ptrdiff_t len, itemsize;
    int readonly, ndim;
    char *format;
    ptrdiff_t *shape, *strides, *suboffsets;
    void *internal;
} Py_buffer;
PyObject *PyLong_FromLong(long);
void *PyLong_AsVoidPtr(PyObject *);
PyObject *PyBytes_FromStringAndSize(const char *, ptrdiff_t);
char *PyBytes_AsString(PyObject *);
int PyObject_CheckBuffer(PyObject *);
int PyObject_GetBuffer(PyObject *, Py_buffer *, int);
void PyBuffer_Release(Py_buffer *);
void PyErr_Clear(void);
ptrdiff_t PyDict_Size(PyObject *);
int PyDict_Next(PyObject *, ptrdiff_t *, PyObject **, PyObject **);
PyObject *PyDict_New(void);
int PyDict_SetItem(PyObject *, PyObject *, PyObject *);
ptrdiff_t PyTuple_Size(PyObject *);
PyObject *PyTuple_GetItem(PyObject *, ptrdiff_t);
PyObject *PyTuple_New(ptrdiff_t);
int PyTuple_SetItem(PyObject *, ptrdiff_t, PyObject *);
PyObject *PyObject_Call(PyObject *, PyObject *, PyObject *);
PyObject *PyObject_CallFunctionObjArgs(PyObject *, ...);
int PyUnicode_Compare(PyObject *, PyObject *);
PyObject *PyType_GenericAlloc(PyObject *, ptrdiff_t);
void Py_DecRef(PyObject *);
void Py_IncRef(PyObject *);
ptrdiff_t PyBytes_Size(PyObject *);
int PyErr_BadArgument(void);
/* Flags of numpy: numbers in a row, where doubles may stand; not to be written */
#define ARRAY_IN_A_ROW 0x0101
/* Square of a turn [rad^2] below which its series are exact */
#define SMALL_TURN 1e-8
#define PyBUF_C_CONTIGUOUS 0x38
#define PyBUF_FORMAT 0x04

typedef struct {
    wbc_tick *tick;
    const double *from;
    const int *plan;
    long long count;
} wbc_request;

/* An array of numpy, whose beginning is the same in all its versions: its numbers, their axes and what they are */
typedef struct {
    ptrdiff_t references;
    const void *type;
    const double *data;
    int axes;
    const ptrdiff_t *shape, *strides;
    const void *base, *numbers;
    int flags;
} wbc_array;

/* The flag of wbc_tick_step; `tick`: its address, as an integer */
EXPORT PyObject *wbc_python_step(PyObject *tick, PyObject *none) {
    (void)none;
    return PyLong_FromLong(wbc_tick_step(PyLong_AsVoidPtr(tick)));
}

/* What wbc_tick_take returns; `request`: the address of its arguments, as an integer */
EXPORT PyObject *wbc_python_take(PyObject *request, PyObject *none) {
    const wbc_request *given = PyLong_AsVoidPtr(request);
    (void)none;
    return PyLong_FromLong(wbc_tick_take(given->tick, given->from, given->plan, (int)given->count));
}

/* q (+) v dt of a body that nothing holds, x, y, z and a quaternion x, y, z, w; v in its own axes */
static void float_on(const double *q, const double *v, double dt, double *to) {
    const double w[3] = {v[3] * dt, v[4] * dt, v[5] * dt}, p[3] = {v[0] * dt, v[1] * dt, v[2] * dt}, *r = q + 3;
    const double square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2], angle = sqrt(square);
    const int small = square < SMALL_TURN;
    /* sin(angle / 2) / angle, and the left Jacobian 1 + a [w] + b [w]^2 */
    const double s = small ? 0.5 - square / 48.0 : sin(0.5 * angle) / angle, c = cos(0.5 * angle);
    const double a = small ? 0.5 - square / 24.0 : 2.0 * s * s;
    const double b = small ? 1.0 / 6.0 - square / 120.0 : (angle - sin(angle)) / (square * angle);
    const double once[3] = {w[1] * p[2] - w[2] * p[1], w[2] * p[0] - w[0] * p[2], w[0] * p[1] - w[1] * p[0]};
    const double twice[3] = {w[1] * once[2] - w[2] * once[1], w[2] * once[0] - w[0] * once[2],
                             w[0] * once[1] - w[1] * once[0]};
    const double turn[4] = {s * w[0], s * w[1], s * w[2], c};
    double m[3], across[3], sum[4], size = 0.0;
    for (int i = 0; i < 3; i++) m[i] = p[i] + a * once[i] + b * twice[i];
    for (int i = 0; i < 3; i++) across[i] = 2.0 * (r[(i + 1) % 3] * m[(i + 2) % 3] - r[(i + 2) % 3] * m[(i + 1) % 3]);
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        to[i] = q[i] + m[i] + r[3] * across[i] + r[j] * across[k] - r[k] * across[j];
        sum[i] = r[3] * turn[i] + turn[3] * r[i] + r[j] * turn[k] - r[k] * turn[j];
    }
    sum[3] = r[3] * turn[3] - r[0] * turn[0] - r[1] * turn[1] - r[2] * turn[2];
    for (int i = 0; i < 4; i++) size += sum[i] * sum[i];
    /* cos(angle / 2) < 0: the other quaternion of the turn is nearer to what it was */
    size = (c < 0.0 ? -1.0 : 1.0) / sqrt(size);
    for (int i = 0; i < 4; i++) to[3 + i] = size * sum[i];
}

/* Where ticks are recorded: rows of pieces of the tick's memory, one after the other in a chunk. Python puts the chunk in
 * its place, writes the last row of each, and all where anything but the tick itself has changed what the solver remembers */
typedef struct {
    long long ready, end, count; /* not 0: the next tick may be recorded here; bytes of the chunk that are full; ticks */
    long long row, size;         /* of a tick, and of the chunk [bytes] */
    char *chunk;
    const long long *pieces;     /* of each: where it begins in the row, and in memory, its size [bytes] */
    long long given, told;       /* pieces that are copied before the tick, and after it */
    long long reset;             /* where in the row a number is 0: the solver remembers its active set [bytes] */
} wbc_recording;

/* A tick with its values in one call: a configuration, and what wbc_tick_take takes */
typedef struct {
    wbc_tick *tick;
    wbc_recording *const *recording; /* where the address of one is, or 0 */
    const wbc_watch *watch;
    double *q, *staged;      /* the tick's configuration, and where values wait */
    const int *plan;
    long long count, coordinates, bytes; /* values, coordinates of q, and of what a step keeps of `report` */
    const char *report;
    const int *moves;        /* of each joint: whether it is a free base, its places in q and in v */
    long long joints, later; /* how many, and coordinates of q (+) v dt, which follows what a step keeps; 0: it does not */
    PyObject *const *names;  /* of the values, in their order */
    const void *arrays, *doubles; /* types of numpy's arrays, 0 where they are not as wbc_array, and of doubles */
    PyObject *step, *context;     /* the type of what is returned, and what all of its kind share; */
    long long context_at, data_at; /* bytes before this, and before what a step keeps, in a step */
} wbc_cycle;

static void move_to_next(const wbc_cycle *c, double *to) {
    const wbc_tick *t = c->tick;
    const double *v = t->report.v, dt = t->dt;
    for (long long k = 0; k < c->joints; k++) {
        const int *at = c->moves + 3 * k, i = at[1], j = at[2];
        if (at[0]) float_on(c->q + i, v + j, dt, to + i);
        else to[i] = c->q[i] + v[j] * dt;
    }
}

/* The report and what was given, and q (+) v dt after it */
static PyObject *kept(const wbc_cycle *c) {
    PyObject *out = PyBytes_FromStringAndSize(0, (ptrdiff_t)(c->bytes + c->later * (long long)sizeof(double)));
    if (!out) return out;
    char *to = PyBytes_AsString(out);
    memcpy(to, c->report, (size_t)c->bytes);
    if (c->later) move_to_next(c, (double *)(to + c->bytes));
    return out;
}

/* The numbers of an array of doubles, row by row, of one axis or, of a pose, [4, 4]; 0 where it is none */
static int numbers_of(const wbc_cycle *c, PyObject *array, int pose, long long count, double *to) {
    const wbc_array *plain = (const wbc_array *)array;
    Py_buffer view;
    /* What numpy says as a buffer takes it longer than the rest of the call */
    if (c->arrays && plain->type == c->arrays && plain->numbers == c->doubles && (plain->flags & ARRAY_IN_A_ROW) == ARRAY_IN_A_ROW) {
        if (pose ? plain->axes != 2 || plain->shape[0] != 4 || plain->shape[1] != 4 : plain->axes != 1 || plain->shape[0] != count) return 0;
        memcpy(to, plain->data, (size_t)count * sizeof(double));
        return 1;
    }
    if (!PyObject_CheckBuffer(array)) return 0;
    if (PyObject_GetBuffer(array, &view, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT)) {
        PyErr_Clear();
        return 0;
    }
    const int fits = view.format && view.format[0] == 'd' && !view.format[1] && view.len == count * 8 &&
                     (pose ? view.ndim == 2 && view.shape[0] == 4 : view.ndim == 1);
    if (fits) memcpy(to, view.buf, (size_t)view.len);
    PyBuffer_Release(&view);
    return fits;
}

/* What `kept` has, as a step */
static PyObject *step_of(const wbc_cycle *c) {
    PyObject *data = kept(c), *out = data ? PyType_GenericAlloc(c->step, 0) : 0;
    if (!out) {
        if (data) Py_DecRef(data);
        return 0;
    }
    /* Its slots, which are empty */
    Py_IncRef(c->context);
    *(PyObject **)((char *)out + c->context_at) = c->context;
    *(PyObject **)((char *)out + c->data_at) = data;
    return out;
}

/* Value k by its name, where it belongs in the order of `names`, to where it waits; 0 where it is refused */
static int value_of(const wbc_cycle *c, long long k, PyObject *name, PyObject *value, double *at) {
    if (name != c->names[k] && PyUnicode_Compare(name, c->names[k])) return 0;
    return numbers_of(c, value, c->plan[3 * k] == VALUE_POSE, c->plan[3 * k + 2], at);
}

/* All values, of a dictionary or, where there is none, of a call with their names; 0 where one is refused */
static int values_of(const wbc_cycle *c, PyObject *values, PyObject *names, PyObject *const *given) {
    PyObject *name, *value;
    double *at = c->staged;
    ptrdiff_t next = 0;
    if ((values ? PyDict_Size(values) : names ? PyTuple_Size(names) : 0) != c->count) return 0;
    for (long long k = 0; k < c->count; at += c->plan[3 * k++ + 2]) {
        if (!values) name = PyTuple_GetItem(names, (ptrdiff_t)k), value = given[k];
        else if (!PyDict_Next(values, &next, &name, &value)) return 0;
        if (!value_of(c, k, name, value, at)) return 0;
    }
    return 1;
}

static void copy_row(const wbc_recording *r, const char *memory, long long first, long long count) {
    for (const long long *p = r->pieces + 3 * first, *end = p + 3 * count; p < end; p += 3)
        memcpy(r->chunk + r->end + p[0], memory + p[1], (size_t)p[2]);
}

/* 1 for a tick that is solved and misses no pair, else 0 with its flag: WBC_NOT_TAKEN, and nothing is changed, where an argument is
 * refused. `values`, `names`, `given`: as of `values_of` */
#define WBC_NOT_TAKEN (-100)
static int tick_with(const wbc_cycle *c, PyObject *q, PyObject *values, PyObject *names, PyObject *const *given, int *flag) {
    const size_t size = (size_t)c->coordinates * sizeof(double);
    double before[c->coordinates + 1];
    wbc_recording *const r = *c->recording;
    *flag = WBC_NOT_TAKEN;
    if (r && (!r->ready || r->end + 2 * r->row > r->size)) return 0;
    if (!values_of(c, values, names, given)) return 0;
    memcpy(before, c->q, size);
    if (!numbers_of(c, q, 0, c->coordinates, c->q)) return 0;
    if (c->count && (wbc_tick_check(c->tick) || !wbc_tick_take(c->tick, c->staged, c->plan, (int)c->count))) {
        memcpy(c->q, before, size);
        wbc_tick_check(c->tick);
        return 0;
    }
    if (c->watch->count) wbc_tick_sense(c->tick, c->watch);
    if (r) copy_row(r, c->report, 0, r->given);
    *flag = wbc_tick_step(c->tick);
    const int done = !*flag && !(c->watch->count && wbc_tick_missed(c->tick, c->watch) >= MISSED);
    if (r && done) {
        copy_row(r, c->report, r->given, r->told);
        memset(r->chunk + r->end + r->reset, 0, sizeof(double));
        r->end += r->row, r->count++;
    } else if (r && *flag >= 0) r->ready = 0;
    return done;
}

/* The step of such a tick, else its flag. `given`: a configuration, and a dictionary of values by name */
EXPORT PyObject *wbc_python_cycle(PyObject *request, PyObject *const *given, ptrdiff_t count) {
    const wbc_cycle *c = PyLong_AsVoidPtr(request);
    int flag = WBC_NOT_TAKEN;
    return count == 2 && tick_with(c, given[0], given[1], 0, 0, &flag) ? step_of(c) : PyLong_FromLong(flag);
}

/* Steps of a controller: ticks of no values, and of those of the last step that had any */
typedef struct {
    const long long *gate; /* of GATE numbers one is not 0: a step has more to do than a tick */
    const wbc_cycle *plain, *with_values;
} wbc_steps;
#define GATE 3

/* The call of a function with arguments as they were given */
static PyObject *call_with(PyObject *function, PyObject *const *given, ptrdiff_t count, PyObject *names) {
    const ptrdiff_t named = names ? PyTuple_Size(names) : 0;
    PyObject *plain = PyTuple_New(count), *by_name = PyDict_New(), *out = 0;
    int ok = plain && by_name;
    for (ptrdiff_t k = 0; ok && k < count; k++) {
        Py_IncRef(given[k]);
        ok = !PyTuple_SetItem(plain, k, given[k]);
    }
    for (ptrdiff_t k = 0; ok && k < named; k++) ok = !PyDict_SetItem(by_name, PyTuple_GetItem(names, k), given[count + k]);
    if (ok) out = PyObject_Call(function, plain, by_name);
    if (plain) Py_DecRef(plain);
    if (by_name) Py_DecRef(by_name);
    return out;
}

/* `step` of a controller. `about`: the address of a wbc_steps, as an integer; what does a step that is more than a tick; what ends one
 * whose tick has a flag (flag, q) */
EXPORT PyObject *wbc_python_steps(PyObject *about, PyObject *const *given, ptrdiff_t count, PyObject *names) {
    const wbc_steps *s = PyLong_AsVoidPtr(PyTuple_GetItem(about, 0));
    const wbc_cycle *c = names && PyTuple_Size(names) ? s->with_values : s->plain;
    long long more = count != 1;
    int flag = WBC_NOT_TAKEN;
    for (int k = 0; k < GATE; k++) more |= s->gate[k];
    if (!more && tick_with(c, given[0], 0, names, given + 1, &flag)) return step_of(c);
    if (flag < 0) return call_with(PyTuple_GetItem(about, 1), given, count, names);
    PyObject *number = PyLong_FromLong(flag);
    PyObject *out = number ? PyObject_CallFunctionObjArgs(PyTuple_GetItem(about, 2), number, given[0], (PyObject *)0) : 0;
    if (number) Py_DecRef(number);
    return out;
}

/* What a step keeps of the tick before; `request`: the address of a wbc_cycle, as an integer */
EXPORT PyObject *wbc_python_kept(PyObject *request, PyObject *none) {
    (void)none;
    return kept(PyLong_AsVoidPtr(request));
}

/* Numbers of what a step keeps: functions of numpy, its types of arrays and of doubles, bytes before the numbers, their count */
typedef struct {
    PyObject *(*make)(PyObject *, PyObject *, int, const ptrdiff_t *, const ptrdiff_t *, void *, int, PyObject *);
    int (*hold)(PyObject *, PyObject *);
    PyObject *type, *doubles;
    ptrdiff_t before, count;
} wbc_part;

/* They as an array, read-only, without a copy; `request`: the address of a wbc_part, as an integer */
EXPORT PyObject *wbc_python_part(PyObject *request, PyObject *data) {
    const wbc_part *p = PyLong_AsVoidPtr(request);
    char *from = PyBytes_AsString(data);
    if (!from) return 0;
    if (PyBytes_Size(data) < p->before + p->count * (ptrdiff_t)sizeof(double)) {
        PyErr_BadArgument();
        return 0;
    }
    Py_IncRef(p->doubles);
    PyObject *out = p->make(p->type, p->doubles, 1, &p->count, 0, from + p->before, ARRAY_IN_A_ROW, 0);
    if (!out) return 0;
    /* Both calls take a reference over */
    Py_IncRef(data);
    if (!p->hold(out, data)) return out;
    Py_DecRef(out);
    return 0;
}

#endif
