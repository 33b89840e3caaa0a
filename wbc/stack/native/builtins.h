/* Functions that Python calls as its own, in a third of the time that ctypes takes. Declared here are two functions of
 * its stable interface, so that no header of Python is needed. */
#ifndef WBC_BUILTINS_H
#define WBC_BUILTINS_H

#include "values.h"

typedef struct _object PyObject;
PyObject *PyLong_FromLong(long);
void *PyLong_AsVoidPtr(PyObject *);

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

#endif
