"""Edges, sliding points, known wrenches and friction: torques are those of Pinocchio's dynamics with these forces."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.pinocchio_state import PinocchioState
from tests.torque.problems import DT, robot
from wbc.api import Controller, Stack
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


def wiping(plane: str = "world") -> Controller:
    made = Stack(robot("panda"), dt=DT).add(MovingFrame(pin.SE3.Identity()), name="table")
    made.add(EndEffector(TIP, kind="position"), name="hand")
    made.add(SlidingContact(TIP, friction=0.4), name="wiper", relative_to=None if plane == "world" else plane)
    made.add(ExternalWrench("panda_link5"), name="push").add(JointFriction(0.3, 0.7, slow=0.05), name="gears")
    made.add(Posture(), weight=1e-2).add(JointLimits()).add(TorqueLimits())
    return made.compile(command="torque", backend="vm")


@pytest.mark.parametrize("plane", ["world", "table"])
def test_torques_bear_what_slides_pushes_and_rubs(plane: str) -> None:
    """Also where the plane moves: friction is against the velocity past the plane."""
    tick, bot, rng = wiping(plane), robot("panda"), np.random.default_rng(0)
    q, v = bot.neutral.copy(), rng.uniform(-0.3, 0.3, bot.nv)
    tick.reset(q)
    state = PinocchioState(bot.model, q, v)
    hand = state.frame(TIP)
    J, twist, tip = hand.J, hand.twist, hand.pose
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
    pushed = state.frame("panda_link5").J.T @ wrench
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
    state = PinocchioState(bot.model, q, v)
    total = state.frame("gripper_left_base_link").J.T @ push
    for frame, name, axes in (("left_sole_link", "foot", range(6)), ("right_sole_link", "edge", (0, 1, 2, 4, 5))):
        total += state.frame(frame).local[list(axes)].T @ step.forces[name]
    needed = pin.rnea(bot.model, bot.model.createData(), q, v, step.a) - total
    assert needed[:6] == pytest.approx(np.zeros(6), abs=1e-6)
    assert needed[6:] == pytest.approx(step.torque[6:], abs=1e-6)
