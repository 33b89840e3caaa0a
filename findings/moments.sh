#!/usr/bin/env bash
# example-robot-data 6.0.0, Pinocchio 4.1.0, MuJoCo 4.0.0: links of well-known robots of the catalogue have moments of
# inertia that no body has. The Allegro hand, PR2, a Romeo, ANYmal C and Alex break the triangle inequality (the largest
# principal moment is more than the sum of the other two); the other Romeo's torso has a principal moment of -0.021 kg m^2,
# two antennas of TIAGo's base one of -3.5e-8. Pinocchio takes all of them and computes with them, without a word; MuJoCo
# refuses the same files.
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
for file, kind in (
    ("allegro_hand_description/urdf/allegro_right_hand.urdf", "triangle"),
    ("pr2_description/urdf/pr2.urdf", "triangle"),
    ("romeo_description/urdf/romeo_small.urdf", "triangle"),
    ("anymal_c_simple_description/urdf/anymal.urdf", "triangle"),
    ("alex_description/urdf/alex_psyonic_hands.urdf", "triangle"),
    ("romeo_description/urdf/romeo_laas_small.urdf", "negative"),
    ("tiago_description/robots/tiago.urdf", "negative"),
    ("panda_description/urdf/panda.urdf", ""),
):
    robot = ElementTree.parse(share / file).getroot()
    worst = {"triangle": 0.0, "negative": 0.0}
    for link in robot.iter("link"):
        for drawn in link.findall("visual") + link.findall("collision"):
            link.remove(drawn)
        if (given := link.find("inertial/inertia")) is not None:
            xx, yy, zz, xy, xz, yz = (float(given.get(k, "0")) for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
            least, middle, most = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            worst["negative"] = min(worst["negative"], least)
            if least > 0.0:
                worst["triangle"] = max(worst["triangle"], most / (least + middle))
    text = ElementTree.tostring(robot, encoding="unicode")
    joints = pin.buildModelFromXML(text).njoints
    try:
        mujoco.MjModel.from_xml_string(text)
        said = "compiles"
    except ValueError as error:
        said = str(error).splitlines()[0]
    print(f"{pathlib.Path(file).stem}: most / (least + middle) up to {worst['triangle']:.3f}, least {worst['negative']:.2g}")
    print(f"    Pinocchio {joints} joints; MuJoCo: {said}")
    refused = {"triangle": "A + B >= C", "negative": "positive eigenvalues", "": "compiles"}[kind]
    same &= refused in said and (not kind or (worst["triangle"] > 1.001 if kind == "triangle" else worst["negative"] < 0.0))
raise SystemExit(0 if same else 1)
PYTHON
echo "as described"
