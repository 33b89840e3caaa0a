#!/bin/sh
# Drake 1.51.1: a body of an MJCF file with two joints or more turns about the wrong point, and nothing is said.
# MuJoCo puts all joints of a body at the body's own place. Drake's parser puts a body between two joints where the parent
# is, so the first joint turns about the parent's origin and the body's `pos` comes after it: a body at 0.3 m with a
# shoulder of two hinges is off by 0.206 m at 0.7 rad and 0.2 rad. Turns are right, and so is a body at the parent's origin,
# or whose first joint stands at 0. Hips, shoulders and planar bases of MJCF files are written in this way.
#
# Fails as soon as both readers agree.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "drake==1.51.1" "mujoco==4.0.0" "numpy==2.3.5"
"$folder/env/bin/python" - <<'PYTHON'
import pathlib
import tempfile

import mujoco
import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

TEXT = """<mujoco model="arm"><compiler angle="radian"/><worldbody><body name="arm" pos="0 0 {height}">
{joints}<geom type="box" size="0.05 0.05 0.2" mass="2"/></body></worldbody></mujoco>"""
FIRST, SECOND = '<joint name="pitch" axis="0 1 0"/>', '<joint name="roll" axis="1 0 0"/>'


def apart(joints, height, q):
    """Distance in metres and turn between the poses of the body in both readers."""
    text = TEXT.format(joints=joints, height=height)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder, "arm.xml")
        path.write_text(text)
        plant = MultibodyPlant(0.0)
        Parser(plant).AddModels(str(path))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    pose = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName("arm"))
    turn = np.abs(pose.rotation().matrix() - data.xmat[1].reshape(3, 3)).max()
    return float(np.linalg.norm(pose.translation() - data.xpos[1])), float(turn)


cases = {
    "one joint": (FIRST, 0.3, [0.7]),
    "two joints": (FIRST + SECOND, 0.3, [0.7, 0.2]),
    "two joints, first at 0": (FIRST + SECOND, 0.3, [0.0, 0.2]),
    "two joints, at the parent": (FIRST + SECOND, 0.0, [0.7, 0.2]),
}
for name, case in cases.items():
    distance, turn = apart(*case)
    print(f"{name}: {distance:.3f} m apart, turn {turn:.1e}")
    assert turn < 1e-12, name
    wrong = name == "two joints"
    assert (distance > 0.2) == wrong and (distance < 1e-12) == (not wrong), name
PYTHON
