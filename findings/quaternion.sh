#!/bin/sh
# urdfdom 6.0.0 (in Pinocchio 4.1.0): <origin quat_xyzw="..."> turns a joint only in files whose <robot> has
# version="1.1" or more. Without a version, which is how nearly all files are, or with 1.0, the attribute is dropped
# without a word and the joint is not turned. In 1.0 even numbers that are none pass.
#
# Fails as soon as it is read, refused or said.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "pin==4.1.0" "numpy==2.3.5"
"$folder/env/bin/python" - <<'PYTHON' 2> "$folder/said"
import numpy as np
import pinocchio as pin

TEXT = """<robot name="r" {version}><link name="a"/><link name="b"/><joint name="j" type="revolute"><parent link="a"/>
<child link="b"/><origin {origin}/><axis xyz="0 0 1"/><limit effort="1" velocity="1"/></joint></robot>"""
quarter = 'quat_xyzw="0 0 0.7071067811865476 0.7071067811865476"'
print("Pinocchio", pin.__version__)
found = {}
for version in ("", 'version="1.0"', 'version="1.1"'):
    model = pin.buildModelFromXML(TEXT.format(version=version, origin=quarter))
    found[version] = np.degrees(np.linalg.norm(pin.log3(model.jointPlacements[1].rotation)))
    print(f"{version or 'no version'}: turned by {found[version]:.6g} degrees of 90")
pin.buildModelFromXML(TEXT.format(version="", origin='quat_xyzw="0 0 1 x"'))
assert found[""] == found['version="1.0"'] == 0.0
assert np.isclose(found['version="1.1"'], 90.0)
PYTHON
test ! -s "$folder/said"
echo "nothing was said"
