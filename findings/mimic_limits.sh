#!/usr/bin/env bash
# Pinocchio 4.1.0: limits of a joint with <mimic> are gone where the URDF is read with mimic=True. The joint that leads
# keeps its own range, speed and effort; those of the one that follows are neither kept nor divided by the multiplier.
# With leader +-2 rad and 1 rad/s, and a follower of the same limits and multiplier -2, all of the model's limits hold
# while the follower is at -4 rad and runs at 2 rad/s; randomConfiguration draws such places.
#
# Runs public packages alone, in a folder of its own; exits with 1 where the behaviour is another one.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pin==4.1.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
import pinocchio as pin

JOINT = """<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><axis xyz="0 0 1"/>
<limit effort="1" velocity="1" lower="-2" upper="2"/>{}</joint>"""
TEXT = '<robot name="r"><link name="a"/><link name="b"/><link name="c"/>' + JOINT.format("lead", "a", "b", "")
TEXT += JOINT.format("follow", "b", "c", '<mimic joint="lead" multiplier="-2" offset="0"/>') + "</robot>"

print("Pinocchio", pin.__version__)
model = pin.buildModelFromXML(TEXT, mimic=True)
data = model.createData()
print("ranges", model.lowerPositionLimit, model.upperPositionLimit, "speeds", model.velocityLimit)
pin.seed(0)
beyond = 0
for _ in range(100):
    q = pin.randomConfiguration(model)
    pin.forwardKinematics(model, data, q)
    leads, follows = (data.oMi[model.getJointId(name)].rotation for name in ("lead", "follow"))
    assert np.allclose(leads.T @ follows, pin.exp3(np.array([0.0, 0.0, -2.0 * q[0]])), atol=1e-12)
    beyond += abs(-2.0 * q[0]) > 2.0
print("random configurations with the follower beyond its range:", beyond, "of 100")
kept = model.nq == 1 and model.upperPositionLimit[0] == 2.0 and model.velocityLimit[0] == 1.0
raise SystemExit(0 if kept and 30 < beyond < 70 else 1)
PYTHON
echo "as described"
