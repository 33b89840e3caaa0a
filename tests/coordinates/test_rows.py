"""Declared coordinates: rates against Pinocchio, drift against its derivative, bad declarations."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from wbc import WbcError
from wbc.analysis.numeric import NumericRows
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
from wbc.robots import operator_arm
from wbc.symbolic.kinematics import Kinematics, Pose
from wbc.symbolic.tracer import Tracer
from wbc.tasks import PlaneReference

ROBOT = operator_arm("ssrms").robot
STATES = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 7))
BETA = BodyRows("F2", expressed="F3", translation=(), rotation=(1,), name="beta")
RATES: tuple[Coordinate, ...] = (
    BodyRows("tip"),
    BodyRows("tip", base="F3", expressed="F5"),
    BodyRows("tip", base="F2", expressed="F2", translation=(0, 2), rotation=()),
    BodyRows("end3", rotation=()),
    BodyRows("F6", translation=()),
    BETA,
    JointRows("joint4"),
)
HELD: tuple[Coordinate, ...] = (
    *RATES[:5],
    JointRows("joint4"),
    PlaneAngleRows("F3", "F4", "F5", axis="joint3", reference=PlaneReference((0.0, 0.0, 1.0), (1.0, 0.0, 0.0))),
    PlaneAngleRows("F3", "F4", "F5"),
    PointRows("tip", OnPlane((0.0, 0.0, 1.0), (0.0, 1.0, 2.0))),
    PointRows("tip", OnSphere((1.0, 0.0, 1.0), 2.0), base="F2"),
    PointRows("end3", OnCylinder((1.0, 0.0, 1.0), (0.0, 1.0, 2.0), 2.0)),
    PointRows("tip", OnLine((1.0, 0.0, 1.0), (0.0, 1.0, 2.0))),
    PointRows("tip", OnCircle((1.0, 0.0, 1.0), (0.0, 1.0, 2.0), 2.0)),
)


def rates(rows: Coordinate, q: np.ndarray) -> np.ndarray:
    return np.asarray(expressions.rate_function(ROBOT, (rows,))(q).full())


def drift_function(rows: Coordinate, q0: np.ndarray) -> ca.Function:
    """q -> e, with the reference of q0."""
    kin = Tracer(Kinematics(ROBOT.model))
    given: Any = None
    if expressions.reference(ROBOT, rows) is not None:
        given = expressions.here(ROBOT, rows, q0)
        given = ca.SX(given) if isinstance(given, float) else Pose(ca.SX(given.rotation), ca.SX(given.translation))
    off = expressions.drift(ROBOT, kin, rows, given)
    assert off is not None
    return ca.Function("drift", [kin.q], [kin.expand(off)])


@pytest.mark.parametrize("rows", RATES, ids=str)
def test_rates_are_pinocchios(rows: Any) -> None:
    for q in STATES:
        np.testing.assert_allclose(rates(rows, q), NumericRows(ROBOT).value([rows], q), atol=1e-11)


def test_rate_of_the_pitch_plane_has_its_factor() -> None:
    """The rank analysis leaves 1/|r| out; a rate in rad/s does not."""
    rows, q = PitchPlaneRows("F3", "F5"), STATES[0]
    data = ROBOT.model.createData()
    pin.framesForwardKinematics(ROBOT.model, data, q)
    shoulder, wrist = (data.oMf[ROBOT.model.getFrameId(name)] for name in ("F3", "F5"))
    axis, span = shoulder.rotation[:, 1], wrist.translation - shoulder.translation
    length = np.linalg.norm(span - axis * (axis @ span))
    np.testing.assert_allclose(length * rates(rows, q), NumericRows(ROBOT).value([rows], q), atol=1e-11)


def test_rate_about_an_axis_is_a_part_of_the_angular_velocity() -> None:
    for attached, base in (("world", "world"), ("F3", "world"), ("F5", "F2")):
        whole = NumericRows(ROBOT).value([BodyRows("F6", base=base, expressed=attached, translation=())], STATES[1])
        found = rates(AxisRows("F6", (1.0, 2.0, -2.0), attached=attached, base=base), STATES[1])
        np.testing.assert_allclose(found, np.array([[1.0, 2.0, -2.0]]) / 3.0 @ whole, atol=1e-12)


@pytest.mark.parametrize("rows", HELD, ids=lambda r: f"{type(r).__name__} {r}")
def test_drift_vanishes_at_its_reference_and_has_the_rates_as_derivative(rows: Any) -> None:
    q, h = STATES[2], 1e-6
    off = drift_function(rows, q)
    if not isinstance(rows, PointRows):
        assert np.abs(off(q).full()).max() < 1e-12
    for direction in np.random.default_rng(1).uniform(-1.0, 1.0, (3, 7)):
        slope = (off(q + h * direction) - off(q - h * direction)).full().ravel() / (2 * h)
        np.testing.assert_allclose(rates(rows, q) @ direction, slope, atol=2e-8)


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


def test_three_points_stand_for_a_pose() -> None:
    """sum |v + w x d_i|^2 = e'We with W's published eigenvalues at d = 1, whatever the axes of the rows."""
    one = np.ones(3)
    for d, expressed in ((1.0, None), (0.4, "F5")):
        pose = BodyRows("tip", expressed=expressed)
        kin = Tracer(Kinematics(ROBOT.model))
        task = FollowRows(pose, metric=d)
        spread = ca.Function("spread", [kin.q], [kin.expand(task._spread(kin))])(STATES[0]).full()
        assert [row.label for row in task.rows(ROBOT)][:4] == ["xx", "xy", "xz", "yx"]
        own = np.block([[3 * np.eye(3), -d * pin.skew(one)], [d * pin.skew(one), 2 * d * d * np.eye(3)]])
        data = ROBOT.model.createData()
        pin.framesForwardKinematics(ROBOT.model, data, STATES[0])
        turn = data.oMf[ROBOT.model.getFrameId("tip")].rotation
        if expressed:
            turn = data.oMf[ROBOT.model.getFrameId(expressed)].rotation.T @ turn
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
        (lambda: KeepRows(JointRows("joint1"), pull=0.0), RangeError),
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
