"""MuJoCo as a plant: names on both sides, commands of each kind, quaternions and velocities of free joints."""

from __future__ import annotations

import pickle

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.refusals import assert_refused
from wbc.errors import NotFiniteError, RangeError, ShapeError, UnknownNameError
from wbc.simulation import Command, CommandKind, MujocoPlant, PlantError, mujoco_model

ARM = """<mujoco><compiler angle="radian"/><option gravity="0 0 0" timestep="0.001"/>
<default><joint damping="1"/></default>
<worldbody><body name="a"><joint name="one" axis="0 0 1"/><inertial pos=".1 0 0" mass="1" diaginertia=".1 .1 .1"/>
<body name="b" pos=".3 0 0"><joint name="two" axis="0 1 0"/><inertial pos=".1 0 0" mass="1" diaginertia=".1 .1 .1"/>
</body></body></worldbody><actuator>{}</actuator></mujoco>"""
FREE = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81" timestep="0.001"/><worldbody><body name="base">
<freejoint name="base"/><inertial pos="0 0 0" mass="2" diaginertia=".1 .2 .3"/><body name="leg" pos="0 0 -.1">
<joint name="hip" axis="0 1 0"/><inertial pos="0 0 -.1" mass=".5" diaginertia=".01 .01 .01"/></body></body></worldbody>
<actuator><motor name="hip" joint="hip" gear="2"/></actuator></mujoco>"""
DRIVES = {
    "position": '<position name="b" joint="two" kp="50" kv="5"/><position name="a" joint="one" kp="50" kv="5"/>',
    "velocity": '<velocity name="b" joint="two" kv="20"/><velocity name="a" joint="one" kv="20"/>',
    "torque": '<motor name="b" joint="two" gear="4"/><motor name="a" joint="one"/>',
}
TWIN = '<worldbody><body name="ball"><freejoint name="ball"/><geom size=".1"/></body>'


@pytest.mark.parametrize("kind", DRIVES)
def test_commands_go_to_the_joints_of_their_names(kind: str, tmp_path: object) -> None:
    robot = wbc.robots.load(_file(tmp_path, ARM.format(DRIVES[kind])))
    # An object in front of the robot shifts all of qpos
    plant = MujocoPlant(mujoco.MjModel.from_xml_string(ARM.format(DRIVES[kind]).replace("<worldbody>", TWIN)), robot)
    assert list(plant.commands) == [kind]
    plant.reset(np.array([0.1, -0.2]), 2.0)
    plant.apply(Command(CommandKind(kind), np.array([0.3, -0.5])))
    plant.advance(1.0)
    state = plant.read()
    assert state.time == pytest.approx(3.0)
    if kind == "position":
        assert state.q == pytest.approx([0.3, -0.5], abs=0.02)
    elif kind == "velocity":
        assert state.v == pytest.approx(np.array([0.3, -0.5]) * 20 / 21, abs=0.02)
    else:
        data = plant.data
        forces = {data.joint(name).name: float(data.joint(name).qfrc_actuator[0]) for name in ("one", "two")}
        assert forces == pytest.approx({"one": 0.3, "two": -0.5})


def test_a_free_base_falls_as_pinocchio_says(tmp_path: object) -> None:
    robot = wbc.robots.load(_file(tmp_path, FREE))
    assert robot.base == "floating"
    plant, rng = MujocoPlant(mujoco.MjModel.from_xml_string(FREE), robot), np.random.default_rng(0)
    q, v, data = robot.random(1), rng.uniform(-1, 1, robot.nv), robot.model.createData()
    plant.reset(q, 0.0)
    assert plant.read().q == pytest.approx(q)
    plant._joints.put_v(plant.data.qvel, q, v)
    assert plant.read().v == pytest.approx(v)
    torque = np.zeros(robot.nv)
    torque[-1] = 0.4
    plant.apply(Command(CommandKind.TORQUE, torque))
    for _ in range(50):
        plant.advance(0.001)
        v = v + 0.001 * pin.aba(robot.model, data, q, v, torque)
        q = pin.integrate(robot.model, q, 0.001 * v)
    state = plant.read()
    assert pin.difference(robot.model, q, state.q) == pytest.approx(np.zeros(robot.nv), abs=2e-3)
    assert state.v == pytest.approx(v, abs=2e-2)


def test_what_does_not_fit_is_refused(tmp_path: object) -> None:
    robot = wbc.robots.load(_file(tmp_path, ARM.format("")))
    model = mujoco.MjModel.from_xml_string(ARM.format(DRIVES["torque"]))
    assert_refused(lambda: MujocoPlant(mujoco.MjModel.from_xml_string(ARM.format("")), robot), RangeError, "actuator")
    assert_refused(lambda: MujocoPlant(model, wbc.robots.load("panda")), UnknownNameError, "joint")
    plant = MujocoPlant(model, robot)
    assert_refused(lambda: plant.apply(Command(CommandKind.POSITION, np.zeros(2))), UnknownNameError, "position")
    assert_refused(lambda: plant.apply(Command(CommandKind.TORQUE, np.zeros(3))), ShapeError, "command")
    assert_refused(lambda: plant.apply(Command(CommandKind.TORQUE, np.full(2, np.nan))), NotFiniteError, "command")
    plant.data.qvel[:] = np.nan
    assert not plant.read().valid
    # MuJoCo puts the robot back to where its model begins, and goes on
    with pytest.raises(PlantError, match="blown up"):
        plant.advance(0.01)
    plant.reset(np.zeros(2), 0.0)
    plant.advance(0.01)
    assert plant.read().valid


def test_a_saved_state_goes_on_to_the_same_bits(tmp_path: object) -> None:
    """In a user's own model, with an object that flies beside the robot."""
    text = ARM.format(DRIVES["position"])
    robot, model = wbc.robots.load(_file(tmp_path, text)), text.replace("<worldbody>", TWIN)
    plant, again = (MujocoPlant(mujoco.MjModel.from_xml_string(model), robot) for _ in range(2))
    plant.reset(np.array([0.1, -0.2]), 2.0)
    plant.data.qvel[:6] = 0.3
    plant.apply(Command(CommandKind.POSITION, np.array([0.3, -0.5])))
    plant.advance(0.05)
    saved = pickle.loads(pickle.dumps(plant.save()))
    plant.advance(0.1)
    for one in (again, plant):
        end = plant.data.qpos.tobytes(), plant.data.qvel.tobytes(), plant.read().time
        one.restore(saved)
        assert one.read().time == pytest.approx(2.05)
        one.advance(0.1)
        assert (one.data.qpos.tobytes(), one.data.qvel.tobytes(), one.read().time) == end
    panda = wbc.robots.load("panda")
    other = MujocoPlant(mujoco_model(panda, drawn=False), panda)
    assert_refused(lambda: other.restore(saved), RangeError, "another robot")
    alone = MujocoPlant(mujoco.MjModel.from_xml_string(text), robot)
    assert_refused(lambda: alone.restore(saved), ShapeError, "another MuJoCo model")


