#!/bin/sh
# CasADi 3.8.2: what is left of a vector after its last element is a column of no rows, but of a vector of one element it
# is a row of no columns. x[n:] and x[[]] have the shape (0, 1) for every n x 1 of two elements or more and (1, 0) for
# 1 x 1, in DM, SX and MX alike, as a single element counts as a row, too. So a recursion over joints that works for
# every robot stops at the last one: differences and products with the rest raise for a dimension mismatch, and sum1 of
# it has the shape (1, 0) instead of (1, 1). x[n:, 0] is a column always.
#
# Fails as soon as both have the same shape.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "casadi==3.8.2" "numpy==2.3.5"
"$folder/env/bin/python" - <<'PYTHON'
import casadi as ca

print("CasADi", ca.__version__)
for kind, make in (("DM", ca.DM.ones), ("SX", ca.SX.ones), ("MX", ca.MX.ones)):
    rests = {n: make(n)[n:] for n in (1, 2, 3)}
    print(kind, {n: rest.shape for n, rest in rests.items()}, "sum1:", {n: ca.sum1(rest).shape for n, rest in rests.items()})
    assert rests[2].shape == rests[3].shape == make(1)[1:, 0].shape == (0, 1)
    assert rests[1].shape == (1, 0)
    assert ca.sum1(rests[2]).shape == (1, 1) and ca.sum1(rests[1]).shape == (1, 0)
    (rests[2] - make(0, 1)).shape
    try:
        rests[1] - make(0, 1)
    except RuntimeError as error:
        print("  a difference:", str(error).splitlines()[-1].split("hpp:")[-1])
    else:
        raise AssertionError("no error")
PYTHON
