"""Edges, sliding points, known wrenches and friction: torques are those of Pinocchio's dynamics with these forces."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import linprog

from tests.models import placement
from tests.torque.problems import DT, robot
from wbc.api import Controller, Stack
from wbc.robot import Robot
from wbc.tasks import (
    CenterOfMass,
    EndEffector,
    ExternalWrench,
    JointFriction,
    JointLimits,
    LineContact,
    MovingFrame,
    Posture,
    SlidingContact,
    SurfaceContact,
    TorqueLimits,
)

TIP = "panda_hand_tcp"


def test_line_wrenches_are_exactly_those_of_two_ends() -> None:
    X, friction = 0.12, 0.7
    item = LineContact("any", half_length=X, friction=friction)
    found = item.cone({i.name: ca.SX(i.default) for i in item.limits()})
    evaluated = ca.Function("cone", [], [ca.densify(found.matrix), found.lower])()
    F, low = np.array(evaluated["o0"]), np.array(evaluated["o1"])[:, 0]
    mu = friction / np.sqrt(2)
    rays = [np.array([a * mu, b * mu, 1.0]) for a in (1, -1) for b in (1, -1)]
    whole = np.column_stack([np.r_[f, np.cross([s * X, 0.0, 0.0], f)] for s in (1, -1) for f in rays])
    assert not whole[3].any()
    generators, rng, outside = whole[list(item.axes)], np.random.default_rng(0), 0
    scale = np.array([0.6, 0.6, 1.0, 0.1, 0.08])
    for w in rng.normal(size=(200, 5)) * scale + np.array([0, 0, 1.0, 0, 0]):
        possible = linprog(np.zeros(8), A_eq=generators, b_eq=w).status == 0
        assert bool((F @ w >= low - 1e-9).all()) == possible, w
        outside += not possible
    assert 20 < outside < 180


def wiping(plane: str = "world") -> Controller:
    made = Stack(robot("panda"), dt=DT).add(MovingFrame(pin.SE3.Identity()), name="table")
    made.add(EndEffector(TIP, kind="position"), name="hand")
    made.add(SlidingContact(TIP, friction=0.4), name="wiper", relative_to=None if plane == "world" else plane)
    made.add(ExternalWrench("panda_link5"), name="push").add(JointFriction(0.3, 0.7, slow=0.05), name="gears")
    made.add(Posture(), weight=1e-2).add(JointLimits()).add(TorqueLimits())
    return made.compile(command="torque", backend="vm")


def kinematics(bot: Robot, frame: str, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    data = bot.model.createData()
    jacobian = pin.computeFrameJacobian(bot.model, data, q, bot.model.getFrameId(frame), pin.LOCAL_WORLD_ALIGNED)
    return np.array(jacobian), np.array(jacobian @ v)


@pytest.mark.parametrize("plane", ["world", "table"])
def test_torques_bear_what_slides_pushes_and_rubs(plane: str) -> None:
    """Also where the plane moves: friction is against the velocity past the plane."""
    tick, bot, rng = wiping(plane), robot("panda"), np.random.default_rng(0)
    q, v = bot.neutral.copy(), rng.uniform(-0.3, 0.3, bot.nv)
    tick.reset(q)
    J, twist = kinematics(bot, TIP, q, v)
    tip = placement(bot, TIP, q)
    carried, pose = (np.zeros(6), pin.SE3.Identity())
    if plane == "table":
        carried, pose = (
            rng.uniform(-0.3, 0.3, 6),
            pin.SE3(pin.exp3(np.array([0.2, 0.1, 0.5])), np.array([0.3, 0.0, 0.2])),
        )
        tick["table"].set(pose=pose, twist=carried)
    surface = pin.SE3(pin.exp3(np.array([0.1, -0.2, 0.0])), tip.translation)
    tick["wiper"].target = pose.actInv(surface)
    tick["wiper force"].set(target=[10.0])
    tick["wiper force"].weight = 10.0
    wrench = np.array([5.0, -3.0, 2.0, 0.4, 0.3, -0.2])
    tick["push"].wrench = wrench
    step = tick.step(q, v)
    assert step.status == "solved"
    force = float(step.forces["wiper"][0])
    assert force == pytest.approx(10.0, abs=0.01)
    n = surface.rotation[:, 2]
    past = twist[:3] - carried[:3] - np.cross(carried[3:], tip.translation - pose.translation)
    slip = past - n * (n @ past)
    felt = force * (n - 0.4 * slip / np.sqrt(slip @ slip + 0.01**2))
    pushed = kinematics(bot, "panda_link5", q, v)[0].T @ wrench
    rubbed = -0.3 * v - 0.7 * np.tanh(v / 0.05)
    free = pin.rnea(bot.model, bot.model.createData(), q, v, step.a)
    assert step.torque == pytest.approx(free - J[:3].T @ felt - pushed - rubbed, abs=1e-8)
    tick["push"].enabled = tick["gears"].enabled = False
    step = tick.step(q, v)
    felt = float(step.forces["wiper"][0]) * felt / force
    free = pin.rnea(bot.model, bot.model.createData(), q, v, step.a)
    assert step.torque == pytest.approx(free - J[:3].T @ felt, abs=1e-8)


def test_a_known_push_reaches_the_feet() -> None:
    """Talos on a foot and an edge: the wrenches on it, the push included, are what its base needs."""
    bot = robot("talos")
    made = Stack(bot, dt=DT).add(CenterOfMass()).add(Posture(), weight=1e-2).add(JointLimits()).add(TorqueLimits())
    made.add(SurfaceContact("left_sole_link", half_lengths=(0.1, 0.06), friction=0.7), name="foot")
    made.add(LineContact("right_sole_link", half_length=0.1, friction=0.7), name="edge")
    made.add(ExternalWrench("gripper_left_base_link"), name="push")
    tick = made.compile(command="torque", backend="vm")
    q, v = bot.neutral.copy(), np.zeros(bot.nv)
    tick.reset(q)
    tick["push"].wrench = push = np.array([20.0, 10.0, -30.0, 1.0, 2.0, 3.0])
    step = tick.step(q, v)
    assert step.status == "solved"
    assert step.forces["edge"].shape == (5,)
    assert step.forces["edge"][2] > 10.0
    total = kinematics(bot, "gripper_left_base_link", q, v)[0].T @ push
    for frame, name, axes in (("left_sole_link", "foot", range(6)), ("right_sole_link", "edge", (0, 1, 2, 4, 5))):
        turn, w = placement(bot, frame, q).rotation, np.zeros(6)
        w[list(axes)] = step.forces[name]
        total += kinematics(bot, frame, q, v)[0].T @ np.r_[turn @ w[:3], turn @ w[3:]]
    needed = pin.rnea(bot.model, bot.model.createData(), q, v, step.a) - total
    assert needed[:6] == pytest.approx(np.zeros(6), abs=1e-6)
    assert needed[6:] == pytest.approx(step.torque[6:], abs=1e-6)
