"""Every item on a robot described in millimetres gives the same joint rates, relaxed ticks included."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.controller.stacks import DT, FRAMES, inside, near_limits, robot
from tests.repeats import ALL, MORE
from wbc.api import Controller, Stack
from wbc.robot import Robot
from wbc.shapes import Capsule, HalfSpace, PlacedShape, Sphere
from wbc.tasks import (
    CenterOfMass,
    Damping,
    Elbow,
    EndEffector,
    FrameVelocityLimit,
    Hold,
    JointLimits,
    Obstacle,
    PitchPlane,
    Posture,
)

FACTOR = 1000.0


def longer(pose: pin.SE3) -> pin.SE3:
    return pin.SE3(pose.rotation, FACTOR * pose.translation)


def in_millimetres(bot: Robot) -> Robot:
    """The same robot with every length times 1000."""
    model = pin.Model(bot.model)
    for j in range(1, model.njoints):
        model.jointPlacements[j] = longer(model.jointPlacements[j])
        body = model.inertias[j]
        model.inertias[j] = pin.Inertia(body.mass, FACTOR * body.lever, FACTOR**2 * body.inertia)
    for k, frame in enumerate(model.frames):
        model.frames[k].placement = longer(frame.placement)
    size = np.where(np.array(bot.dof_units) == "m", FACTOR, 1.0)
    scaled = ("position_lower", "position_upper", "velocity", "acceleration")
    arrays = {name: getattr(bot.limits, name) * size for name in scaled}
    shapes = {
        link: tuple(
            PlacedShape(
                Capsule(FACTOR * s.shape.radius, FACTOR * s.shape.length)
                if isinstance(s.shape, Capsule)
                else Sphere(FACTOR * s.shape.radius),
                longer(s.placement),
            )
            for s in placed
        )
        for link, placed in bot.shapes.items()
    }
    return replace(
        bot,
        model=model,
        limits=replace(bot.limits, **arrays),
        shapes=shapes,
        neutral=stretched(bot, bot.neutral),
    )


def stretched(bot: Robot, q: np.ndarray) -> np.ndarray:
    """A configuration with its lengths times 1000: sliding joints, and the place of a base."""
    out = np.array(q)
    for j in range(1, bot.model.njoints):
        start, kind = int(bot.model.idx_qs[j]), bot.model.joints[j].shortname()
        if "FreeFlyer" in kind:
            out[start : start + 3] *= FACTOR
        elif "Planar" in kind:
            out[start : start + 2] *= FACTOR
        elif "Prismatic" in kind or kind.startswith("JointModelP"):
            out[start] *= FACTOR
    return out


def stack(bot: Robot, name: str, unit: float) -> Stack:
    """Items of every kind; lengths are given in the robot's unit."""
    out = Stack(bot, DT)
    tip, middle = (FRAMES[name].tip, FRAMES[name].middle) if name in FRAMES else ("wrist_ft_tool_link", "arm_4_link")
    out.add(EndEffector(tip), name="hand").add(Posture(), name="posture", weight=1e-2)
    out.add(Elbow(middle, offset=(0.1 * unit, 0.0, 0.05 * unit)), name="elbow", weight=0.1)
    out.add(CenterOfMass(), name="com", weight=0.2).add(Damping(), name="damping", weight=1e-3)
    if name in FRAMES:
        out.add(PitchPlane(*FRAMES[name].plane), name="plane", weight=0.1)
    out.add(JointLimits(), name="limits").add(FrameVelocityLimit(tip, linear=0.4 * unit, angular=1.0), name="speed")
    out.add(Hold(middle, "position"), name="hold")
    out.add(Obstacle(Sphere(0.05 * unit)), name="ball").add(Obstacle(HalfSpace()), name="floor")
    return out


