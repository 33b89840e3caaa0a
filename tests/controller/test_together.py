"""Several values in one call: as if set one by one, all or none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.controller.stacks import controller, robot
from wbc import Controller
from wbc.controller import core_of
from wbc.errors import NotFiniteError, RangeError, RotationError, ShapeError, UnknownNameError

POSE = pin.SE3(pin.exp3(np.array([0.1, 2.0, -0.4])), np.array([0.4, 0.1, 0.5]))
TURNED = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.zeros(3))


@pytest.fixture(params=["native", "vm"])
def arm(request: pytest.FixtureRequest) -> Controller:
    return controller("arm", "panda", backend=request.param)


def numbers(of: Controller) -> np.ndarray:
    return core_of(of).tick.p.copy()


GOOD: dict[str, dict[str, Any]] = {
    "a pose": {"hand": POSE},
    "a matrix": {"hand": POSE.homogeneous},
    "a matrix by columns": {"hand": np.asfortranarray(POSE.homogeneous)},
    "a pair": {"hand": (POSE.translation, pin.Quaternion(POSE.rotation).coeffs())},
    "two": {"hand": TURNED, "posture": np.linspace(-0.5, 0.5, 7)},
    "in another order": {"posture": np.linspace(-0.5, 0.5, 7), "hand": TURNED},
    "a part of an array": {"posture": np.linspace(-0.5, 0.5, 14)[::2]},
    "numbers of another type": {"hand": TURNED, "posture": [0, 1, 0, -1, 0, 1, 0]},
    "several of one item": {"hand": TURNED, "ball": {"pose": POSE, "velocity": np.arange(6.0), "margin": 0.03}},
    "nothing": {},
}


@pytest.mark.parametrize("case", GOOD)
def test_values_are_those_of_one_by_one(arm: Controller, case: str) -> None:
    q, values = robot("panda").neutral, GOOD[case]
    single = arm.clone()
    for _ in range(2):
        arm.set(**values)
        for name, value in values.items():
            single[name].set(**value) if isinstance(value, dict) else setattr(single[name], "target", value)
        assert arm.step(q)._data == single.step(q)._data
        assert arm.step(q + 0.1)._data == single.step(q + 0.1)._data


BAD: dict[str, tuple[dict[str, Any], type[Exception], str]] = {
    "item": ({"hand": POSE, "postur": np.zeros(7)}, UnknownNameError, "posture"),
    "no target": ({"ball": POSE}, ShapeError, "ball.*'pose'"),
    "value": ({"hand": {"taget": POSE}}, UnknownNameError, "hand.taget"),
    "no rotation": ({"posture": np.ones(7), "hand": 2.0 * np.eye(4)}, RotationError, "hand.target"),
    "a reflection": ({"hand": np.diag([1.0, 1.0, -1.0, 1.0])}, RotationError, "hand.target"),
    "a last row": ({"hand": np.vstack([np.eye(4)[:3], [0, 0, 1, 1]])}, Exception, "hand.target"),
    "not finite": ({"hand": POSE, "posture": np.full(7, np.nan)}, NotFiniteError, "posture.target"),
    "infinite place": ({"hand": pin.SE3(np.eye(3), np.array([0.0, np.inf, 0.0]))}, NotFiniteError, "hand.target"),
    "shape": ({"hand": POSE, "posture": np.zeros(6)}, ShapeError, "posture.target"),
    "flat pose": ({"hand": POSE.homogeneous.ravel()}, ShapeError, "hand.target"),
    "range": ({"posture": np.ones(7), "ball": {"rate": -1.0}}, RangeError, "ball.rate"),
}


@pytest.mark.parametrize("case", BAD)
def test_where_one_is_refused_none_is_written(arm: Controller, case: str) -> None:
    values, error, named = BAD[case]
    arm.reset(robot("panda").neutral)
    arm.set(hand=POSE, posture=np.zeros(7))
    before = numbers(arm)
    for _ in range(2):
        with pytest.raises(error, match=named):
            arm.set(**values)
        np.testing.assert_array_equal(numbers(arm), before)


def test_configurations_are_of_unit_length() -> None:
    """A posture of a floating robot."""
    one = controller("humanoid", backend="native")
    q = robot("talos").neutral
    one.reset(q)
    one.set(posture=q)
    before = numbers(one)
    with pytest.raises(RotationError, match=r"posture\.target"):
        one.set(posture=np.where(np.arange(q.size) == 6, 1.01, q))
    np.testing.assert_array_equal(numbers(one), before)
    # What its check admits is taken, whichever code checks
    one.set(posture=np.where(np.arange(q.size) == 6, 1.0 + 0.9e-6, q))
    assert numbers(one).tolist() != before.tolist()
