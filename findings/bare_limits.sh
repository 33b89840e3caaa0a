#!/usr/bin/env bash
# example-robot-data 6.0.0, Pinocchio 4.1.0, MuJoCo 4.0.0: a <limit> without lower and upper locks a joint in one reader
# and frees it in the other. URDF's default for both is 0. The knees of the catalogue's "quadruped" and the wheels
# of Centauro are revolute joints that name effort and velocity only: Pinocchio gives them the range 0 to 0, so that every
# solver with its limits holds them still, and random configurations never bend them; MuJoCo compiles the same file to
# joints without limits. Neither says a word. A gait tuned in one of the two does not exist in the other.
#
# Runs public packages alone, in a folder of its own; exits with 1 where the behaviour is another one.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
    example-robot-data==6.0.0 pin==4.1.0 mujoco==4.0.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import pathlib
import site
import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np
import pinocchio as pin

share = pathlib.Path(site.getsitepackages()[0]) / "cmeel.prefix/share/example-robot-data/robots"
print("Pinocchio", pin.__version__, "MuJoCo", mujoco.__version__)
same = True
for file, joints in (
    ("quadruped_description/urdf/quadruped.urdf", ["FL_KFE", "FR_KFE", "BL_KFE", "BR_KFE"]),
    ("centauro_description/urdf/centauro.urdf", ["j_wheel_1", "j_wheel_2", "j_wheel_3", "j_wheel_4"]),
):
    robot = ElementTree.parse(share / file).getroot()
    for link in robot.iter("link"):
        for drawn in link.findall("visual") + link.findall("collision"):
            link.remove(drawn)
    for joint in robot.iter("joint"):
        if joint.get("name") in joints:
            print(joint.get("name"), joint.get("type"), joint.find("limit").attrib)
            same &= "lower" not in joint.find("limit").attrib
    text = ElementTree.tostring(robot, encoding="unicode")
    model, compiled = pin.buildModelFromXML(text), mujoco.MjModel.from_xml_string(text)
    at = [model.joints[model.getJointId(name)].idx_q for name in joints]
    drawn = np.array([pin.randomConfiguration(model)[at] for _ in range(100)])
    limited = [int(compiled.joint(name).limited[0]) for name in joints]
    print("ranges by Pinocchio", model.lowerPositionLimit[at], model.upperPositionLimit[at], "limited by MuJoCo", limited)
    same &= not model.lowerPositionLimit[at].any() and not model.upperPositionLimit[at].any()
    same &= not drawn.any() and limited == [0] * 4
raise SystemExit(0 if same else 1)
PYTHON
echo "as described"