def aim(tick: Controller, rng: np.random.Generator, unit: float, holds: bool) -> None:
    target = tick["hand"].target
    turn, move = pin.exp3(rng.normal(0.0, 0.3, 3)), rng.normal(0.0, 0.1, 3)
    tick["hand"].target = pin.SE3(turn @ target.rotation, target.translation + unit * move)
    tick["hand"].feedforward = rng.normal(0.0, 0.1, 6) * np.array([unit] * 3 + [1.0] * 3)
    tick["com"].target = tick["com"].target + unit * rng.normal(0.0, 0.02, 3)
    tick["ball"].pose = pin.SE3(np.eye(3), unit * rng.uniform(-0.8, 0.8, 3))
    tick["ball"].velocity = rng.normal(0.0, 0.1, 6) * np.array([unit] * 3 + [1.0] * 3)
    tick["floor"].pose = pin.SE3(pin.exp3(rng.normal(0.0, 0.1, 3)), np.array([0.0, 0.0, -2.0 * unit]))
    tick["hold"].enabled = holds


def machine(name: str) -> Robot:
    """Tiago has a differential base and a sliding torso; the others as in the other tests."""
    return wbc.robots.load(name).with_limits(acceleration=10.0) if name == "tiago" else robot(name)


def check(one: Any, two: Any, bot: Robot, tolerance: float) -> None:
    size = np.where(np.array(bot.dof_units) == "m", FACTOR, 1.0)
    assert one.status == two.status
    assert np.abs(two.v / size - one.v).max() < tolerance
    for name, residual in one.residuals.items():
        scale = np.where(np.array(residual.units) == "m", FACTOR, 1.0)
        assert two.residuals[name].values == pytest.approx(scale * residual.values, rel=1e-9, abs=1e-9)
    for name, margin in one.margins_ahead.items():
        assert two.margins_ahead[name] == pytest.approx(FACTOR * margin, rel=1e-9, abs=1e-6)
    assert {(s.item, s.row) for s in one.relaxed} == {(s.item, s.row) for s in two.relaxed}


#: An arm is compared in tests/stack/test_units.py, too
@pytest.mark.parametrize("name", ["talos", "tiago"] if MORE < ALL else ["panda", "talos", "tiago"])
def test_millimetres_change_no_joint_rate(name: str) -> None:
    small = machine(name)
    large = in_millimetres(small)
    assert large.characteristic_length == pytest.approx(FACTOR * small.characteristic_length, rel=1e-12)
    ticks = [stack(small, name, 1.0).compile(backend="vm"), stack(large, name, FACTOR).compile(backend="vm")]
    rng, seen = np.random.default_rng(9), set()
    size = np.where(np.array(small.dof_units) == "m", FACTOR, 1.0)
    for k in range(8):
        q = inside(small, rng) if k % 3 else near_limits(small, rng)
        v, own = 0.2 * rng.normal(size=small.nv), int(rng.integers(1 << 30))
        steps = []
        for tick, unit, here, speed in (
            (ticks[0], 1.0, q, v),
            (ticks[1], FACTOR, stretched(small, q), size * v),
        ):
            tick.reset(here, speed)
            aim(tick, np.random.default_rng(own), unit, holds=k % 2 == 0)
            steps.append(tick.step(here, speed))
        check(steps[0], steps[1], small, 1e-9 if steps[0].status == "solved" else 1e-7)
        seen.add(str(steps[0].status))
    assert "solved" in seen or name != "panda"


def test_a_length_of_another_size_does_change_the_answer() -> None:
    """What the test above would not notice if the length had no effect."""
    bot, out = machine("panda"), []
    for length in (None, 0.1):
        s = Stack(bot, DT, length=length).add(EndEffector("panda_hand_tcp"), name="hand")
        s.add(Posture(), name="posture").add(JointLimits(), name="limits")
        tick = s.compile(backend="vm")
        tick.reset(bot.neutral)
        target = tick["hand"].target
        tick["hand"].target = pin.SE3(target.rotation, target.translation + np.array([0.0, 0.05, 0.02]))
        out.append(tick.step(bot.neutral).v)
    assert np.abs(out[0] - out[1]).max() > 1e-3
