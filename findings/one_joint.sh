#!/bin/sh
# Pinocchio 4.1.0 (Python): of a model with one degree of freedom Jacobians are vectors and not matrices of one column.
# computeFrameJacobian, computeJointJacobians, their time variations and ccrba give arrays of shape (6,),
# jacobianCenterOfMass of (3,), where a model of two joints has (6, 2) and (3, 2). crba, computeMinverse and the
# derivatives of rnea of the same model are (1, 1). J[:, k] works for every robot but a single joint, and of that one
# J @ J.T, meant to be 6 x 6, is a number without an error.
#
# Fails as soon as a Jacobian of one joint is (6, 1).
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "pin==4.1.0" "numpy==2.3.5"
"$folder/env/bin/python" - <<'PYTHON'
import numpy as np
import pinocchio as pin


def shapes(joints):
    model, last = pin.Model(), 0
    for k in range(joints):
        last = model.addJoint(last, pin.JointModelRX(), pin.SE3.Identity(), f"joint{k}")
        model.appendBodyToJoint(last, pin.Inertia.Random(), pin.SE3.Identity())
    tip = model.addFrame(pin.Frame("tip", last, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    data, q, v = model.createData(), np.zeros(joints), np.ones(joints)
    made = {
        "computeFrameJacobian": pin.computeFrameJacobian(model, data, q, tip, pin.LOCAL),
        "computeJointJacobians": pin.computeJointJacobians(model, data, q),
        "computeJointJacobiansTimeVariation": pin.computeJointJacobiansTimeVariation(model, data, q, v),
        "jacobianCenterOfMass": pin.jacobianCenterOfMass(model, data, q),
        "ccrba": pin.ccrba(model, data, q, v),
        "crba": pin.crba(model, data, q),
        "computeMinverse": pin.computeMinverse(model, data, q),
    }
    return {name: array.shape for name, array in made.items()}, made["computeFrameJacobian"]


print("Pinocchio", pin.__version__)
(one, jacobian), (two, _) = shapes(1), shapes(2)
for name in one:
    print(f"{name}: {one[name]} of one joint, {two[name]} of two")
assert two["computeFrameJacobian"] == (6, 2) and two["jacobianCenterOfMass"] == (3, 2)
assert one["crba"] == one["computeMinverse"] == (1, 1)
print("J @ J.T has the shape", (jacobian @ jacobian.T).shape)
assert one["computeFrameJacobian"] == (6,) and one["jacobianCenterOfMass"] == (3,)
assert (jacobian @ jacobian.T).shape == ()
PYTHON
