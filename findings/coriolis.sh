#!/usr/bin/env bash
# Pinocchio 4.1.0: of a model with mimic joints computeCoriolisMatrix gives a matrix that is wrong, and says nothing.
# Models read with mimic=True have one velocity for both joints. rnea, crba, nonLinearEffects, Jacobians and their time
# variation are right there to the last digit; aba, computeMinverse, dccrba, energies and all derivatives refuse ("This
# algorithm does not support Joint Mimic"). The Coriolis matrix is the exception: C(q, v) v is another torque than the
# one of nonLinearEffects less gravity, which controllers of passivity (Slotine and Li) and observers of momentum need.
# Reference: the same robot without mimic, its matrix between the map of velocities.
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

LINK = """<link name="{}"><inertial><origin xyz="{}"/><mass value="{}"/>
<inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><origin xyz="{}"/><axis xyz="{}"/>
<limit effort="1" velocity="1" lower="-2" upper="2"/>{}</joint>"""
TEXT = '<robot name="r"><link name="a"/>' + LINK.format("b", ".1 .2 .3", 2) + LINK.format("c", ".3 .1 0", 1)
TEXT += LINK.format("d", ".2 .1 .1", 1) + JOINT.format("j", "a", "b", "0 0 .1", "0 1 0", "")
TEXT += JOINT.format("k", "b", "c", ".2 0 .1", "0 0 1", "")
TEXT += JOINT.format("l", "c", "d", ".2 .3 .1", "1 0 0", '<mimic joint="j" multiplier="-2" offset=".3"/>') + "</robot>"

print("Pinocchio", pin.__version__)
coupled, free = pin.buildModelFromXML(TEXT, mimic=True), pin.buildModelFromXML(TEXT)
there, here = coupled.createData(), free.createData()
both = np.array([[1.0, 0.0], [0.0, 1.0], [-2.0, 0.0]])
q, v = np.array([0.3, 0.5]), np.array([0.7, -0.4])
full_q, full_v = both @ q + [0.0, 0.0, 0.3], both @ v
want = both.T @ pin.computeCoriolisMatrix(free, here, full_q, full_v) @ full_v
exact = pin.nonLinearEffects(coupled, there, q, v) - pin.computeGeneralizedGravity(coupled, there, q)
got = pin.computeCoriolisMatrix(coupled, there, q, v) @ v
print("C v by nonLinearEffects:", exact, "by the robot without mimic:", want, "by computeCoriolisMatrix:", got)
refused = 0
for call in (pin.computeMinverse, pin.computePotentialEnergy, pin.computeGeneralizedGravityDerivatives):
    try:
        call(coupled, there, q)
    except Exception as error:
        refused += "Mimic" in str(error)
print("refused by name:", refused, "of 3 others")
right = np.allclose(want, exact, atol=1e-12) and refused == 3
raise SystemExit(0 if right and np.abs(got - exact).max() > 0.1 else 1)
PYTHON
echo "as described"
