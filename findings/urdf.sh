#!/bin/sh
# Pinocchio 4.1.0: appendModel keeps damping, dry friction, limits and rotor inertia of the model that is put on a base,
# but sets its armature to 0 and takes gravity from the other model, which is 9.81 m/s^2 of a fresh one. So the mass
# matrix and all torques of the same robot on a free flyer differ from those of the robot alone. Nothing is said.
#
# Fails as soon as one of the two is kept.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "pin==4.1.0" "numpy==2.3.5"
"$folder/env/bin/python" - <<'PYTHON'
import numpy as np
import pinocchio as pin

arm = pin.Model()
turn = arm.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "turn")
arm.addJointFrame(turn)
arm.appendBodyToJoint(turn, pin.Inertia(1.0, np.array([0.0, 0.5, 0.0]), 0.01 * np.eye(3)), pin.SE3.Identity())
arm.armature, arm.damping, arm.rotorInertia = np.array([0.3]), np.array([0.2]), np.array([0.1])
arm.gravity = pin.Motion(np.array([0.0, 0.0, -1.62]), np.zeros(3))

base = pin.Model()
free = base.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root_joint")
base.addJointFrame(free)
whole = pin.appendModel(base, arm, base.getFrameId("root_joint"), pin.SE3.Identity())

alone = pin.crba(arm, arm.createData(), pin.neutral(arm))[0, 0]
carried = pin.crba(whole, whole.createData(), pin.neutral(whole))[6, 6]
print("Pinocchio", pin.__version__)
print("damping", arm.damping, "->", whole.damping[6:], " rotor inertia", arm.rotorInertia, "->", whole.rotorInertia[6:])
print("armature", arm.armature, "->", whole.armature[6:], " mass matrix of the joint", alone, "->", carried)
print("gravity", arm.gravity.linear, "->", whole.gravity.linear)
assert whole.damping[6] == 0.2 and whole.rotorInertia[6] == 0.1
assert whole.armature[6] == 0.0 and np.isclose(alone - carried, 0.3)
assert np.array_equal(whole.gravity.linear, [0.0, 0.0, -9.81])
PYTHON
