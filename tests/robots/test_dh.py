"""Denavit-Hartenberg chains against products of the textbook matrices in plain numpy."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.refusals import assert_refused
from wbc.errors import BoundsError, DuplicateNameError, NotFiniteError, RangeError, ShapeError, UnknownNameError
from wbc.robots import DHRow

#: Craig, Introduction to Robotics, figure 3.21 (modified convention), lengths of the PUMA 560 in metres
PUMA_MODIFIED = [
    DHRow(convention="modified"),
    DHRow(alpha=-pi / 2, convention="modified"),
    DHRow(a=0.4318, d=0.1491, convention="modified"),
    DHRow(a=0.0203, alpha=-pi / 2, d=0.4331, convention="modified"),
    DHRow(alpha=pi / 2, convention="modified"),
    DHRow(alpha=-pi / 2, convention="modified"),
]
PUMA_STANDARD = [
    DHRow(alpha=pi / 2),
    DHRow(a=0.4318),
    DHRow(a=0.0203, d=0.15005, alpha=-pi / 2),
    DHRow(d=0.4318, alpha=pi / 2),
    DHRow(alpha=-pi / 2),
    DHRow(),
]
#: Siciliano et al., Robotics, table 2.4: the Stanford manipulator, third joint prismatic
STANFORD = [
    DHRow(alpha=-pi / 2, d=0.4),
    DHRow(alpha=pi / 2, d=0.15),
    DHRow(joint="prismatic", theta=-pi / 2),
    DHRow(alpha=-pi / 2),
    DHRow(alpha=pi / 2),
    DHRow(d=0.1, theta=0.2),
]
CHAINS = {
    "planar": [DHRow(a=0.7), DHRow(a=0.4)],
    "puma_modified": PUMA_MODIFIED,
    "puma_standard": PUMA_STANDARD,
    "stanford": STANFORD,
    "mixed": [DHRow(a=0.1, alpha=0.3, d=0.2, theta=0.4), DHRow(0.5, 0.6, 0.7, 0.8, "prismatic", "modified")],
}


def matrix(row: DHRow, q: float) -> np.ndarray:
    """The homogeneous matrix of one row as the textbooks print it."""
    theta, d = row.theta, row.d
    if row.joint == "revolute":
        theta += q
    else:
        d += q
    ct, st, ca, sa, a = cos(theta), sin(theta), cos(row.alpha), sin(row.alpha), row.a
    if row.convention == "standard":
        rows = [[ct, -st * ca, st * sa, a * ct], [st, ct * ca, -ct * sa, a * st], [0, sa, ca, d], [0, 0, 0, 1]]
    else:
        rows = [[ct, -st, 0, a], [st * ca, ct * ca, -sa, -sa * d], [st * sa, ct * sa, ca, ca * d], [0, 0, 0, 1]]
    return np.array(rows)


@pytest.mark.parametrize("name", CHAINS)
def test_chain_against_matrix_products(name: str) -> None:
    rows = CHAINS[name]
    tool = pin.SE3.Random()
    robot = wbc.robots.from_dh(rows, name=name, tool=tool)
    assert (robot.name, robot.nv) == (name, len(rows))
    data = robot.model.createData()
    rng = np.random.default_rng(1)
    for _ in range(20):
        q = rng.uniform(-3, 3, len(rows))
        pin.framesForwardKinematics(robot.model, data, q)
        total = np.eye(4)
        for number, (row, value) in enumerate(zip(rows, q, strict=True), start=1):
            total = total @ matrix(row, value)
            link = data.oMf[robot.model.getFrameId(f"link{number}")].homogeneous
            np.testing.assert_allclose(link, total, atol=1e-12)
        tip = data.oMf[robot.model.getFrameId("tip")].homogeneous
        np.testing.assert_allclose(tip, total @ tool.homogeneous, atol=1e-12)


def test_limits_of_rows_and_their_overrides() -> None:
    rows = [
        DHRow(a=1, lower=-1, upper=2, velocity=3, acceleration=4, effort=5, name="pan"),
        DHRow(a=1, joint="prismatic", lower=0.5, upper=0.7),
    ]
    robot = wbc.robots.from_dh(rows, effort={"joint2": 9.0})
    np.testing.assert_array_equal(robot.limits.position_lower, [-1, 0.5])
    np.testing.assert_array_equal(robot.limits.position_upper, [2, 0.7])
    np.testing.assert_array_equal(robot.limits.velocity, [3, np.inf])
    np.testing.assert_array_equal(robot.limits.acceleration, [4, np.inf])
    np.testing.assert_array_equal(robot.limits.effort, [5, 9])
    np.testing.assert_allclose(robot.neutral, [0, 0.6])
    assert robot.dof_units == ("rad", "m")
    assert "kinematics only" in robot.notes["inertia"]
    same = wbc.robots.load(rows)
    assert same.joint_names == ("pan", "joint2")


def test_bad_rows() -> None:
    assert_refused(lambda: DHRow(joint="revolut"), UnknownNameError, "did you mean 'revolute'")
    assert_refused(lambda: DHRow(convention="craig"), UnknownNameError, "")
    assert_refused(lambda: DHRow(a=float("nan")), NotFiniteError, "")
    assert_refused(lambda: DHRow(lower=1, upper=0), BoundsError, "")
    assert_refused(lambda: DHRow(velocity=-1), RangeError, "")
    assert_refused(lambda: DHRow(upper=float("nan")), RangeError, "NaN")
    assert_refused(lambda: wbc.robots.from_dh([]), ShapeError, "")
    assert_refused(lambda: wbc.robots.load([1, 2]), ShapeError, "")
    assert_refused(lambda: wbc.robots.from_dh([DHRow(name="a"), DHRow(name="a")]), DuplicateNameError, "")
    assert_refused(lambda: wbc.robots.from_dh([DHRow()], speed=1.0), UnknownNameError, "")
