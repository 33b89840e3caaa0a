/* Functions that Python calls as its own, in a third of the time that ctypes takes. Declared here is what they need of its
 * stable interface (of 3.11), so that no header of Python is needed. */
#ifndef WBC_BUILTINS_H
#define WBC_BUILTINS_H

#include "values.h"

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
int PyUnicode_Compare(PyObject *, PyObject *);
PyObject *PyType_GenericAlloc(PyObject *, ptrdiff_t);
int PyObject_SetAttr(PyObject *, PyObject *, PyObject *);
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

/* A tick with its values in one call: a configuration, and what wbc_tick_take takes */
typedef struct {
    wbc_tick *tick;
    double *q, *staged;      /* the tick's configuration, and where values wait */
    const int *plan;
    long long count, coordinates, bytes; /* values, coordinates of q, and of what a step keeps of `report` */
    const char *report;
    const int *moves;        /* of each joint: whether it is a free base, its places in q and in v */
    long long joints, later; /* how many, and coordinates of q (+) v dt, which follows what a step keeps; 0: it does not */
    PyObject *const *names;  /* of the values, in their order */
    PyObject *step;          /* the type of what is returned, and what all of its kind share, */
    PyObject *context, *context_name, *data_name; /* as an attribute, beside what the step keeps */
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
static int numbers_of(PyObject *array, int pose, long long count, double *to) {
    Py_buffer view;
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
    if (out && (PyObject_SetAttr(out, c->data_name, data) || PyObject_SetAttr(out, c->context_name, c->context))) {
        Py_DecRef(out);
        out = 0;
    }
    if (data) Py_DecRef(data);
    return out;
}

/* Values by name, in the order of `names`, to where they wait; 0 where one is refused */
static int values_of(const wbc_cycle *c, PyObject *values) {
    PyObject *name, *value;
    double *at = c->staged;
    ptrdiff_t next = 0;
    if (PyDict_Size(values) != c->count) return 0;
    for (long long k = 0; k < c->count; at += c->plan[3 * k++ + 2]) {
        if (!PyDict_Next(values, &next, &name, &value)) return 0;
        if (name != c->names[k] && PyUnicode_Compare(name, c->names[k])) return 0;
        if (!numbers_of(value, c->plan[3 * k] == VALUE_POSE, c->plan[3 * k + 2], at)) return 0;
    }
    return 1;
}

/* The step of a tick that is solved, else its flag; WBC_NOT_TAKEN, and nothing is changed, where an argument is refused.
 * `given`: a configuration, and a dictionary of values by name */
#define WBC_NOT_TAKEN (-100)
EXPORT PyObject *wbc_python_cycle(PyObject *request, PyObject *const *given, ptrdiff_t count) {
    const wbc_cycle *c = PyLong_AsVoidPtr(request);
    const size_t size = (size_t)c->coordinates * sizeof(double);
    double before[c->coordinates + 1];
    if (count != 2 || !values_of(c, given[1])) return PyLong_FromLong(WBC_NOT_TAKEN);
    memcpy(before, c->q, size);
    if (!numbers_of(given[0], 0, c->coordinates, c->q)) return PyLong_FromLong(WBC_NOT_TAKEN);
    if (c->count && (wbc_tick_check(c->tick) || !wbc_tick_take(c->tick, c->staged, c->plan, (int)c->count))) {
        memcpy(c->q, before, size);
        wbc_tick_check(c->tick);
        return PyLong_FromLong(WBC_NOT_TAKEN);
    }
    const int flag = wbc_tick_step(c->tick);
    return flag ? PyLong_FromLong(flag) : step_of(c);
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
