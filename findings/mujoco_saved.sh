#!/bin/sh
# MuJoCo 4.0.0: XML that it writes (MjSpec.to_xml, mj_saveLastXML) has six significant digits, so what is read again is
# another robot. An arm of seven links of 0.3123456789 m along two axes ends micrometres from where it did, masses are off
# by 1.7e-6 and axes by 4e-7 of themselves, and so are torques. The same spec handed to compile() has all digits. Whoever
# edits a robot by MjSpec and keeps the text must not expect the same kinematics, nor torques equal to more than six digits.
#
# Fails as soon as a saved model has all its digits.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "mujoco==4.0.0" "numpy==2.3.5"
"$folder/env/bin/python" - <<'PYTHON'
import pathlib
import tempfile

import mujoco
import numpy as np

spec = mujoco.MjSpec()
body = spec.worldbody
for k in range(7):
    body = body.add_body(name=f"link{k}", pos=[0.3123456789, 0.0, 0.3123456789])
    body.add_joint(name=f"joint{k}", axis=[1.0, 2.0, 3.0])
    body.add_geom(size=[0.05, 0.0, 0.0], mass=1.23456789)
own = spec.compile()

text = spec.to_xml()
with tempfile.TemporaryDirectory() as folder:
    path = pathlib.Path(folder, "arm.xml")
    path.write_text(text)
    mujoco.mj_saveLastXML(str(pathlib.Path(folder, "again.xml")), mujoco.MjModel.from_xml_path(str(path)))
    twice = mujoco.MjModel.from_xml_path(str(pathlib.Path(folder, "again.xml")))
saved = mujoco.MjModel.from_xml_string(text)


def tip(model):
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data.xpos[-1].copy(), data.qfrc_bias.copy()


(place, bias), (place_saved, bias_saved) = tip(own), tip(saved)
moved = np.linalg.norm(place - place_saved)
mass = abs(own.body_mass[1] - saved.body_mass[1]) / own.body_mass[1]
axis = np.abs(own.jnt_axis - saved.jnt_axis).max()
print(f"written: {[line.strip() for line in text.splitlines() if 'link0' in line][0]}")
print(f"tip moved by {moved:.1e} m, mass off by {mass:.1e} of itself, axes by {axis:.1e}")
print(f"torques under gravity off by {np.abs(bias - bias_saved).max() / np.abs(bias).max():.1e} of the largest")
assert 1e-6 < moved < 1e-5 and 1e-7 < mass < 1e-5 and axis > 1e-8
assert np.array_equal(saved.body_pos, twice.body_pos), "rounded once, it stays"
PYTHON
