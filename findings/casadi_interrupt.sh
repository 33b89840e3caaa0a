#!/usr/bin/env bash
# CasADi 3.8.2: Ctrl-C that comes while a function converts its arguments, arrays of numpy or lists, is dropped.
# Function.__call__ asks DM_from_array of casadi.py, a function in Python in which the handler of a signal may run,
# whether an argument is numbers. What the handler raises is caught by `except: return False` there, or cleared by the C++
# that called it, which then tries another conversion; the call returns its value as if nothing had come. More than
# half of the interrupts of a loop of such calls are lost, and none of one that evaluates by Function.buffer().
#
# Runs public packages alone, in a folder of its own; exits with 1 where the behaviour is another one.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check casadi==3.8.2 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import signal
import sys
import time

import casadi as ca
import numpy as np


class Interrupted(np.ndarray):
    """Ctrl-C comes while CasADi asks for numbers."""

    def astype(self, *given, **named):
        signal.raise_signal(signal.SIGINT)
        return super().astype(*given, **named)


def heard(call):
    """Whether an interrupt comes out of the calls in which it came."""
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.002)
        while signal.getitimer(signal.ITIMER_REAL)[0] > 0.0:
            for _ in range(10):
                call()
        # One that is still on its way
        time.sleep(0.001)
    except KeyboardInterrupt:
        return True
    return False


signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGALRM, signal.default_int_handler)
x = ca.SX.sym("x", 7)
double, q = ca.Function("double", [x], [2.0 * x]), np.ones(7)
try:
    values = np.array(double(q.view(Interrupted))).ravel().tolist()
except KeyboardInterrupt:
    values = None
print(f"casadi {ca.__version__}: a call with an array, and Ctrl-C in it: {values}")

buffer, run = double.buffer()
out = np.zeros(7)
buffer.set_arg(0, memoryview(q))
buffer.set_res(0, memoryview(out))
calls = {"an array": lambda: double(q), "a list": lambda: double([1.0] * 7), "a buffer": run}
lost = {name: sum(not heard(call) for _ in range(300)) for name, call in calls.items()}
print(f"of 300 interrupts in a loop of calls are lost with {lost}")
seen = values == [2.0] * 7 and lost["an array"] > 30 and lost["a list"] > 30 and lost["a buffer"] == 0
print("as described" if seen else "another behaviour")
sys.exit(not seen)
PYTHON
