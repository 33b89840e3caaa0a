"""Random trees of bodies, on fixed and on floating bases, in both simulators."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from wbc.robot import Robot
from wbc.simulation import (
    Command,
    CommandKind,
    Encoders,
    GripKind,
    Motors,
    MujocoPlant,
    PinocchioPlant,
    PlantState,
    mujoco_model,
)


def tree(rng: np.random.Generator, floating: bool) -> Robot:
    """Branches of hinges and slides of any axis."""
    model, first = pin.Model(), pin.JointModelFreeFlyer() if floating else pin.JointModelRX()
    joints = [model.addJoint(0, first, pin.SE3.Identity(), "base")]
    for k in range(int(rng.integers(2, 6))):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        kind = pin.JointModelPrismaticUnaligned if rng.random() < 0.3 else pin.JointModelRevoluteUnaligned
        place = pin.SE3(pin.exp3(rng.normal(size=3)), 0.3 * rng.normal(size=3))
        joints.append(model.addJoint(int(rng.choice(joints)), kind(axis), place, f"j{k}"))
        model.addFrame(pin.Frame(f"f{k}", joints[-1], pin.SE3.Random(), pin.FrameType.OP_FRAME))
    for joint in joints:
        inertia = pin.Inertia(rng.uniform(0.2, 3.0), 0.1 * rng.normal(size=3), np.diag(rng.uniform(0.01, 0.02, 3)))
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    return wbc.robots.load(model)


@pytest.mark.parametrize("seed", range(6))
def test_accelerations_agree_and_saved_states_go_on_to_the_same_bits(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = tree(rng, floating=seed % 2 == 0)
    model, base = robot.model, robot.base_nv
    q, v = pin.integrate(model, robot.neutral, 0.5 * rng.normal(size=robot.nv)), rng.normal(size=robot.nv)
    tau = 3.0 * rng.normal(size=robot.nv)
    tau[:base] = 0.0

    plain, theirs = PinocchioPlant(robot), MujocoPlant(mujoco_model(robot, actuators="torque"), robot)
    plain.reset(q, 0.0, v)
    theirs.reset(q, 0.0, v)
    theirs.apply(Command(CommandKind.TORQUE, tau))
    mujoco.mj_forward(theirs._model, theirs.data)
    found, other = plain.acceleration(tau), np.zeros(robot.nv)
    for name in robot.joint_names:
        part, begin = robot.dofs(name), int(theirs._model.joint(name).dofadr[0])
        other[part] = theirs.data.qacc[begin : begin + part.stop - part.start]
    if base:
        other[:3] = pin.Quaternion(q[3:7]).matrix().T @ other[:3] - np.cross(v[3:6], v[:3])
    assert other == pytest.approx(found, abs=1e-9 * np.abs(found).max())

    motors = Motors(delay=0.002, lag=0.005, noise=0.1, viscous=0.1, coulomb=0.05)
    ends: list[PlantState] = []
    for _ in range(2):
        plant = PinocchioPlant(robot, motors=motors, encoders=Encoders(position=1e-5, velocity=1e-4), seed=seed)
        plant.reset(q, 0.0, v)
        plant.grasp("f0", robot.pose(q, "f0"), GripKind.POSITION)
        plant.apply(Command(CommandKind.TORQUE, tau))
        plant.advance(0.005)
        saved = plant.save()
        plant.advance(0.01)
        ends.append(plant.read())
        plant.restore(saved)
        plant.advance(0.01)
        ends.append(plant.read())
    for end in ends[1:]:
        assert end.q.tobytes() == ends[0].q.tobytes()
        assert end.v.tobytes() == ends[0].v.tobytes()
