"""Declared coordinates: rates against Pinocchio, drift against its derivative, bad declarations."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from tests.models import placement
from wbc import WbcError
from wbc.analysis.jacobians.numeric import NumericRows
from wbc.coordinates import (
    AxisRows,
    BodyRows,
    Coordinate,
    FollowRows,
    JointRows,
    KeepRows,
    OnCircle,
    OnCylinder,
    OnLine,
    OnPlane,
    OnSphere,
    PitchPlaneRows,
    PlaneAngleRows,
    PointRows,
    expressions,
)
from wbc.errors import NotFiniteError, RangeError, ShapeError, UnknownNameError
from wbc.robot import Robot
from wbc.robots import operator_arm
from wbc.symbolic.kinematics import Kinematics, Pose
from wbc.symbolic.tracer import Tracer
from wbc.tasks import PlaneReference

ROBOT = operator_arm("ssrms").robot
TREE = operator_arm("spdm").robot
STATES = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 7))
BETA = BodyRows("F2", expressed="F3", translation=(), rotation=(1,), name="beta")


def rate_rows(arm: str) -> tuple[Coordinate, ...]:
    """Declarations that rank analysis knows, of an arm by the prefix of its names."""
    return (
        BodyRows(f"{arm}tip"),
        BodyRows(f"{arm}tip", base=f"{arm}F3", expressed=f"{arm}F5"),
        BodyRows(f"{arm}tip", base=f"{arm}F2", expressed=f"{arm}F2", translation=(0, 2), rotation=()),
        BodyRows(f"{arm}end3", rotation=()),
        BodyRows(f"{arm}F6", translation=()),
        BodyRows(f"{arm}F2", expressed=f"{arm}F3", translation=(), rotation=(1,), name="beta"),
        JointRows(f"{arm}joint4"),
    )


def held_rows(arm: str) -> tuple[Coordinate, ...]:
    """Declarations whose drift is known."""
    return (
        *rate_rows(arm)[:5],
        JointRows(f"{arm}joint4"),
        PlaneAngleRows(
            f"{arm}F3",
            f"{arm}F4",
            f"{arm}F5",
            axis=f"{arm}joint3",
            reference=PlaneReference((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
        ),
        PlaneAngleRows(f"{arm}F3", f"{arm}F4", f"{arm}F5"),
        PointRows(f"{arm}tip", OnPlane((0.0, 0.0, 1.0), (0.0, 1.0, 2.0))),
        PointRows(f"{arm}tip", OnSphere((1.0, 0.0, 1.0), 2.0), base=f"{arm}F2"),
        PointRows(f"{arm}end3", OnCylinder((1.0, 0.0, 1.0), (0.0, 1.0, 2.0), 2.0)),
        PointRows(f"{arm}tip", OnLine((1.0, 0.0, 1.0), (0.0, 1.0, 2.0))),
        PointRows(f"{arm}tip", OnCircle((1.0, 0.0, 1.0), (0.0, 1.0, 2.0), 2.0)),
    )


#: Of an arm by itself, and of one of two that a body carries
RATES = [(robot, rows) for robot, arm in ((ROBOT, ""), (TREE, "arm2_")) for rows in rate_rows(arm)]
HELD = [(robot, rows) for robot, arm in ((ROBOT, ""), (TREE, "arm2_")) for rows in held_rows(arm)]


def rates(rows: Coordinate, q: np.ndarray, robot: Robot = ROBOT) -> np.ndarray:
    return np.asarray(expressions.rate_function(robot, (rows,))(q).full())


def states(robot: Robot) -> np.ndarray:
    return np.random.default_rng(0).uniform(-1.0, 1.0, (3, robot.nv))


def drift_function(rows: Coordinate, q0: np.ndarray, robot: Robot) -> ca.Function:
    """q -> e, with the reference of q0."""
    kin = Tracer(Kinematics(robot.model))
    given: Any = None
    if expressions.reference(robot, rows) is not None:
        given = expressions.here(robot, rows, q0)
        given = ca.SX(given) if isinstance(given, float) else Pose(ca.SX(given.rotation), ca.SX(given.translation))
    off = expressions.drift(robot, kin, rows, given)
    assert off is not None
    return ca.Function("drift", [kin.q], [kin.expand(off)])


@pytest.mark.parametrize(("robot", "rows"), RATES, ids=str)
def test_rates_are_pinocchios(robot: Robot, rows: Any) -> None:
    for q in states(robot):
        np.testing.assert_allclose(rates(rows, q, robot), NumericRows(robot).value([rows], q), atol=1e-11)


@pytest.mark.parametrize(("robot", "arm", "pitch"), [(ROBOT, "", 1), (TREE, "arm2_", 2)], ids=str)
def test_rate_of_the_pitch_plane_has_its_factor(robot: Robot, arm: str, pitch: int) -> None:
    """The rank analysis leaves 1/|r| out; a rate in rad/s does not."""
    rows, q = PitchPlaneRows(f"{arm}F3", f"{arm}F5"), states(robot)[0]
    shoulder, wrist = (placement(robot, f"{arm}{name}", q) for name in ("F3", "F5"))
    axis, span = shoulder.rotation[:, pitch], wrist.translation - shoulder.translation
    length = np.linalg.norm(span - axis * (axis @ span))
    np.testing.assert_allclose(length * rates(rows, q, robot), NumericRows(robot).value([rows], q), atol=1e-11)


@pytest.mark.parametrize(("robot", "arm"), [(ROBOT, ""), (TREE, "arm2_")], ids=str)
def test_rate_about_an_axis_is_a_part_of_the_angular_velocity(robot: Robot, arm: str) -> None:
    q, frame = states(robot)[1], f"{arm}F6"
    for attached, base in (("world", "world"), (f"{arm}F3", "world"), (f"{arm}F5", f"{arm}F2")):
        whole = NumericRows(robot).value([BodyRows(frame, base=base, expressed=attached, translation=())], q)
        found = rates(AxisRows(frame, (1.0, 2.0, -2.0), attached=attached, base=base), q, robot)
        np.testing.assert_allclose(found, np.array([[1.0, 2.0, -2.0]]) / 3.0 @ whole, atol=1e-12)


@pytest.mark.parametrize(("robot", "rows"), HELD, ids=lambda r: f"{type(r).__name__} {r}")
def test_drift_vanishes_at_its_reference_and_has_the_rates_as_derivative(robot: Robot, rows: Any) -> None:
    q, h = states(robot)[2], 1e-6
    off = drift_function(rows, q, robot)
    if not isinstance(rows, PointRows):
        assert np.abs(off(q).full()).max() < 1e-12
    for direction in np.random.default_rng(1).uniform(-1.0, 1.0, (3, robot.nv)):
        slope = (off(q + h * direction) - off(q - h * direction)).full().ravel() / (2 * h)
        np.testing.assert_allclose(rates(rows, q, robot) @ direction, slope, atol=2e-8)


def test_what_has_no_integral_is_told_its_drift() -> None:
    moving = BodyRows("tip", expressed="F5", translation=(0,), rotation=())
    for rows in (BETA, PitchPlaneRows("F3", "F5"), AxisRows("F6", (0.0, 0.0, 1.0)), moving):
        assert expressions.drift(ROBOT, Tracer(Kinematics(ROBOT.model)), rows, None) is None
        assert [i.name for i in KeepRows(rows).inputs(ROBOT)] == ["speed", "gain", "drift"]
        assert expressions.rate_only(ROBOT, rows).all()
    for rows in (BodyRows("tip"), JointRows("joint1"), PlaneAngleRows("F3", "F4", "F5")):
        assert not expressions.rate_only(ROBOT, rows).any()
    part = BodyRows("tip", expressed="world", rotation=(0, 1))
    assert expressions.rate_only(ROBOT, part).tolist() == [False] * 3 + [True] * 2


def test_values_of_a_set_are_distances_from_it() -> None:
    place, axis = (1.0, 0.0, 1.0), (0.0, 1.0, 2.0)
    for x in np.random.default_rng(0).normal(size=(5, 3)):
        off = x - place
        height = off @ axis / np.sqrt(5.0)
        aside, far = np.sqrt(off @ off - height**2), np.linalg.norm(off)
        for point_set, expected in (
            (OnPlane(place, axis), [height]),
            (OnSphere(place, 2.0), [far - 2.0]),
            (OnCylinder(place, axis, 2.0), [aside - 2.0]),
            (OnCircle(place, axis, 2.0), [height, far - 2.0]),
        ):
            assert ca.DM(point_set.values(ca.SX(x))).full()[:, 0] == pytest.approx(expected)
        assert np.linalg.norm(ca.DM(OnLine(place, axis).values(ca.SX(x))).full()) == pytest.approx(aside)


def test_three_points_stand_for_a_pose() -> None:
    """sum |v + w x d_i|^2 = e'We with W's published eigenvalues at d = 1, whatever the axes of the rows."""
    one = np.ones(3)
    for d, expressed in ((1.0, None), (0.4, "F5")):
        pose = BodyRows("tip", expressed=expressed)
        kin = Tracer(Kinematics(ROBOT.model))
        task = FollowRows(pose, metric=d)
        spread = ca.Function("spread", [kin.q], [kin.expand(task.spread(ROBOT, kin))])(STATES[0]).full()
        assert [row.label for row in task.rows(ROBOT)][:4] == ["xx", "xy", "xz", "yx"]
        own = np.block([[3 * np.eye(3), -d * pin.skew(one)], [d * pin.skew(one), 2 * d * d * np.eye(3)]])
        turn = placement(ROBOT, "tip", STATES[0]).rotation
        if expressed:
            turn = placement(ROBOT, expressed, STATES[0]).rotation.T @ turn
        both = np.kron(np.eye(2), turn)
        np.testing.assert_allclose(spread.T @ spread, both @ own @ both.T, atol=1e-12)
        if d == 1.0:
            wanted = (0.6972244, 0.6972244, 2.0, 3.0, 4.3027756, 4.3027756)
            np.testing.assert_allclose(np.linalg.eigvalsh(spread.T @ spread), wanted, atol=1e-7)


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: KeepRows(JointRows("joint9")).validate(ROBOT), UnknownNameError),
        (lambda: KeepRows(AxisRows("F9", (0, 0, 1))).validate(ROBOT), UnknownNameError),
        (lambda: KeepRows(AxisRows("F3", (0, 0, 1), attached="F9")).validate(ROBOT), UnknownNameError),
        (lambda: KeepRows(BodyRows("base")).validate(ROBOT), RangeError),
        (lambda: KeepRows(BodyRows("F3", base="end3")).validate(ROBOT), RangeError),
        (lambda: KeepRows(PitchPlaneRows("F3", "F3")).validate(ROBOT), RangeError),
        (lambda: KeepRows(PlaneAngleRows("F3", "F4", "F9")).validate(ROBOT), UnknownNameError),
        (lambda: KeepRows(JointRows("joint1"), gain=-1.0), RangeError),
        (lambda: KeepRows(JointRows("joint1"), fastest_return=0.0), RangeError),
        (lambda: AxisRows("F3", (0.0, 0.0, 0.0)), RangeError),
        (lambda: PointRows("tip", "plane"), ShapeError),
        (lambda: OnSphere((0, 0, 0), 0.0), RangeError),
        (lambda: OnPlane((0, 0, np.nan), (0, 0, 1)), NotFiniteError),
        (lambda: FollowRows(BETA, metric=1.0), RangeError),
        (lambda: FollowRows(BodyRows("tip"), metric=0.0), RangeError),
    ],
)
def test_bad_declarations(make: Any, error: type[WbcError]) -> None:
    with pytest.raises(error):
        make()
