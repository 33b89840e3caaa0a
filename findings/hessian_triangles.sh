#!/bin/sh
# Dense QP solvers read different triangles of the Hessian: of a matrix that has only one of them, as OSQP keeps it, each
# solves another problem without a word. quadprog 0.1.14 and PIQP 0.7.0 (dense) read the upper triangle, ProxQP of
# proxsuite 0.8.0 (dense) the lower one; DAQP 0.11.0 gives a third answer for an upper triangle, which is that of neither.
# So a Hessian stored as one triangle may not be handed on as it is, and which one is wanted cannot be told from an error.
#
# Fails as soon as one of them reads another triangle.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "quadprog==0.1.14" "piqp==0.7.0" "proxsuite==0.8.0" "daqp==0.11.0" "numpy==2.3.5"
"$folder/env/bin/python" - <<'PYTHON'
import daqp
import numpy as np
import piqp
import proxsuite
import quadprog

ROOM = np.full(2, 9.0)


def by_quadprog(hessian, target):
    return quadprog.solve_qp(hessian.copy(), -target)[0]


def by_piqp(hessian, target):
    solver = piqp.DenseSolver()
    solver.setup(hessian, target)
    solver.solve()
    return np.array(solver.result.x)


def by_proxqp(hessian, target):
    solver = proxsuite.proxqp.dense.QP(2, 0, 0, True)
    solver.init(hessian, target, l_box=-ROOM, u_box=ROOM)
    solver.solve()
    return np.array(solver.results.x)


def by_daqp(hessian, target):
    return daqp.solve(hessian.copy(), target, np.eye(2), ROOM, -ROOM, np.zeros(2, dtype=np.int32))[0]


target = np.array([-1.0, -1.0])
full = np.array([[2.0, 1.0], [1.0, 2.0]])
both, diagonal = np.linalg.solve(full, -target), -target / 2.0
for solve, upper, lower in (
    (by_quadprog, both, diagonal),
    (by_piqp, both, diagonal),
    (by_proxqp, diagonal, both),
    (by_daqp, np.full(2, 0.4), diagonal),
):
    answers = [solve(hessian, target) for hessian in (full, np.triu(full), np.tril(full))]
    print(f"{solve.__name__[3:]}: full {answers[0]}, upper triangle {answers[1]}, lower triangle {answers[2]}")
    for answer, expected in zip(answers, (both, upper, lower), strict=True):
        assert np.allclose(answer, expected, atol=1e-4)
PYTHON
