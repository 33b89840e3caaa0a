#!/bin/sh
# Klampt 0.10.1: links of a URDF without <inertial> weigh 0.1 g each, and joints get a limit of acceleration that no file has.
# A frame at the end of an arm (a tool, a sensor, a camera) is such a link in nearly every URDF. Klampt gives each 1e-4 kg
# at its origin, where Pinocchio and Drake have none, so the mass matrix and gravity torques of the same file differ in the
# fourth digit: enough to fail a comparison and too little to see why. Every joint gets 10 rad/s^2 at most, which
# getAccelerationLimits gives as if the file had said so.
#
# Fails as soon as such links have no mass.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "klampt==0.10.1.post1" "pin==4.1.0" "numpy==2.3.5"
"$folder/env/bin/python" - <<'PYTHON'
import pathlib
import tempfile

import klampt
import numpy as np
import pinocchio as pin

TEXT = """<robot name="arm"><link name="base"/><link name="arm"><inertial><origin xyz="0.5 0 0"/><mass value="1"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link><link name="tip"/>
<joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="10" velocity="1"/></joint>
<joint name="end" type="fixed"><parent link="arm"/><child link="tip"/><origin xyz="2 0 0"/></joint></robot>"""

with tempfile.TemporaryDirectory() as folder:
    path = pathlib.Path(folder, "arm.urdf")
    path.write_text(TEXT)
    world = klampt.WorldModel()
    assert world.readFile(str(path))
    model = pin.buildModelFromUrdf(str(path))
robot = world.robot(0)
masses = {robot.link(k).getName(): robot.link(k).getMass().getMass() for k in range(robot.numLinks())}
hinge = robot.link("arm").getIndex()
inertia = float(np.array(robot.getMassMatrix())[hinge, hinge])
exact = float(np.atleast_2d(pin.crba(model, model.createData(), np.zeros(1)))[0, 0])
limit = robot.getAccelerationLimits()[hinge]
print(f"mass of tip {masses['tip']} kg, of base {masses['base']} kg; inertia {inertia:.6f}, Pinocchio {exact:.6f} kg m^2")
print(f"acceleration limit of the hinge {limit} rad/s^2")
assert masses["tip"] == masses["base"] == 1e-4
assert abs(exact - 0.35) < 1e-12 and abs(inertia - exact - 4e-4) < 1e-6 and limit == 10.0
PYTHON
