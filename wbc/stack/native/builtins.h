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
int PyObject_CheckBuffer(PyObject *);
int PyObject_GetBuffer(PyObject *, Py_buffer *, int);
void PyBuffer_Release(Py_buffer *);
void PyErr_Clear(void);
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

/* A tick with its values in one call: a configuration, and what wbc_tick_take takes */
typedef struct {
    wbc_tick *tick;
    double *q, *staged;      /* the tick's configuration, and where values wait */
    const int *plan;
    long long count, coordinates, bytes; /* values, coordinates of q, and of what a step keeps of `report` */
    const char *report;
} wbc_cycle;

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

/* What a step keeps of a tick that is solved, else its flag; WBC_NOT_TAKEN, and nothing is changed, where an argument is
 * refused */
#define WBC_NOT_TAKEN (-100)
EXPORT PyObject *wbc_python_cycle(PyObject *request, PyObject *const *given, ptrdiff_t count) {
    const wbc_cycle *c = PyLong_AsVoidPtr(request);
    const size_t size = (size_t)c->coordinates * sizeof(double);
    double before[c->coordinates + 1], *at = c->staged;
    if (count != c->count + 1) return PyLong_FromLong(WBC_NOT_TAKEN);
    for (long long k = 0; k < c->count; at += c->plan[3 * k++ + 2])
        if (!numbers_of(given[k + 1], c->plan[3 * k] == VALUE_POSE, c->plan[3 * k + 2], at))
            return PyLong_FromLong(WBC_NOT_TAKEN);
    memcpy(before, c->q, size);
    if (!numbers_of(given[0], 0, c->coordinates, c->q)) return PyLong_FromLong(WBC_NOT_TAKEN);
    if (c->count && (wbc_tick_check(c->tick) || !wbc_tick_take(c->tick, c->staged, c->plan, (int)c->count))) {
        memcpy(c->q, before, size);
        wbc_tick_check(c->tick);
        return PyLong_FromLong(WBC_NOT_TAKEN);
    }
    const int flag = wbc_tick_step(c->tick);
    return flag ? PyLong_FromLong(flag) : PyBytes_FromStringAndSize(c->report, (ptrdiff_t)c->bytes);
}

#endif
