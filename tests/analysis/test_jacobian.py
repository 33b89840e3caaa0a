"""Symbolic Jacobians against Pinocchio, and the choice of axes."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.analysis import BodyRows, ExactModel, JointRows, PitchPlaneRows, Rows, symbolic_jacobian
from wbc.analysis.jacobians.numeric import NumericRows, rank
from wbc.errors import RangeError, ShapeError, UnknownNameError
from wbc.robots import operator_arm

CASES: dict[str, tuple[Rows, ...]] = {
    "planar_rp": (BodyRows("tip"),),
    "ssrms": (
        BodyRows("tip"),
        BodyRows("tip", base="F4", expressed="F2", translation=(2, 0), rotation=(1,)),
        PitchPlaneRows("F3", "F5"),
        JointRows("joint5"),
    ),
    "spdm_arm": (BodyRows("end3", rotation=()), PitchPlaneRows("F3", "F5"), BodyRows("F6", expressed="F5")),
    "spdm": (BodyRows("arm1_F3", base="arm2_F2", expressed="arm2_F3"), BodyRows("arm2_end3", base="body_turned")),
}


@pytest.mark.parametrize("name", CASES)
def test_rows_are_those_of_pinocchio(name: str) -> None:
    robot, rows = operator_arm(name).robot, CASES[name]
    J = symbolic_jacobian(ExactModel(robot), rows, axes="world")
    for q in np.random.default_rng(0).uniform(-1.0, 1.0, (3, robot.nv)):
        np.testing.assert_allclose(J.value(q), NumericRows(robot).value(rows, q), atol=1e-12)
    assert len(J.names) == J.shape[0]


def test_cheapest_axes_leave_rank_and_singular_values() -> None:
    """The elbow's axes cost about a sixth of the base's: 317, 1455, 14 and 76, 232, 14 in print."""
    robot = operator_arm("ssrms").robot
    model = ExactModel(robot, {"L": 7.11, "D": -0.7026, "Y3": -1.0442, "Y5": -0.5692, "X7": 1.3589})
    base, best = (symbolic_jacobian(model, [BodyRows("tip")], axes=axes) for axes in ("world", None))
    assert best.axes == ("F4",)
    assert str(base.cost) == "282 add, 1337 mult, 12 trig"
    assert str(best.cost) == "66 add, 212 mult, 10 trig"
    q = np.linspace(-1.0, 0.8, 7)
    sigma = [np.linalg.svd(J.value(q), compute_uv=False) for J in (base, best)]
    np.testing.assert_allclose(*sigma, rtol=1e-12)
    assert rank(best.value(q)) == 6


def test_bad_declarations() -> None:
    model = ExactModel(operator_arm("ssrms").robot)
    with pytest.raises(RangeError):
        BodyRows("tip", translation=(0, 3))
    with pytest.raises(RangeError, match="expressed"):
        BodyRows("tip", translation=(0,))
    with pytest.raises(UnknownNameError, match="tip"):
        symbolic_jacobian(model, [BodyRows("tipp")])
    with pytest.raises(UnknownNameError):
        symbolic_jacobian(model, [JointRows("joint8")])
    with pytest.raises(ShapeError):
        symbolic_jacobian(model, [])
    with pytest.raises(UnknownNameError):
        symbolic_jacobian(model, [BodyRows("tip")], axes="nowhere")


def test_rows_of_a_robot_of_one_joint_have_one_column() -> None:
    """Pinocchio gives Jacobians of one degree of freedom as vectors."""
    model = pin.Model()
    model.appendBodyToJoint(
        model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "hip"), pin.Inertia.Random(), pin.SE3.Identity()
    )
    for name, x in (("shoulder", 0.0), ("wrist", 1.0)):
        place = pin.SE3(np.eye(3), np.array([x, 0.0, 0.3]))
        model.addFrame(pin.Frame(name, 1, place, pin.FrameType.OP_FRAME))
    robot = wbc.robots.load(model)
    rows = (PitchPlaneRows("shoulder", "wrist"), BodyRows("wrist"))
    np.testing.assert_allclose(NumericRows(robot).value(rows, robot.neutral)[:, 0], [0, 0, 1, 0, 0, 0, 1], atol=1e-15)