def _file(folder: object, text: str) -> str:
    path = f"{folder}/robot.xml"
    with open(path, "w") as file:
        file.write(text)
    return path


GEOMS = """<mujoco><default><default class="drawn"><geom contype="0" conaffinity="0" density="300"/></default></default>
<worldbody><body name="a"><joint name="one" axis="0 0 1"/><geom class="drawn" type="box" size=".1 .2 .1" pos=".1 0 0"/>
<body name="b" pos="0 0 1"><joint name="two" axis="0 1 0"/><geom type="sphere" size=".1" mass="3"/>
<geom type="capsule" size=".05" fromto="0 0 0 0 0 .3" mass="1.5" contype="0" conaffinity="0"/>
<body name="c"><joint name="three" axis="1 0 0"/><inertial pos="0 .1 0" mass=".7" diaginertia=".01 .02 .03"/>
<geom class="drawn" type="sphere" size=".3"/></body></body></body></worldbody></mujoco>"""


def test_geoms_that_touch_nothing_weigh_what_mujoco_says(tmp_path: object) -> None:
    robot, model = wbc.robots.load(_file(tmp_path, GEOMS)), mujoco.MjModel.from_xml_string(GEOMS)
    assert [robot.model.inertias[k].mass for k in (1, 2, 3)] == pytest.approx(model.body_mass[1:])
    q, data = np.array([0.3, -0.4, 0.5]), mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    full = np.zeros((3, 3))
    mujoco.mj_fullM(model, data, full)
    mass = pin.crba(robot.model, robot.model.createData(), q)
    assert np.triu(mass) == pytest.approx(np.triu(full), rel=1e-6, abs=1e-9)
