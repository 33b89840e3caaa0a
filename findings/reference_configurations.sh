#!/usr/bin/env bash
# example-robot-data 6.0.0: reference configurations of its SRDF files that the same robot's URDF does not allow. Who
# starts a controller or a planner there starts outside of joint limits, by up to a radian: "half_sitting" of the simple
# humanoid has knee and ankles beyond their ends, "arm_up" of the Kinova arm has joint 3 a whole turn below its range,
# and "standing" of ANYmal with that arm has three joints of the arm at 0, where their ranges begin at 0.33 to 0.82 rad.
# Pinocchio loads all without a word.
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

import pinocchio as pin

share = pathlib.Path(site.getsitepackages()[0]) / "cmeel.prefix/share/example-robot-data/robots"
CASES = (  # URDF, SRDF, its configuration, floating base, joints beyond their limits
    ("simple_humanoid_description/urdf/simple_humanoid.urdf", "simple_humanoid.srdf", "half_sitting", True, 4),
    ("kinova_description/robots/kinova.urdf", "kinova.srdf", "arm_up", False, 1),
    ("anymal_b_simple_description/robots/anymal-kinova.urdf", "anymal.srdf", "standing", True, 3),
)
print("Pinocchio", pin.__version__)
same = True
for urdf, srdf, name, floats, count in CASES:
    base = [pin.JointModelFreeFlyer()] if floats else []
    model = pin.buildModelFromUrdf(str(share / urdf), *base)
    (place,) = (share / urdf.split("/")[0]).rglob(srdf)
    pin.loadReferenceConfigurations(model, str(place), False)
    q, beyond = model.referenceConfigurations[name], {}
    for joint in range(1, model.njoints):
        k = model.joints[joint].idx_q
        low, high = model.lowerPositionLimit[k], model.upperPositionLimit[k]
        if model.joints[joint].nq == 1 and not low <= q[k] <= high:
            beyond[model.names[joint]] = (round(float(q[k]), 3), round(float(low), 3), round(float(high), 3))
    print(srdf, name, "value, lower, upper:", beyond)
    same &= len(beyond) == count
raise SystemExit(0 if same else 1)
PYTHON
echo "as described"
