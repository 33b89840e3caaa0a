#!/bin/sh
# SciPy 1.17.1: linprog gives up on a linear program that it solves once presolving is switched off.
# How much slack three feet of a quadruped leave inside their cones of friction: 19 variables, 45 inequalities, 6 equations,
# all numbers between 0.01 and 1.6. The default (method="highs") ends with status 4 and the message "HiGHS Status 0: Not
# Set", without x; options={"presolve": False} finds 0.0268, and so does method="highs-ipm" with presolving. Who reads any
# status but 0 as "there is no such force" calls a stance impossible that is not.
# The points of contact are nearly, but not quite, on a rectangle; rounded to 1e-9 m the same program is solved.
#
# Fails as soon as the default solves it, or the others do not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "scipy==1.17.1" "numpy==2.3.5"
"$folder/env/bin/python" - <<'PYTHON'
import numpy as np
from scipy.optimize import linprog

FEET = [
    (1.589020298367, 0.083789845747, -0.010863257018),
    (1.421440606561, 0.083789845554, -0.010863257207),
    (1.421440606147, -0.083789846298, -0.010863256945),
]
"""Points of contact [m]."""
CENTER = (1.446378070244, -0.049604106513, 0.0)
"""Centre of mass [m]."""
FRICTION, HEIGHT = 0.6, 0.02
"""Coefficient [1], and height of the foot's origin over its point of contact [m]."""

angles = np.arange(8) * np.pi / 4
cone = np.zeros((15, 6))
cone[:8, 0], cone[:8, 1], cone[:8, 2] = np.cos(angles), np.sin(angles), -FRICTION * np.cos(np.pi / 8)
cone[8, 2] = -1.0
cone[9, [1, 3]], cone[10, [0, 4]], cone[11, 5] = (-HEIGHT, 1.0), (HEIGHT, 1.0), 1.0
cone[12:] = -cone[9:12]
slack = np.append(np.linalg.norm(cone[:9], axis=1), np.zeros(6))


def cross(point):
    """Matrix of the vector product with a point."""
    x, y, z = point
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


force, moment = np.hstack([np.eye(3), np.zeros((3, 3))]), [np.hstack([cross(foot), np.eye(3)]) for foot in FEET]
balance = np.vstack([np.hstack([force] * 3), np.hstack(moment)])
program = (
    np.append(np.zeros(18), -1.0),
    np.hstack([np.kron(np.eye(3), cone), np.tile(slack, 3)[:, None]]),
    np.zeros(45),
    np.hstack([balance, np.zeros((6, 1))]),
    np.append([0.0, 0.0, 1.0], cross(CENTER) @ [0.0, 0.0, 1.0]),
    [(None, None)] * 18 + [(None, 10.0)],
)
default = linprog(*program)
plain = linprog(*program, options={"presolve": False})
interior = linprog(*program, method="highs-ipm")
print(f"default: status {default.status}, {default.message}, x {default.x}")
for name, answer in (("without presolving", plain), ("interior points", interior)):
    print(f"{name}: status {answer.status}, slack {answer.x[-1]:.6f}")
    assert answer.status == 0 and abs(answer.x[-1] - 0.026756) < 1e-6
assert default.status == 4 and default.x is None
PYTHON
