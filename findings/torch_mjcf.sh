#!/bin/sh
# pytorch_kinematics 0.10.0: MJCF joints with a "pos" or a "ref" make another robot than MuJoCo's, without a warning.
# In MJCF a joint's pos is a point of the body that the axis runs through: it moves no body at the reference angle. Here the
# body is moved to that point and not back, so that all bodies behind stand beside their place at every angle; and ref (the
# angle at which the file draws the body) is left out, so that all angles are off by it. Files without both agree with
# MuJoCo to 1e-6 m. (With MuJoCo 4.0.0 no file is read: its types of joints are plain integers there, KeyError.)
#
# Fails as soon as one of the two is read as MuJoCo reads it, or plain files cease to agree.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "pytorch_kinematics==0.10.0" "mujoco==3.3.7" "numpy==1.26.4"
"$folder/env/bin/python" -W ignore - <<'PYTHON'
import mujoco
import numpy as np
import pytorch_kinematics
import torch

FILE = """<mujoco><compiler angle="radian"/><worldbody><body name="upper" pos="0 0 0.1">
<joint name="shoulder" axis="0 1 0" {more}/><geom size="0.05"/>
<body name="fore" pos="0 0 0.5"><joint name="elbow" axis="1 0 0"/><geom size="0.02"/></body></body></worldbody></mujoco>"""
ANGLES = [0.3, 0.4]
"""Angles of both joints [rad]."""

for more, agrees in (("", True), ('pos="0 0 0.2"', False), ('ref="0.3"', False)):
    text = FILE.format(more=more)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = ANGLES
    mujoco.mj_kinematics(model, data)
    places = pytorch_kinematics.build_chain_from_mjcf(text).forward_kinematics(torch.tensor([ANGLES]))
    apart = float(np.linalg.norm(places["fore"].get_matrix()[0, :3, 3].numpy() - data.body("fore").xpos))
    print(f"joint with {more or 'neither'}: {apart:.6f} m apart")
    assert (apart < 1e-6) if agrees else (apart > 0.05)
PYTHON
