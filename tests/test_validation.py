"""Checks at the border: what passes comes out as a copy, what does not is named."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

from tests.refusals import assert_refused
from wbc import validation
from wbc.errors import NotFiniteError, RotationError, ShapeError

TURN = pin.exp3(np.array([0.3, -1.2, 0.7]))
PLACE = np.array([1.0, -2.0, 3.0])


@pytest.mark.parametrize(
    "value",
    [
        pin.SE3(TURN, PLACE),
        pin.SE3(TURN, PLACE).homogeneous,
        pin.SE3ToXYZQUAT(pin.SE3(TURN, PLACE)),
        pin.SE3(TURN, PLACE).homogeneous.tolist(),
    ],
    ids=["SE3", "matrix", "quaternion", "lists"],
)
def test_every_spelling_of_a_pose_is_the_same_pose(value: object) -> None:
    pose = validation.pose("target", value)
    np.testing.assert_allclose(pose.homogeneous, pin.SE3(TURN, PLACE).homogeneous, atol=1e-15)
    numbers = validation.pose_numbers("target", value)
    np.testing.assert_allclose(numbers, [*TURN[:, 0], *TURN[:, 1], *TURN[:, 2], *PLACE], atol=1e-15)


def test_a_pose_is_a_copy() -> None:
    given = pin.SE3(TURN, PLACE)
    pose, numbers = validation.pose("target", given), validation.pose_numbers("target", given)
    given.translation = np.zeros(3)
    np.testing.assert_array_equal(pose.translation, PLACE)
    np.testing.assert_array_equal(numbers[9:], PLACE)


@pytest.mark.parametrize("check", [validation.pose, validation.pose_numbers])
@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_are_refused(number: float, check: Callable[[str, object], object]) -> None:
    assert_refused(lambda: check("target", pin.SE3(TURN, np.array([0.0, number, 0.0]))), NotFiniteError, "target")
    broken = TURN.copy()
    broken[1, 2] = number
    assert_refused(lambda: check("target", pin.SE3(broken, PLACE)), NotFiniteError, "target")
    assert_refused(lambda: validation.rotation("target", broken), NotFiniteError, "target")


@pytest.mark.parametrize(
    "matrix",
    [2.0 * TURN, np.diag([1.0, 1.0, -1.0]) @ TURN, np.zeros((3, 3)), TURN + 1e-5 * np.eye(3)],
    ids=["scaled", "mirrored", "zero", "not orthonormal"],
)
def test_matrices_that_are_no_rotations_are_refused(matrix: np.ndarray) -> None:
    assert_refused(lambda: validation.rotation("target", matrix), RotationError, "target")
    for check in (validation.pose, validation.pose_numbers):
        with pytest.raises(RotationError, match="target"):
            check("target", pin.SE3(matrix, PLACE))


@pytest.mark.parametrize("seed", range(20))
def test_the_tolerance_is_the_frobenius_norm(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rotation = pin.exp3(rng.normal(size=3))
    push = rng.normal(size=(3, 3))
    push = rotation @ (push + push.T)
    push /= np.linalg.norm(rotation.T @ push + push.T @ rotation)
    inside, outside = (rotation + factor * validation.ROTATION_TOLERANCE * push for factor in (0.99, 1.01))
    np.testing.assert_array_equal(validation.rotation("target", inside), inside)
    np.testing.assert_array_equal(validation.pose_numbers("target", pin.SE3(inside, PLACE))[:3], inside[:, 0])
    assert_refused(lambda: validation.rotation("target", outside), RotationError, "")
    assert_refused(lambda: validation.pose_numbers("target", pin.SE3(outside, PLACE)), RotationError, "")


@pytest.mark.parametrize("value", [np.eye(2), np.zeros(5), "identity", None, [[1.0, 2.0], [3.0]]])
def test_other_shapes_are_refused(value: object) -> None:
    assert_refused(lambda: validation.pose("target", value), ShapeError, "target")
