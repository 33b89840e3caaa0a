"""Jacobians through placeholders: against Pinocchio by central differences, and smaller than plain differentiation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from tests.symbolic.referee import distance, load, random_state
from wbc.errors import UnknownNameError
from wbc.symbolic import Kinematics, Pose, Tracer, rotations as rot

OFFSET = (0.1, -0.2, 0.3)
TARGET = Rotation.from_rotvec((0.4, -1.1, 0.7)).as_matrix()


@dataclass(frozen=True)
class Case:
    """A robot, two of its frames and one of its joints."""

    file: str
    base: str
    tip: str
    other: str
    joint: str


CASES = {
    "panda": Case("panda_description/urdf/panda.urdf", "fixed", "panda_hand_tcp", "panda_link4", "panda_joint4"),
    "kinova": Case(
        "kinova_description/robots/kinova.urdf", "fixed", "j2s6s200_link_6", "j2s6s200_link_2", "j2s6s200_joint_1"
    ),
    "talos": Case(
        "talos_data/robots/talos_reduced.urdf", "floating", "arm_left_7_link", "leg_right_6_link", "arm_left_4_joint"
    ),
}


class State:
    """The same quantities by Pinocchio at one configuration."""

    def __init__(self, model: pin.Model, case: Case, q: np.ndarray) -> None:
        self.model, self.case, self.q, data = model, case, q, model.createData()
        pin.framesForwardKinematics(model, data, q)
        self.tip, self.other = (data.oMf[model.getFrameId(f)].copy() for f in (case.tip, case.other))
        self.com = pin.centerOfMass(model, data, q).copy()

    def angle(self) -> float:
        j = self.model.getJointId(self.case.joint)
        q = self.q[self.model.idx_qs[j] : self.model.idx_qs[j] + self.model.nqs[j]]
        return float(q[0]) if len(q) == 1 else float(np.arctan2(q[1], q[0]))


def relative(kin: Tracer, case: Case) -> Pose:
    return kin.pose(case.other).inverse().times(kin.pose(case.tip))


def between(s: State) -> pin.SE3:
    return s.other.actInv(s.tip)


#: name -> (expression in placeholders, its value by Pinocchio)
EXPRESSIONS: dict[str, tuple[Callable[[Tracer, Case], ca.SX], Callable[[State], np.ndarray]]] = {
    "position": (lambda k, c: k.position(c.tip, OFFSET), lambda s: s.tip.act(np.array(OFFSET))),
    "relative pose": (
        lambda k, c: ca.vertcat(relative(k, c).position, ca.vec(relative(k, c).rotation)),
        lambda s: np.append(between(s).translation, between(s).rotation.ravel(order="F")),
    ),
    "relative logarithm": (
        lambda k, c: rot.log3(relative(k, c).rotation @ ca.SX(TARGET.T)),
        lambda s: pin.log3(between(s).rotation @ TARGET.T),
    ),
    "rotation error": (
        lambda k, c: k.rotation_error(c.tip, "world", ca.SX(TARGET)),
        lambda s: pin.log3(s.tip.rotation @ TARGET.T),
    ),
    "rotation error to a frame": (
        lambda k, c: k.rotation_error(c.tip, c.other, ca.SX(TARGET)),
        lambda s: pin.log3(between(s).rotation @ TARGET.T),
    ),
    "rotation error to a target that moves with q": (
        lambda k, c: k.rotation_error(
            c.tip, "world", rot.from_axis_angle([0.0, 0.0, 1.0], ca.cos(k.joint(c.joint)), ca.sin(k.joint(c.joint)))
        ),
        lambda s: pin.log3(s.tip.rotation @ Rotation.from_rotvec((0, 0, s.angle())).as_matrix().T),
    ),
    "centre of mass over a foot": (
        lambda k, c: k.pose(c.other).inverse_point(k.center_of_mass()),
        lambda s: s.other.actInv(s.com),
    ),
    "joint times height": (
        lambda k, c: k.joint(c.joint) * k.position(c.tip)[2] + ca.sumsqr(k.center_of_mass()),
        lambda s: np.array([s.angle() * s.tip.translation[2] + s.com @ s.com]),
    ),
    "coordinates": (lambda k, c: k.q[-2:] * k.q[-1], lambda s: s.q[-2:] * s.q[-1]),
}


@cache
def kinematics(robot: str) -> Kinematics:
    return Kinematics(load(CASES[robot].file, CASES[robot].base))


def functions(robot: str, name: str) -> tuple[ca.Function, ca.Function, ca.Function]:
    """(value, Jacobian through placeholders, Jacobian by plain differentiation)."""
    tracer = Tracer(kinematics(robot))
    expression = EXPRESSIONS[name][0](tracer, CASES[robot])
    value, jacobian = tracer.expand(expression), tracer.jacobian(expression)
    plain = tracer.kinematics.derivative(value)
    return tuple(ca.Function("f", [tracer.q], [out]) for out in (value, jacobian, plain))


@pytest.mark.parametrize("robot", CASES)
@pytest.mark.parametrize("name", EXPRESSIONS)
def test_value_and_jacobian(robot: str, name: str) -> None:
    """Central differences of Pinocchio's value along pin.integrate, step 1e-5: 1e-8 of truncation and rounding."""
    case, model = CASES[robot], kinematics(robot).model
    q, _, _ = random_state(model, f"tracer {robot}")
    value, jacobian, plain = functions(robot, name)
    truth = EXPRESSIONS[name][1]
    assert distance(value(q).full().ravel(), truth(State(model, case, q))) < 1e-12
    h = 1e-5
    columns = []
    for unit in np.eye(model.nv):
        plus, minus = (truth(State(model, case, pin.integrate(model, q, s * h * unit))) for s in (1, -1))
        columns.append((plus - minus) / (2 * h))
    assert distance(jacobian(q).full(), np.array(columns).T) < 1e-7
    assert distance(jacobian(q).full(), plain(q).full()) < 1e-11


#: Coordinates have no kinematics to save on, and a logarithm written by hand has nine derivatives by the entries of
#: its rotation, more than the seven joints of an arm: that is what ``rotation_error`` is for.
SAVING = [name for name in EXPRESSIONS if name not in {"coordinates", "relative logarithm"}]


@pytest.mark.parametrize("robot", CASES)
@pytest.mark.parametrize("name", SAVING)
def test_the_jacobian_is_smaller_than_by_plain_differentiation(robot: str, name: str) -> None:
    _, jacobian, plain = functions(robot, name)
    assert jacobian.n_instructions() < plain.n_instructions()


def test_unknown_names() -> None:
    tracer = Tracer(kinematics("panda"))
    with pytest.raises(UnknownNameError, match="'panda_hand'"):
        tracer.pose("panda_hnd")
    with pytest.raises(UnknownNameError, match="'panda_joint3'"):
        tracer.joint("panda_jonit3")
    with pytest.raises(UnknownNameError):
        Tracer(kinematics("talos")).joint("root_joint")


def test_the_world_costs_nothing() -> None:
    tracer = Tracer(kinematics("panda"))
    assert tracer.jacobian(tracer.position("world")).nnz() == 0
