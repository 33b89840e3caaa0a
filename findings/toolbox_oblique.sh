#!/bin/sh
# Robotics Toolbox for Python 1.1.1: a URDF whose joint turns about an oblique axis is read as another arm.
# For an axis along x, y or z the reader makes a turn about that axis. For any other it turns the joint's own frame until
# its z lies along the axis, and does not turn back afterwards: the link's frame is no longer the file's, and all that is
# fixed to that link (the next joint's origin and axis, tools, masses) stands in a turned frame. No warning. An arm of two
# joints with the first axis at (0.6, 0, 0.8) has its last link 0.26 m beside the place where yourdfpy has it at angles
# 0; with the axis at (0, 0, 1) both agree.
#
# Fails as soon as the two agree on the oblique axis, or cease to on the upright one.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "roboticstoolbox-python==1.1.1" "spatialgeometry==1.1.0" "spatialmath-python==1.1.18" \
    "numpy==1.26.4" "yourdfpy==0.0.60"
cd "$folder"
"$folder/env/bin/python" -W ignore - <<'PYTHON'
from pathlib import Path

import numpy as np
import roboticstoolbox
import yourdfpy

FILE = """<robot name="arm"><link name="base"/><link name="upper"/><link name="fore"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.1"/>
<axis xyz="{axis}"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.3 0.2 0.1"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint></robot>"""


def apart(axis, q):
    """Distance [m] between the two libraries' places of the last link at the angles q [rad]."""
    path = Path("arm.urdf").resolve()
    path.write_text(FILE.format(axis=axis))
    toolbox = roboticstoolbox.Robot.URDF(str(path)).fkine(q).A
    robot = yourdfpy.URDF.load(str(path))
    robot.update_cfg(q)
    return float(np.linalg.norm(toolbox[:3, 3] - robot.get_transform("fore")[:3, 3]))


for q in ([0.0, 0.0], [0.5, -0.9]):
    upright, oblique = apart("0 0 1", q), apart("0.6 0 0.8", q)
    print(f"angles {q}: upright axis {upright:.6f} m apart, oblique axis {oblique:.3f} m apart")
    assert upright < 1e-9 and oblique > 0.05
PYTHON
