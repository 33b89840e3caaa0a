#!/usr/bin/env bash
# pin-pink 4.4.0: a joint that its model holds still is the one joint that Pink's limits let go. ConfigurationLimit makes
# rows of joints whose upper limit is above the lower one, VelocityLimit of joints whose speed limit is above 0: a range
# of 0, or a speed of 0, is taken as "has no limit". An arm whose wrist is locked in its URDF (lower = upper = 0,
# velocity = 0) gets rows for its other joints alone, and a step of solve_ik turns the wrist, with both limits given and no
# word; nor do the checks before the next step notice, which look at joints with a range only: it goes on from there.
#
# Fails as soon as such a joint is held, or refused before it is moved.
# Runs public packages alone, in a folder of its own; exits with 1 where the behaviour is another one.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pin-pink==4.4.0 pin==4.1.0 quadprog==0.1.14
"$folder/venv/bin/python" - <<'PYTHON'
from importlib import metadata

import numpy as np
import pink
import pinocchio as pin
from pink.limits import ConfigurationLimit, VelocityLimit
from pink.tasks import FrameTask

NAMES = ["shoulder", "elbow", "wrist"]
LIMITS = ['lower="-2" upper="2" velocity="3"'] * 2 + ['lower="0" upper="0" velocity="0"']
links = "".join(f'<link name="link{k}"/>' for k in range(4))
joints = "".join(
    f'<joint name="{name}" type="revolute"><parent link="link{k}"/><child link="link{k + 1}"/>'
    f'<origin xyz="{0.3 * (k > 0)} 0 0"/><axis xyz="0 0 1"/><limit {limit} effort="10"/></joint>'
    for k, (name, limit) in enumerate(zip(NAMES, LIMITS))
)
tip = '<link name="tip"/><joint name="end" type="fixed"><parent link="link3"/><child link="tip"/><origin xyz="0.3 0 0"/></joint>'
model = pin.buildModelFromXML(f'<robot name="arm">{links}{joints}{tip}</robot>')
print("pin-pink", metadata.version("pin-pink"), "Pinocchio", pin.__version__)
print("ranges", model.lowerPositionLimit, model.upperPositionLimit, "speeds", model.velocityLimit)

limits = [ConfigurationLimit(model), VelocityLimit(model)]
held = [[model.names[model.joints.tolist().index(joint)] for joint in each.joints] for each in limits]
print("joints with a row: of positions", held[0], "of speeds", held[1])
task = FrameTask("tip", position_cost=1.0, orientation_cost=1.0)
configuration = pink.Configuration(model, model.createData(), np.array([0.3, 0.5, 0.0]))
task.set_target(configuration.get_transform_frame_to_world("tip") * pin.SE3(pin.utils.rotate("z", 1.0), np.zeros(3)))
v = pink.solve_ik(configuration, [task], 0.01, solver="quadprog", limits=limits)
configuration.integrate_inplace(v, 0.01)
print("speed of the wrist", v[2], "rad/s, where it then is", configuration.q[2], "rad")
pink.solve_ik(configuration, [task], 0.01, solver="quadprog", limits=limits, safety_break=True)
print("a step from there, with its check of limits: taken")
same = held == [NAMES[:2], NAMES[:2]] and abs(v[2]) > 1.0
raise SystemExit(0 if same else 1)
PYTHON
echo "as described"
