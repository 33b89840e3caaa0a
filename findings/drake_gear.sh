#!/bin/sh
# Drake 1.51.1: motors of an MJCF file give their `gear` times less torque than MuJoCo's, and their limits are as much smaller.
# In MuJoCo a motor's control times gear is the joint's torque. Drake's parser keeps gear as the ratio of a reflected rotor
# alone: with gear="10" the same control of 1 accelerates the joint a tenth as much, and ctrlrange="-1 1" is an effort limit
# of 1 N m where MuJoCo's motor gives 10 N m. A <position> servo becomes a motor that takes its control for a torque.
# Neither is warned of, while stiffness, dry friction and other attributes that are left out are.
#
# Fails as soon as torques of both readers agree.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "drake==1.51.1" "mujoco==4.0.0" "numpy==2.3.5"
"$folder/env/bin/python" - <<'PYTHON'
import pathlib
import tempfile

import mujoco
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

TEXT = """<mujoco model="arm"><option gravity="0 0 0"/><worldbody><body name="arm"><joint name="hinge" axis="0 1 0"/>
<geom type="box" size="0.05 0.05 0.2" mass="2"/></body></worldbody><actuator>{actuator}</actuator></mujoco>"""


def accelerations(actuator):
    """Accelerations of the joint for a control of 1 in MuJoCo and Drake, and Drake's effort limit."""
    text = TEXT.format(actuator=actuator)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = 0.5
    data.ctrl[:] = 1.0
    mujoco.mj_forward(model, data)
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder, "arm.xml")
        path.write_text(text)
        plant = MultibodyPlant(0.0)
        Parser(plant).AddModels(str(path))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, [0.5])
    plant.get_actuation_input_port().FixValue(context, [1.0])
    drake = plant.get_generalized_acceleration_output_port().Eval(context)
    return float(data.qacc[0]), float(drake[0]), float(plant.GetEffortUpperLimits()[0])


for actuator, ratio, limit in (
    ('<motor joint="hinge" ctrllimited="true" ctrlrange="-1 1"/>', 1.0, 1.0),
    ('<motor joint="hinge" gear="10" ctrllimited="true" ctrlrange="-1 1"/>', 10.0, 1.0),
    ('<position joint="hinge" kp="20" ctrllimited="true" ctrlrange="-1 1"/>', 10.0, 1.0),
):
    ours, theirs, effort = accelerations(actuator)
    print(f"{actuator}: MuJoCo {ours:.2f} rad/s^2, Drake {theirs:.2f} rad/s^2, its effort limit {effort:g} N m")
    assert abs(ours / theirs - ratio) < 1e-9 and effort == limit
PYTHON
