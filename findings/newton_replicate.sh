#!/bin/sh
# Newton 1.8.0: what stands inside <replicate> of an MJCF file is not in the robot, and nothing is said.
# MuJoCo makes as many copies of the element's content as it asks for: pins of a gripper, links of a chain, wheels of a
# roller. Newton's reader knows <frame> and leaves <replicate> out, so that the geoms in it weigh nothing and collide with
# nothing, and bodies and joints in it do not exist: a model of four joints has one. A file without it agrees to 1e-6.
#
# Fails as soon as replicated geoms or bodies are read, or the plain file ceases to agree.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "newton==1.8.0" "warp-lang==1.19.0" "mujoco==4.0.0"
"$folder/env/bin/python" - <<'PYTHON'
import warnings

import mujoco
import newton
import warp

warp.config.quiet = True
FILE = """<mujoco><worldbody><body name="palm"><joint axis="0 1 0"/><geom size="0.05"/>{more}</body></worldbody></mujoco>"""
COPIES = '<replicate count="3" offset="0.1 0 0">{what}</replicate>'
PIN = '<geom size="0.03"/>'
FINGER = f'<body><joint type="slide"/>{PIN}</body>'

for name, more, agrees in (
    ("nothing replicated", "", True),
    ("geoms replicated", COPIES.format(what=PIN), False),
    ("bodies replicated", COPIES.format(what=FINGER), False),
):
    text = FILE.format(more=more)
    model = mujoco.MjModel.from_xml_string(text)
    builder = newton.ModelBuilder()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        builder.add_mjcf(text)
    mass, joints = sum(builder.body_mass), builder.joint_count
    print(f"{name}: MuJoCo {model.body_mass.sum():.4f} kg, {model.njnt} joints; Newton {mass:.4f} kg, {joints}; said: {len(said)}")
    same = abs(mass - model.body_mass.sum()) < 1e-6 and joints == model.njnt
    assert same == agrees and not said
PYTHON
