#!/usr/bin/env bash
# Pinocchio 4.1.0 and example-robot-data 6.0.0: forward dynamics of two robots of the catalogue is NaN, without an error.
# In romeo.urdf 24 joints of fingers, and in romeo_laas_small.urdf both grippers, move links that have no mass, so a
# diagonal of the mass matrix is 0: aba fills the accelerations of all joints with NaN or infinity, also those far from
# the hand. computeMinverse does the same. The other Romeo (romeo_small) and the other humanoids are finite.
#
# Runs public packages alone, in a folder of its own; exits with 1 where the behaviour is another one.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check example-robot-data==6.0.0 pin==4.1.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import pathlib
import site

import numpy as np
import pinocchio as pin

share = pathlib.Path(site.getsitepackages()[0]) / "cmeel.prefix/share/example-robot-data/robots"
print("Pinocchio", pin.__version__)
same = True
for name, massless in (("romeo", 24), ("romeo_laas_small", 2), ("romeo_small", 0)):
    model = pin.buildModelFromUrdf(str(share / f"romeo_description/urdf/{name}.urdf"), pin.JointModelFreeFlyer())
    data, q, zero = model.createData(), pin.neutral(model), np.zeros(model.nv)
    none = int((np.diag(pin.crba(model, data, q)) < 1e-12).sum())
    acceleration = pin.aba(model, data, q, zero, zero)
    lost = int((~np.isfinite(acceleration)).sum())
    print(f"{name}: {none} joints without inertia, {lost} of {model.nv} accelerations not finite")
    same &= none == massless and (lost > 0) == (massless > 0)
raise SystemExit(0 if same else 1)
PYTHON
echo "as described"
