"""What is held stays where it is, within a tick as well: limbs that are stretched neither slide nor chatter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.backends import IN_PYTHON, way
from tests.calm import held
from tests.models import frame_jacobian, placement
from tests.repeats import repeats
from wbc.api import Stack
from wbc.tasks import (
    Constraint,
    EndEffector,
    Hold,
    JointLimits,
    LineContact,
    Posture,
    RigidGrasp,
    SlidingContact,
    SurfaceContact,
)
from wbc.tasks.base import Row, Rows

FOOT = "left_ankle_roll_link"


@pytest.mark.parametrize("calm", [True, False])
@pytest.mark.parametrize("gain", [10.0, 50.0])
def test_a_stretched_leg_neither_slides_nor_chatters(gain: float, calm: bool) -> None:
    """Without what is tested here 26 mm and 96 to 164 flips."""
    robot = wbc.robots.load("g1")
    run = held.pulled(
        robot, "pelvis", (FOOT,), 1 / 120, 180, q=robot.neutral, speed=np.array([0, 0, 0.5]), gain=gain, calm=calm
    )
    assert run.drift < 1e-4
    assert run.flips == 0
    assert run.statuses == {"solved": 180}


@pytest.mark.parametrize("seed", range(repeats(6)))
def test_held_frames_of_any_robot(seed: int) -> None:
    run = held.drawn(seed, 300)
    assert run.drift < 1e-3 or run.statuses.keys() - {"solved"}, run
    assert run.flips <= 2, run
    assert run.said, run


@pytest.mark.parametrize("dt", [1 / 60, 1e-3])
def test_the_residual_at_the_end_of_the_tick_is_the_one_that_rows_ask_for(dt: float) -> None:
    """e(q (+) v dt) = (1 - gain dt) e(q) for a frame far from its target, whatever else moves, by Pinocchio."""
    robot, rng = wbc.robots.load("talos").with_limits(velocity=5.0), np.random.default_rng(5)
    foot = "left_sole_link"
    stack = Stack(robot, dt).add(Hold(foot, gain=4.0), name="foot").add(Posture(gain=20.0), name="posture")
    controller = stack.add(JointLimits()).compile(backend="vm")
    for _ in range(20):
        q, goal = (
            robot.integrate(robot.neutral, np.r_[np.zeros(6), 0.3 * rng.normal(size=robot.nv - 6)], 1.0) for _ in "ab"
        )
        pose = placement(robot, foot, q)
        target = pin.SE3(pin.exp3(rng.normal(0, 0.05, 3)) @ pose.rotation, pose.translation + rng.normal(0, 0.02, 3))
        controller.reset(q)
        controller["foot"].target, controller["posture"].target = target, goal
        step = controller.step(q)
        later = placement(robot, foot, robot.integrate(q, step.v, dt))
        off = [
            np.r_[p.translation - target.translation, pin.log3(p.rotation @ target.rotation.T)] for p in (pose, later)
        ]
        missed = off[1] - (1.0 - 4.0 * dt) * off[0]
        assert np.abs(missed).max() < 1.01e-3 * dt * max(1.0, stack.length)
        np.testing.assert_allclose(step.lost["foot"], missed, atol=1e-12)
        assert np.abs(step.v[6:]).max() > 1.0
        assert step.status == "solved"


@pytest.mark.parametrize(
    "item",
    [
        Hold(FOOT, kind="axis"),
        Hold(FOOT, kind="roll"),
        RigidGrasp(FOOT),
        SurfaceContact(FOOT, (0.05, 0.03)),
        LineContact(FOOT, 0.05),
        SlidingContact(FOOT),
    ],
    ids=lambda item: f"{type(item).__name__} {getattr(item, 'kind', '')}",
)
def test_every_item_that_holds_makes_up_for_what_it_loses(item: object) -> None:
    robot, dt = wbc.robots.load("g1"), 1 / 60
    stack = Stack(robot, dt).add(item, name="held").add(EndEffector("pelvis"), name="pelvis")
    controller = stack.add(Posture(), weight=1e-3).add(JointLimits()).compile(backend="vm")
    q = np.array(robot.neutral)
    home = placement(robot, "pelvis", q)
    for k in range(60):
        controller["pelvis"].target = pin.SE3(home.rotation, home.translation + k * dt * np.array([0.6, 0.2, 0.3]))
        step = controller.step(q)
        assert step.status == "solved"
        assert np.abs(step.lost["held"]).max() <= 1e-3 * dt * max(1.0, stack.length)
        q = robot.integrate(q, step.v, dt)
    free = [] if isinstance(item, SlidingContact) else [0, 1]
    foot = placement(robot, FOOT, q).translation - controller["held"].target.translation
    assert np.abs(foot[[*free, 2]]).max() < 3e-4


def test_what_cannot_be_made_up_for_is_said() -> None:
    """Joints that are fast and cannot brake, beside a base that cannot follow, carry the foot away within the tick."""
    robot = wbc.robots.load("g1")
    robot = robot.with_limits(acceleration=np.full(robot.nv, 5.0))
    stack = Stack(robot, 1 / 60).add(Hold(FOOT), name="foot").add(Posture()).add(JointLimits())
    controller = stack.compile(backend="vm")
    v = np.zeros(robot.nv)
    v[6:12] = 10.0
    jacobian = frame_jacobian(robot, FOOT, robot.neutral)
    v[:6] = -np.linalg.solve(jacobian[:, :6], jacobian[:, 6:] @ v[6:])
    step = controller.step(robot.neutral, v)
    assert step.status == "relaxed"
    assert {slack.item for slack in step.relaxed} == {"foot"}
    assert "What gave way here: foot" in str(step.explain())


@dataclass(frozen=True)
class Parabola(Constraint):
    """40 q^2 of a joint is held at 0 [m]: at q = 0 no rate changes it, and all of it is within the tick."""

    equality: ClassVar[bool] = True
    joint: str = ""

    def rows(self, robot: Any) -> tuple[Row, ...]:
        return (Row("height", "m/s"),)

    def residual(self, robot: Any, kin: Any, inputs: Any) -> ca.SX:
        return 40.0 * kin.joint(self.joint) ** 2

    def velocity_rows(self, robot: Any, kin: Any, inputs: Any, dt: ca.SX) -> Rows:
        return Rows(kin.jacobian(self.residual(robot, kin, inputs)), ca.SX(1, 1), ca.SX(1, 1))


@pytest.mark.parametrize("backend", ["vm", IN_PYTHON])
@pytest.mark.parametrize("acceleration", [1.0, np.inf])
def test_what_no_side_changes_makes_a_short_step_or_is_said(acceleration: float, backend: str) -> None:
    robot = wbc.robots.load("ur5").with_limits(acceleration=acceleration)
    stack = Stack(robot, 0.01).add(Parabola(joint="elbow_joint"), name="parabola").add(Posture(), name="posture")
    controller = stack.add(JointLimits()).compile(**way(backend))
    q, v = np.zeros(robot.nq), np.zeros(robot.nv)
    v[2] = 1.0
    controller.reset(q)
    controller["posture"].target = q + 0.5
    step = controller.step(q, v)
    lost = 40.0 * (0.01 * step.v[2]) ** 2
    np.testing.assert_allclose(step.lost["parabola"], lost, rtol=1e-9)
    if acceleration == np.inf:
        assert step.status == "solved"
        assert 0.0 < step.v[2] < 0.05
        return
    assert step.status == "relaxed"
    (slack,) = step.relaxed
    assert (slack.item, slack.row) == ("parabola", "height")
    assert slack.amount == pytest.approx(lost / 0.01)
    assert "Lost within the tick, which is long for how rows bend: parabola" in str(step.explain())


@pytest.mark.parametrize("calm", [True, False])
def test_all_ticks_agree(calm: bool) -> None:
    """The one in numpy and the one that all stacks share, where rows bend, joints are stopped and steps get shorter."""
    robot, dt = wbc.robots.load("go2"), 0.011
    stack = Stack(robot, dt, calm=calm)
    for foot in held.BODIES["go2"][1]:
        stack.add(Hold(foot, kind="position"), name=foot)
    stack.add(EndEffector("base", kind="position", gain=3.0), name="base").add(Posture(), weight=1e-3)
    shared, plain = (
        stack.add(JointLimits()).compile(**way(b)) if b == "vm" else stack.compile(**way(b)) for b in ("vm", IN_PYTHON)
    )
    q, ahead = np.array(robot.neutral), np.array([0.3, 0.1, 0.9])
    for k in range(100):
        for controller in (shared, plain):
            controller["base"].target = robot.neutral[:3] + ahead * k * dt
        steps = [controller.step(q) for controller in (shared, plain)]
        np.testing.assert_allclose(steps[0].v, steps[1].v, atol=1e-7)
        assert steps[0].status == steps[1].status
        for name, lost in steps[0].lost.items():
            np.testing.assert_allclose(lost, steps[1].lost[name], atol=1e-10)
        q = robot.integrate(q, steps[0].v, dt)
