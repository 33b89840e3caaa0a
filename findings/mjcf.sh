#!/usr/bin/env bash
# MuJoCo 4.0: an actuator's `armature` on a ball joint ignores the axis that its gear names. A motor about y
# (gear="0 5 0") with a rotor of 0.1 kg m^2 adds nothing to the mass matrix, not gear^2 armature = 2.5 kg m^2 about y; the
# same motor about x adds 2.5 to all three axes. The page says that "the contributed value is scaled by gear squared".
# The same holds for `damping` of an actuator. For hinges and slides it is as one expects.
#
# Runs public packages alone, in a folder of its own; exits with 1 where the behaviour is another one.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "mujoco-core==4.0.0" "numpy==2.4.6"
cd "$folder"
"$folder/venv/bin/python" - <<'PY'
import mujoco
import numpy as np

XML = """<mujoco><option><flag gravity="disable"/></option><worldbody><body><joint name="j" type="{kind}"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>
<actuator><motor joint="j" gear="{gear}" armature=".1" damping=".2"/></actuator></mujoco>"""


def added(kind, gear):
    """What the actuator adds to the diagonal of the mass matrix, and its damping force at a velocity of 1."""
    model = mujoco.MjModel.from_xml_string(XML.format(kind=kind, gear=gear))
    data = mujoco.MjData(model)
    data.qvel[:] = 1.0
    mujoco.mj_forward(model, data)
    diagonal = []
    for column in np.eye(model.nv):
        out = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, out, column)
        diagonal.append(out @ column - 1.0)
    return np.round(diagonal, 9).tolist(), np.round(-data.qfrc_damper, 9).tolist()


seen = {
    "hinge, gear 5": added("hinge", "5"),
    "ball, gear 5 about x": added("ball", "5 0 0"),
    "ball, gear 5 about y": added("ball", "0 5 0"),
}
expected = {
    "hinge, gear 5": ([2.5], [5.0]),
    "ball, gear 5 about x": ([2.5, 2.5, 2.5], [5.0, 5.0, 5.0]),
    "ball, gear 5 about y": ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
}
print("MuJoCo", mujoco.__version__)
for name, (armature, damping) in seen.items():
    print(f"{name}: adds {armature} kg m^2 to the mass matrix, damps with {damping} N m at 1 rad/s")
if seen != expected:
    raise SystemExit(f"another behaviour than when this was written: {expected}")
print("as written: the axis of the gear does not matter, and its first number alone scales armature and damping")
PY
