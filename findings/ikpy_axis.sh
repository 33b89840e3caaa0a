#!/bin/sh
# ikpy 4.2.1: a joint of a URDF whose axis is not a unit vector makes the arm grow or shrink as it turns.
# URDF asks for unit axes, and files with others are common: Pinocchio and MuJoCo, urdfdom's users and Drake scale them.
# ikpy puts the numbers into the formula of a turn as they are: an axis of "0 1 2" at 0.5 rad gives a "rotation" of
# determinant 2.86, the link beyond is 1.39 times as long as it is, and inverse kinematics finds angles of no such arm.
# The axis divided by its length is read well. Nothing is said in either case.
#
# Fails as soon as both axes turn the tip alike.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "ikpy==4.2.1" "pin==4.1.0" "numpy==2.3.5"
"$folder/env/bin/python" -W ignore - <<'PYTHON'
import pathlib
import tempfile

import numpy as np
import pinocchio as pin
from ikpy.chain import Chain

TEXT = """<robot name="arm"><link name="base"/><link name="arm"/><link name="tip"/>
<joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="{axis}"/>
<limit lower="-2" upper="2" effort="10" velocity="1"/></joint>
<joint name="end" type="fixed"><parent link="arm"/><child link="tip"/><origin xyz="1 0 0"/></joint></robot>"""


def tips(axis):
    """Poses of the tip at 0.5 rad by ikpy and by Pinocchio."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder, "arm.urdf")
        path.write_text(TEXT.format(axis=axis))
        chain = Chain.from_urdf_file(str(path), base_elements=["base"])
        model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.array([0.5]))
    return chain.forward_kinematics([0.0, 0.5, 0.0]), data.oMf[model.getFrameId("tip")].homogeneous


for axis, right in (("0 1 2", False), ("0 0.4472135954999579 0.8944271909999159", True)):
    ikpy, pinocchio = tips(axis)
    determinant = float(np.linalg.det(ikpy[:3, :3]))
    distance = float(np.abs(ikpy - pinocchio).max())
    print(f"axis {axis}: determinant {determinant:.4f}, arm {np.linalg.norm(ikpy[:3, 3]):.4f} m, {distance:.4f} from Pinocchio")
    assert (distance < 1e-9) == right and (abs(determinant - 1.0) < 1e-9) == right
PYTHON
