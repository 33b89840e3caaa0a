"""Hold: rows against Pinocchio's Jacobian and logarithm, the default target, the kinds, bad declarations."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.constraints.robots import robot
from tests.evaluation import probe, random_configuration
from wbc.api import Stack
from wbc.errors import NotFiniteError, ShapeError
from wbc.tasks.base import SacrificeOrder
from wbc.tasks.hold import Hold


def test_default_target_is_the_pose_of_the_first_step() -> None:
    bot = robot("talos")
    item, q = Hold("gripper_left_base_link"), random_configuration(bot, np.random.default_rng(22))
    assert [i.default for i in item.inputs(bot) if i.name == "target"] == [None]
    _, lower, upper = probe(item, bot)(q, **item.initial(bot, q))
    assert lower == pytest.approx(np.zeros(6), abs=1e-12)
    assert (lower == upper).all()


@pytest.mark.parametrize("tilt", [0.0, 1e-7, 0.05, 1.2])
def test_roll_is_the_turn_about_the_target_s_axis(tilt: float) -> None:
    """A tilted frame that moves by the rows keeps its roll; its rate is that of the angle, by finite differences."""
    bot, rng = robot("panda"), np.random.default_rng(24)
    hold, data = probe(Hold("panda_hand", "roll"), bot), bot.model.createData()
    number = bot.model.getFrameId("panda_hand")

    def roll(q: np.ndarray, target: pin.SE3) -> float:
        pin.framesForwardKinematics(bot.model, data, q)
        x = target.rotation.T @ data.oMf[number].rotation[:, 0]
        return float(np.arctan2(x[1], x[0]))

    for _ in range(5):
        q, v = random_configuration(bot, rng), rng.normal(0.0, 1.0, bot.nv)
        pin.framesForwardKinematics(bot.model, data, q)
        lean = pin.exp3(tilt * np.array([0.6, 0.8, 0.0])) @ pin.exp3(np.array([0.0, 0.0, rng.uniform(-3, 3)]))
        target = pin.SE3(data.oMf[number].rotation @ lean, rng.uniform(-1, 1, 3))
        matrix, lower, upper = hold(q, target=target, gain=2.0)
        assert matrix.shape[0] == 4
        assert (lower == upper).all()
        assert lower[3] == pytest.approx(-2.0 * roll(q, target), abs=1e-9)
        step = 1e-6
        change = [roll(pin.integrate(bot.model, q, sign * step * v), target) for sign in (-1.0, 1.0)]
        assert matrix[3] @ v == pytest.approx((change[1] - change[0]) / (2 * step), abs=1e-6)


def test_rows_and_order() -> None:
    bot = robot("panda")
    assert [r.label for r in Hold("panda_hand").rows(bot)] == ["x", "y", "z", "rx", "ry", "rz"]
    assert [r.unit for r in Hold("panda_hand").rows(bot)] == ["m/s"] * 3 + ["rad/s"] * 3
    assert [r.unit for r in Hold("panda_hand", "position").rows(bot)] == ["m/s"] * 3
    assert [r.unit for r in Hold("panda_hand", "orientation").rows(bot)] == ["rad/s"] * 3
    assert [r.label for r in Hold("panda_hand", "roll").rows(bot)] == ["x", "y", "z", "roll"]
    assert Hold.order == SacrificeOrder.HOLD


@pytest.mark.parametrize("kind", ["position", "orientation"])
def test_the_part_of_a_pose_that_counts_is_a_target(kind: str) -> None:
    """It gives the command of the whole pose, alone and for many robots; what is neither is refused and changes
    nothing."""
    bot, rng = robot("panda"), np.random.default_rng(25)
    stack = Stack(bot, 0.01).add(Hold("panda_hand", kind), name="hold")  # type: ignore[arg-type]
    controller, q = stack.compile(backend="vm"), random_configuration(bot, rng)
    pose = pin.SE3(pin.exp3(rng.uniform(-1.5, 1.5, 3)), rng.uniform(-1, 1, 3))
    whole = [pose, pose.homogeneous, pin.SE3ToXYZQUAT(pose), (pose.translation, pose.rotation)]
    place = pose.translation
    parts = [place, place.tolist(), tuple(place)]
    if kind == "orientation":
        parts = [pose.rotation, pin.Quaternion(pose.rotation).coeffs(), pose.rotation.tolist()]
    found = set()
    for target in (*whole, *parts):
        controller["hold"].target = target
        found.add(tuple(np.round(controller.step(q).v, 9)))
        controller.set(hold=target)
        found.add(tuple(np.round(controller.step(q).v, 9)))
    assert len(found) == 1
    for wrong in (np.zeros(2), np.zeros((2, 3)), place * np.nan, "here", None, [[1.0], [2.0, 3.0]], [pose, pose, pose]):
        with pytest.raises((ShapeError, NotFiniteError), match=r"hold\.target"):
            controller["hold"].target = wrong
    assert tuple(np.round(controller.step(q).v, 9)) in found
    batch = controller.batch(3)
    for targets in (parts[0], [parts[0]] * 3, [pose] * 3, pose, [whole[2], parts[0], whole[1]]):
        batch.set(hold=targets)
        assert np.round(batch.step(np.tile(q, (3, 1))).v, 9).tolist() == [list(v) for v in found] * 3
