"""FrameVelocityLimit: its rows times v against Pinocchio's frame velocities, in axes, relative, bad declarations."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.constraints.items import first, tip
from tests.constraints.robots import NAMES, robot
from tests.evaluation import probe, random_configuration
from wbc.errors import NotFiniteError, RangeError, ShapeError, UnknownNameError
from wbc.tasks.frame_velocity_limit import FrameVelocityLimit


def velocity(data: pin.Data, bot: object, frame: str) -> np.ndarray:
    twist = pin.getFrameVelocity(bot.model, data, bot.model.getFrameId(frame), pin.LOCAL_WORLD_ALIGNED)
    return np.concatenate([twist.linear, twist.angular])


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("axes", ["world", "tip"])
def test_rows_give_the_frame_velocity(name: str, axes: str) -> None:
    bot, rng = robot(name), np.random.default_rng(31)
    frame = tip(bot)
    limit = probe(FrameVelocityLimit(frame, linear=1.0, angular=2.0, axes=frame if axes == "tip" else "world"), bot)
    data = bot.model.createData()
    reference = pin.LOCAL if axes == "tip" else pin.LOCAL_WORLD_ALIGNED
    for _ in range(10):
        q, v = random_configuration(bot, rng), rng.normal(size=bot.nv)
        pin.forwardKinematics(bot.model, data, q, v)
        pin.updateFramePlacements(bot.model, data)
        truth = pin.getFrameVelocity(bot.model, data, bot.model.getFrameId(frame), reference)
        matrix, lower, upper = limit(q)
        assert matrix @ v == pytest.approx(np.concatenate([truth.linear, truth.angular]), abs=1e-10)
        assert upper.tolist() == [1.0] * 3 + [2.0] * 3
        assert (lower == -upper).all()


@pytest.mark.parametrize("name", NAMES)
def test_relative_to_a_moving_frame(name: str) -> None:
    """The derivative of the pose as seen from the other frame, turned into the axes of that frame."""
    bot, rng = robot(name), np.random.default_rng(32)
    frame, other = tip(bot), first(bot)
    limit = probe(FrameVelocityLimit(frame, linear=1.0, angular=1.0, axes=other, relative_to=other), bot)
    data = bot.model.createData()

    def seen(q: np.ndarray) -> pin.SE3:
        pin.framesForwardKinematics(bot.model, data, q)
        a, b = (data.oMf[bot.model.getFrameId(n)] for n in (other, frame))
        return a.inverse() * b

    for _ in range(5):
        q, v, step = random_configuration(bot, rng), rng.normal(size=bot.nv), 1e-5
        before, after = seen(pin.integrate(bot.model, q, -v * step)), seen(pin.integrate(bot.model, q, v * step))
        linear = (after.translation - before.translation) / (2 * step)
        angular = pin.log3(after.rotation @ before.rotation.T) / (2 * step)
        assert limit(q)[0] @ v == pytest.approx(np.concatenate([linear, angular]), abs=1e-7)


def test_limits_are_run_time_values_and_rows_are_the_limited_axes() -> None:
    bot = robot("panda")
    item = FrameVelocityLimit("panda_hand", linear=(np.inf, 0.2, 0.3), angular=(np.inf, np.inf, 1.0))
    assert [(r.label, r.unit) for r in item.rows(bot)] == [("y", "m/s"), ("z", "m/s"), ("rz", "rad/s")]
    assert [(i.name, i.size, i.unit) for i in item.inputs(bot)] == [("linear", 2, "m/s"), ("angular", 1, "rad/s")]
    full = probe(FrameVelocityLimit("panda_hand", linear=1.0, angular=1.0), bot)(bot.neutral)[0]
    matrix, _, upper = probe(item, bot)(bot.neutral)
    assert matrix == pytest.approx(full[[1, 2, 5]])
    assert upper.tolist() == [0.2, 0.3, 1.0]
    assert probe(item, bot)(bot.neutral, linear=[0.0, 4.0])[2].tolist() == [0.0, 4.0, 1.0]


def test_bad_declarations() -> None:
    bot = robot("panda")
    bad = [
        (ShapeError, {}),
        (ShapeError, {"linear": np.inf}),
        (ShapeError, {"linear": (1.0, 2.0)}),
        (RangeError, {"linear": -1.0}),
        (NotFiniteError, {"angular": (1.0, np.nan, 1.0)}),
    ]
    for error, arguments in bad:
        with pytest.raises(error, match="FrameVelocityLimit"):
            FrameVelocityLimit("panda_hand", **arguments)
    for field in ("frame", "axes", "relative_to"):
        arguments = {"frame": "panda_hand", field: "panda_hnd"}
        with pytest.raises(UnknownNameError, match=rf"FrameVelocityLimit\.{field}.*did you mean 'panda_hand'"):
            FrameVelocityLimit(linear=1.0, **arguments).validate(bot)
    for frame, other in (("world", "world"), ("panda_link0", "world"), ("panda_hand", "panda_link8")):
        with pytest.raises(RangeError, match="no joint moves"):
            FrameVelocityLimit(frame, linear=1.0, relative_to=other).validate(bot)
