"""A robot described in millimetres moves exactly as the same robot in metres: the characteristic length sees to it."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.repeats import ALL, MORE, covering, repeats
from tests.stack.millimetres import configuration, moved, scaled, velocity
from tests.stack.small import arm
from tests.tasks.robots import FRAMES
from wbc.api import Controller, Stack
from wbc.controller import Step
from wbc.errors import ShapeError, UnknownNameError
from wbc.qp.problem import QP
from wbc.qp.relax import Relaxation
from wbc.robot import Robot
from wbc.robots import DHRow, from_dh
from wbc.shapes import Capsule, HalfSpace, PlacedShape, Sphere
from wbc.tasks import (
    CenterOfMass,
    Damping,
    Elbow,
    EndEffector,
    Expression,
    FrameVelocityLimit,
    Hold,
    JointLimits,
    Obstacle,
    PitchPlane,
    Posture,
    Row,
)

DT = 0.005
STATES = repeats(40)
RADIUS, MARGIN, SPEED = 0.08, 0.02, 0.25


@cache
def robot(name: str) -> Robot:
    """An arm, a mobile manipulator with a sliding torso, a humanoid, an arm on a rail; a ball and a rod on the tip."""
    if name == "rail":
        rows = [DHRow(joint="prismatic", alpha=np.pi / 2, lower=-1.0, upper=1.0, velocity=0.8)]
        for a, alpha, d in ((0.1, -1.5, 0.3), (0.4, 0.2, 0.05), (0.0, 1.6, 0.1), (0.1, -1.6, 0.3), (0.0, 1.5, 0.1)):
            rows.append(DHRow(a=a, alpha=alpha, d=d, lower=-2.8, upper=2.8, velocity=2.0))
        bare = from_dh(rows, name="rail")
        heavy = pin.Model(bare.model)
        for j in range(1, heavy.njoints):  # Denavit-Hartenberg rows bring no masses
            heavy.inertias[j] = pin.Inertia(1.0 + j, np.array([0.1, 0.02 * j, 0.05]), 0.01 * np.eye(3))
        bare = replace(bare, model=heavy)
    else:
        bare = wbc.robots.load(name, shapes="none")
    slow = np.where(np.isfinite(bare.limits.velocity), bare.limits.velocity, 1.0)
    bare = bare.with_limits(velocity=slow, acceleration=100.0)
    tilt = pin.SE3(pin.exp3(np.array([0.4, 0.3, 0.1])), np.array([0.02, 0.0, -0.05]))
    return bare.with_shapes({tip_of(bare): [PlacedShape(Sphere(0.04), tilt), PlacedShape(Capsule(0.03, 0.1), tilt)]})


def tip_of(bot: Robot) -> str:
    return FRAMES[bot.name].tip if bot.name in FRAMES else bot.frames["tip"]


def middle_of(bot: Robot) -> str:
    return FRAMES[bot.name].middle if bot.name in FRAMES else {"tiago": "arm_4_link", "rail": "link3"}[bot.name]


def controller(bot: Robot, scale: float, backend: str) -> Controller:
    """Tasks in metres and radians against limits in both."""
    tip = tip_of(bot)
    stack = Stack(bot, DT)
    stack.add(EndEffector(tip), name="hand")
    stack.add(CenterOfMass(), name="com", weight=0.1)
    stack.add(Posture(), name="posture", weight=1e-3)
    stack.add(Elbow(middle_of(bot), offset=(0.1 * scale, 0.0, 0.05 * scale)), name="elbow", weight=0.01)
    stack.add(Damping(), name="damping", weight=1e-4)
    if bot.name in FRAMES:
        stack.add(PitchPlane(*FRAMES[bot.name].plane), name="plane", weight=0.01)
    stack.add(Hold(middle_of(bot), "position"), name="hold")
    stack.add(Obstacle(HalfSpace()), name="floor")
    stack.add(Obstacle(Sphere(scale * RADIUS), margin=scale * MARGIN), name="ball")
    stack.add(FrameVelocityLimit(tip, linear=scale * SPEED, angular=1.0), name="speed")
    stack.add(JointLimits(), name="limits")
    return stack.compile(backend=backend)


def state(bot: Robot, rng: np.random.Generator) -> tuple[Any, ...]:
    """Configuration, measured velocity, targets of hand, mass and posture, pose and velocity of the ball, pose of
    the floor, all in metres, and whether the elbow is held.
    """
    free = np.where(np.isfinite(bot.limits.position_lower), 0.0, 0.8)
    q = pin.integrate(bot.model, bot.neutral, free * rng.uniform(-1, 1, bot.nv))
    for i, k in enumerate(bot.position_index):
        low, high = bot.limits.position_lower[i], bot.limits.position_upper[i]
        if k >= 0 and np.isfinite(low):
            q[k] = rng.uniform(low, high) if rng.random() < 0.8 else rng.choice([low + 0.002, high - 0.002])
    v = np.where(np.array(bot.dof_names) == "root_joint.y", 0.0, rng.uniform(-0.05, 0.05, bot.nv))
    data = bot.model.createData()
    pin.framesForwardKinematics(bot.model, data, q)
    tip = data.oMf[bot.model.getFrameId(tip_of(bot))]
    goal = pin.SE3(tip.rotation @ pin.exp3(rng.uniform(-0.6, 0.6, 3)), tip.translation + rng.uniform(-0.3, 0.3, 3))
    ahead = goal.translation - tip.translation  # in the way, and near enough to matter
    ball = tip.translation + (0.17 + 0.03 * rng.random()) * ahead / np.linalg.norm(ahead)
    mass = pin.centerOfMass(bot.model, data, q) + rng.uniform(-0.1, 0.1, 3)
    posture = pin.integrate(bot.model, q, 0.3 * rng.uniform(-1, 1, bot.nv))
    floor = pin.SE3(pin.exp3(rng.normal(0.0, 0.1, 3)), np.array([0.0, 0.0, -2.0]))
    drift, holds = rng.uniform(-0.1, 0.1, 3), rng.random() < 0.3
    return q, v, goal, mass, posture, pin.SE3(np.eye(3), ball), drift, floor, holds


def step(tick: Controller, bot: Robot, given: tuple[Any, ...], scale: float) -> Step:
    """One tick at a state, all of its lengths times ``scale``."""
    q, v, goal, mass, posture, ball, drift, floor, holds = given
    tick.reset()
    tick["hand"].target = moved(goal, scale)
    tick["com"].target = scale * mass
    tick["posture"].target = configuration(bot, posture, scale)
    tick["ball"].pose, tick["floor"].pose = moved(ball, scale), moved(floor, scale)
    # held where it cannot stay
    tick["hold"].target = pin.SE3(np.eye(3), scale * goal.translation)
    tick["hold"].enabled = holds
    tick["ball"].velocity = np.concatenate([scale * drift, np.zeros(3)])
    return tick.step(configuration(bot, q, scale), velocity(bot, v, scale))


@pytest.mark.parametrize(
    ("case", "scale"),
    covering(
        [("tiago", "vm"), ("rail", "vm"), ("talos", "vm")]
        + ([("panda", "vm"), ("rail", "native")] if MORE >= ALL else []),
        [1000.0, 1e-3],
    ),
)
def test_units_change_no_answer(case: tuple[str, str], scale: float) -> None:
    name, backend = case
    bot, rng = robot(name), np.random.default_rng(3)
    other = scaled(bot, scale)
    assert other.characteristic_length == pytest.approx(scale * bot.characteristic_length, rel=1e-12)
    assert ("m" in bot.dof_units) == (name != "panda")
    metres, others = controller(bot, 1.0, backend), controller(other, scale, backend)
    seen: Counter[str] = Counter()
    for _ in range(STATES):
        given = state(bot, rng)
        one, two = step(metres, bot, given, 1.0), step(others, bot, given, scale)
        wanted = velocity(bot, one.v, scale)
        assert one.status == two.status
        seen[str(one.status)] += 1
        size = velocity(bot, np.full(bot.nv, np.abs(one.v).max()), scale)
        # the curvature of errors out of reach fades in steeply, and rounding with it
        assert np.abs((two.v - wanted) / size).max() < 1e-6
        assert [str(b) for b in one.binding] == [str(b) for b in two.binding]
        np.testing.assert_allclose(two.margins["ball"], scale * one.margins["ball"], rtol=0, atol=1e-9 * scale)
        for task, residual in one.residuals.items():
            factor = np.array([scale if u == "m" else 1.0 for u in residual.units])
            np.testing.assert_allclose(two.residuals[task].values, factor * residual.values, rtol=0, atol=1e-9 * scale)
        seen.update({b.item for b in one.binding})
    # the answers are those of limits at work, not of free motion alone
    assert min(seen[item] for item in ("ball", "speed", "limits", "solved", "relaxed")) >= 3, seen


def test_a_fixed_length_would_change_the_answer() -> None:
    """The check above can fail: without the characteristic length it does."""
    bot, rng = robot("rail"), np.random.default_rng(3)
    given, answers = state(bot, rng), []
    for scale in (1.0, 1000.0):
        stack = Stack(scaled(bot, scale), DT, length=1.0)
        stack.add(EndEffector("tip"), name="hand").add(CenterOfMass(), name="com", weight=0.1)
        stack.add(Posture(), name="posture", weight=1e-3)
        tick = stack.compile(backend="vm")
        tick["hand"].target = moved(given[2], scale)
        tick["com"].target = scale * given[3]
        tick["posture"].target = configuration(bot, given[4], scale)
        answers.append(velocity(bot, tick.step(configuration(bot, given[0], scale)).v, 1.0 / scale))
    assert np.abs(answers[0] - answers[1]).max() > 1e-3


def test_relaxation_does_not_depend_on_units() -> None:
    """Contradicting rows in metres and in millimetres, some variables metres: the same compromise."""
    rng, given = np.random.default_rng(8), 0
    for _ in range(30):
        n, m = 6, 5
        size, unit = np.where(rng.random(n) < 0.5, 1000.0, 1.0), np.where(rng.random(m) < 0.5, 1000.0, 1.0)
        J, A = rng.normal(size=(n, n)), rng.normal(size=(m, n))
        middle, ends = rng.normal(0.0, 1.5, m), np.full(n, 0.6)
        one = QP(J.T @ J + 1e-6 * np.eye(n), rng.normal(size=n), np.r_[-ends, middle - 0.1], np.r_[ends, middle], A)
        both = np.concatenate((size, unit))
        two = QP(
            one.H / np.outer(size, size), one.g / size, one.lower * both, one.upper * both, (unit[:, None] * A) / size
        )
        order = np.array([1, 1, 2, 3, 3])
        wanted = Relaxation(n, m).solve(one, order, np.ones(m))
        found = Relaxation(n, m).solve(two, order, unit, size)
        assert found.flag == wanted.flag
        assert np.abs(found.x / size - wanted.x).max() < 1e-9
        assert np.abs(found.slack / unit - wanted.slack).max() < 1e-9
        assert (found.relaxed == wanted.relaxed).all()
        # bounds that were not moved are the given ones, to the last digit; multipliers need not be unique here
        for side in ("lower", "upper"):
            kept = getattr(wanted, side)[:n] == getattr(one, side)[:n]
            assert (getattr(found, side)[:n] == getattr(two, side)[:n])[kept].all()
        given += wanted.flag == "relaxed"
    assert given > 10


#: Unit of a row -> how many of it are a metre or a radian
KNOWN = {"m": 1.0, "cm": 1e2, "mm": 1e3, "in": 1.0 / 0.0254, "rad": 1.0, "mrad": 1e3, "deg": 180.0 / np.pi}


def row_in(unit: str) -> Expression:
    """The height of the tip, or the angle of the first joint, in some unit."""
    many = KNOWN[unit]
    if unit in ("rad", "mrad", "deg"):
        return Expression(lambda kin, p: many * (kin.joint("joint1") - 0.9), units=unit)
    return Expression(lambda kin, p: many * (kin.position("tip")[1] - 0.3), units=unit)


@pytest.mark.parametrize("unit", KNOWN)
def test_a_row_costs_the_same_in_every_unit(unit: str) -> None:
    """Against a posture that wants something else, and the tolerance of inverse kinematics with it."""
    base, answers = {"m": "m", "rad": "rad"}.get(unit, "rad" if unit in ("mrad", "deg") else "m"), []
    for each in (base, unit):
        stack = Stack(arm(), 0.01).add(row_in(each), name="row").add(Posture(), name="posture", weight=0.3)
        tick = stack.add(JointLimits(), name="limits").compile(backend="vm")
        tick["posture"].target = (0.0, 0.0)
        answers.append(tick.step((0.3, 0.8)).v)
        tick["row"].weight = 7.0
        answers[-1] = np.concatenate((answers[-1], tick.step((0.3, 0.8)).v))
    assert np.abs(answers[0]).max() > 0.05
    np.testing.assert_allclose(answers[1], answers[0], rtol=1e-7, atol=1e-9)


def test_tolerances_of_inverse_kinematics_are_in_metres() -> None:
    for unit in ("m", "mm"):
        stack = Stack(arm(), 0.01).add(row_in(unit), name="row")
        found = stack.solve((0.3, 0.8), goals=["row"], backend="vm", tolerance=1e-4, budget=None)
        residual = found.step.residuals["row"].values[0] / KNOWN[unit]
        assert found.status == "solved"
        assert abs(residual) <= 1e-4


@pytest.mark.parametrize("unit", ["banana", "Mm", "degrees", "m/s/s", 3, None, ["m"]])
def test_unknown_units_are_refused_with_the_list(unit: object) -> None:
    for make in (lambda: Row("height", unit), lambda: Expression(lambda kin, p: kin.position("tip")[1], units=(unit,))):
        with pytest.raises((UnknownNameError, ShapeError)) as caught:
            make()
        if isinstance(unit, str):
            assert {"m", "mm", "deg", "rad"} <= set(caught.value.choices)
