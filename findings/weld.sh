#!/usr/bin/env bash
# MuJoCo 4.0: the residual of a weld, twice not what its attributes suggest.
# 1. `relpose` is "the relative pose of body2 relative to body1", but with an `anchor` beside it that pose is not the one
#    that is held: with relpose="1 0 0 1 0 0 0" and anchor=".1 .2 0", and body2 exactly 1 m along x of body1, the residual
#    is (-0.1, -0.2, 0). relpose's position is where body1 has the anchor, and not body2's origin.
# 2. The rotational rows are sin(angle / 2) about the axis, not an angle: 0.84 for 2 rad, and beyond half a turn they get
#    less again, 0.14 for 6 rad. Who reads `efc_pos` as radians is off by half at least, and cannot tell 0.28 from 6 rad.
#
# Runs public packages alone, in a folder of its own; exits with 1 where the behaviour is another one.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check mujoco==4.0.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import mujoco
import numpy as np

TEXT = """<mujoco><compiler angle="radian"/><worldbody>
<body name="a"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint axis="0 0 1"/></body>
<body name="b" pos="1 0 0"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint axis="0 0 1"/></body>
</worldbody><equality><weld body1="a" body2="b" {}/></equality></mujoco>"""


def residual(attributes, angle=0.0):
    model = mujoco.MjModel.from_xml_string(TEXT.format(attributes))
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0, angle
    mujoco.mj_forward(model, data)
    return np.array(data.efc_pos)


print("mujoco", mujoco.__version__)
plain = residual('relpose="1 0 0 1 0 0 0"')
beside = residual('relpose="1 0 0 1 0 0 0" anchor=".1 .2 0"')
print("relpose alone:", plain.round(6), "and with an anchor:", beside.round(6))
turned = {angle: float(residual('relpose="1 0 0 1 0 0 0"', angle)[5]) for angle in (0.1, 1.0, 2.0, 3.0, 6.0)}
print("rotational row by angle [rad]:", {angle: round(row, 4) for angle, row in turned.items()})
same = (
    np.allclose(plain, 0.0, atol=1e-12)
    and np.allclose(beside, [-0.1, -0.2, 0.0, 0.0, 0.0, 0.0], atol=1e-12)
    and all(abs(row + np.sin(angle / 2.0)) < 1e-12 for angle, row in turned.items())
)
raise SystemExit(0 if same else 1)
PYTHON
echo "as described"
