#!/bin/sh
# OSQP 1.1.3 (Python): an update that is refused is printed and not raised, and the next solve says "solved" of the old problem.
# update(l=..., u=...) with a lower bound above its upper one, and update(Px=...) of another number of elements than the
# upper triangle has, print one line to stderr and return None as a good update does. The solver keeps the data that it
# had, and solve() gives the old answer with status "solved". In a loop where limits may cross for a tick (a joint beyond
# its range, two zones that meet) the robot goes on under the limits of the tick before. setup() raises for both.
#
# Fails as soon as an update that is refused raises or changes the status.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "osqp==1.1.3" "scipy==1.17.1" "numpy==2.3.5"
"$folder/env/bin/python" - 2>&1 <<'PYTHON'
import numpy as np
import osqp
import scipy.sparse

hessian = scipy.sparse.csc_matrix(np.array([[2.0, 1.0], [1.0, 2.0]]))
rows = scipy.sparse.identity(2, format="csc")
target = np.array([-3.0, -3.0])
crossing = {"l": np.array([0.4, 0.4]), "u": np.array([0.3, 0.3])}

solver = osqp.OSQP()
solver.setup(hessian, target, rows, np.zeros(2), np.full(2, 0.5), verbose=False, eps_abs=1e-9, eps_rel=1e-9)
first = solver.solve()
for name, change in (("crossing bounds", crossing), ("four elements of P", {"Px": 2.0 * hessian.data})):
    answer = solver.update(**change)
    again = solver.solve()
    print(f"{name}: update gave {answer}, then {again.info.status} at {again.x.round(6)}, before {first.x.round(6)}")
    assert answer is None and again.info.status == "solved" and np.allclose(again.x, first.x, atol=1e-6)

try:
    osqp.OSQP().setup(hessian, target, rows, crossing["l"], crossing["u"], verbose=False)
except Exception as error:
    print(f"setup with crossing bounds raised {type(error).__name__}")
else:
    raise AssertionError("setup takes crossing bounds")
PYTHON
