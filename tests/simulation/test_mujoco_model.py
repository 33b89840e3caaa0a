"""MuJoCo models made from robots: they move as Pinocchio says, touch the ground, and take every kind of command."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.refusals import assert_refused
from wbc.errors import RangeError, UnknownNameError, UnsupportedJointError
from wbc.shapes import Box, PlacedShape, Sphere
from wbc.simulation import Command, CommandKind, MujocoPlant, mujoco_model


@pytest.mark.parametrize("name", ["ur5", "solo12", "talos"])
def test_free_motion_is_pinocchios(name: str) -> None:
    """Accelerations under gravity, velocities and torques, to 1e-9 of the largest; base and joints."""
    robot = wbc.robots.load(name)
    model = mujoco_model(robot, drawn=False)
    plant, rng = MujocoPlant(model, robot), np.random.default_rng(0)
    q, v = robot.random(1), rng.normal(size=robot.nv)
    torque = np.clip(rng.normal(size=robot.nv), -robot.limits.effort, robot.limits.effort)
    torque[: robot.base_nv] = 0.0
    plant.reset(q, 0.0, v)
    plant.apply(Command(CommandKind.TORQUE, torque))
    mujoco.mj_forward(model, plant.data)
    assert plant.data.nefc == 0
    wanted = pin.aba(robot.model, robot.model.createData(), q, v, torque)
    for joint in robot.joint_names:
        dofs = robot.dofs(joint)
        found = plant.data.joint(joint).qacc.copy()
        if len(found) == 6:
            # MuJoCo: of the origin, along the world's axes; Pinocchio: rate of the body's components
            turn = pin.Quaternion(q[3:7]).toRotationMatrix()
            found[:3] = turn.T @ found[:3] - np.cross(v[3:6], v[:3])
        np.testing.assert_allclose(found, wanted[dofs], atol=1e-9 * np.abs(wanted).max())


@pytest.mark.parametrize("kind", list(CommandKind))
def test_actuators_of_every_kind(kind: CommandKind) -> None:
    robot = wbc.robots.load("ur5")
    plant = MujocoPlant(mujoco_model(robot, actuators=str(kind), drawn=False), robot)
    assert list(plant.commands) == [kind]
    q = robot.neutral
    plant.reset(q, 0.0)
    data = robot.model.createData()
    wanted = {
        CommandKind.TORQUE: np.array(pin.computeGeneralizedGravity(robot.model, data, q)),
        CommandKind.POSITION: q,
        CommandKind.VELOCITY: np.zeros(robot.nv),
    }[kind]
    plant.apply(Command(kind, wanted))
    plant.advance(0.05)
    # Held against gravity: a servo of positions or velocities yields a little
    assert np.abs(pin.difference(robot.model, q, plant.read().q)).max() < (1e-9 if kind == "torque" else 0.02)


def test_what_touches_the_ground() -> None:
    """A ball on a stick falls onto a floor, and lies there with its weight; its own shape alone falls through."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "free")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(2.0, 0.1), pin.SE3.Identity())
    model.addBodyFrame("ball", joint, pin.SE3.Identity(), 0)
    robot = wbc.robots.load(model, base="floating")
    ball = PlacedShape(Sphere(0.1), pin.SE3.Identity())
    for contacts, rests in (({"ball": [ball]}, True), ({}, False)):
        made = mujoco_model(replace(robot, shapes={"ball": (ball,)}), contacts=contacts, ground=0.5)
        data = mujoco.MjData(made)
        data.qpos[:3] = 0.0, 0.0, 0.6
        for _ in range(500):
            mujoco.mj_step(made, data)
        assert (data.qpos[2] > 0.59) == rests
        if rests:
            force = np.zeros(6)
            mujoco.mj_contactForce(made, data, 0, force)
            assert force[0] == pytest.approx(2.0 * 9.81, rel=0.02)


def test_what_is_refused() -> None:
    robot = wbc.robots.load("ur5")
    assert_refused(lambda: mujoco_model(robot, actuators="effort"), UnknownNameError, "actuators")
    assert_refused(lambda: mujoco_model(robot, time_step=0.0), RangeError, "time_step")
    box = {"hand": [PlacedShape(Box((1, 1, 1)), pin.SE3.Identity())]}
    assert_refused(lambda: mujoco_model(robot, contacts=box), UnknownNameError, "contacts")
    assert_refused(lambda: mujoco_model(wbc.robots.load("tiago")), UnsupportedJointError, "Planar")
    model = robot.model.copy()
    model.inertias[6] = pin.Inertia(1.0, np.zeros(3), np.diag([1.0, 1.0, 5.0]))
    assert_refused(lambda: mujoco_model(replace(robot, model=model)), RangeError, "MuJoCo does not take it")
