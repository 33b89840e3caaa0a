"""Curvature of the work of fixed forces and torques: against differences of what Pinocchio says they do."""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.repeats import covering
from wbc.symbolic.curvature import AppliedForce, curvature
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.tracer import Tracer
from wbc.tasks import AxisAlign, Distance

FRAMES = {
    "panda": "panda_hand_tcp",
    "kinova": "j2s6s200_end_effector",
    "talos": "gripper_left_base_link",
    "tiago": "arm_tool_link",
}
STEP = 1e-6


@pytest.mark.parametrize("kind", ["force", "torque", "mass"])
@pytest.mark.parametrize("name", FRAMES)
def test_against_differences(name: str, kind: str) -> None:
    """Revolute, unbounded and prismatic joints, floating and planar bases; 1e-7 of the largest entry."""
    robot = wbc.robots.load(name, shapes="none")
    model, data, rng = robot.model, robot.model.createData(), np.random.default_rng(3)
    frame = model.getFrameId(FRAMES[name])
    q = pin.integrate(model, robot.neutral, 0.3 * rng.normal(size=robot.nv))
    vector = rng.normal(size=3)

    def torques(at: np.ndarray) -> np.ndarray:
        pin.computeJointJacobians(model, data, at)
        pin.updateFramePlacements(model, data)
        jacobian = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        rows = {"force": jacobian[:3], "torque": jacobian[3:]}
        return (rows[kind] if kind != "mass" else pin.jacobianCenterOfMass(model, data, at)).T @ vector

    columns = [
        (torques(pin.integrate(model, q, d)) - torques(pin.integrate(model, q, -d))) / (2 * STEP)
        for d in STEP * np.eye(robot.nv)
    ]
    wanted = 0.5 * (np.array(columns) + np.array(columns).T)
    kinematics = Kinematics(model)
    K = curvature(kinematics, [AppliedForce(kind, FRAMES[name], ca.SX(ca.DM(vector)))])  # type: ignore[arg-type]
    found = np.array(ca.Function("K", [kinematics.q], [K])(q))
    assert np.abs(found - wanted).max() < 1e-7 * max(1.0, float(np.abs(wanted).max()))


def test_an_expression_pulls_at_what_it_is_made_of() -> None:
    """The second derivative of a height is that of a force straight up."""
    robot = wbc.robots.load("panda", shapes="none")
    kinematics = Kinematics(robot.model)
    tracer = Tracer(kinematics)
    height = 2.0 * tracer.position(FRAMES["panda"])[2]
    K = curvature(kinematics, tracer.forces(height))
    plain = ca.hessian(2.0 * kinematics.pose(FRAMES["panda"]).position[2], kinematics.q)[0]
    difference = ca.Function("d", [kinematics.q], [K - plain])
    assert np.abs(np.array(difference(robot.neutral))).max() < 1e-12


@pytest.mark.parametrize(("name", "other"), [("talos", "torso_2_link"), ("tiago", "world")])
def test_a_distance_bends_across_its_line(name: str, other: str) -> None:
    """The force along the line of two points turns with it, wherever the points come from."""
    robot = wbc.robots.load(name, shapes="none")
    model, data, rng = robot.model, robot.model.createData(), np.random.default_rng(5)
    q = pin.integrate(model, robot.neutral, 0.3 * rng.normal(size=robot.nv))
    offset, point = rng.normal(size=(2, 3))

    def slope(at: np.ndarray) -> np.ndarray:
        pin.computeJointJacobians(model, data, at)
        pin.updateFramePlacements(model, data)
        ends = []
        for frame, place in ((FRAMES[name], offset), (other, point)):
            index = model.getFrameId(frame) if frame != "world" else 0
            arm = data.oMf[index].rotation @ place
            rows = pin.getFrameJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED)
            ends.append((data.oMf[index].translation + arm, rows[:3] - pin.skew(arm) @ rows[3:]))
        between = ends[0][0] - ends[1][0]
        return np.asarray((ends[0][1] - ends[1][1]).T @ between / np.linalg.norm(between))

    columns = [
        (slope(pin.integrate(model, q, d)) - slope(pin.integrate(model, q, -d))) / (2 * STEP)
        for d in STEP * np.eye(robot.nv)
    ]
    wanted = 0.5 * (np.array(columns) + np.array(columns).T)
    kinematics = Kinematics(model)
    tracer, item = Tracer(kinematics), Distance(FRAMES[name], other, tuple(offset), tuple(point))
    error = item.error(robot, tracer, {"target": ca.SX(0), "point": ca.SX(ca.DM(point))})
    found = np.array(ca.Function("K", [kinematics.q], [curvature(kinematics, tracer.forces(error))])(q))
    assert np.abs(found - wanted).max() < 1e-7 * max(1.0, float(np.abs(wanted).max()))


@cache
def aligned(name: str, base: str) -> ca.Function:
    """(q, target, force) -> error of an axis, its Jacobian, curvature for the force."""
    robot = wbc.robots.load(name, shapes="none")
    kinematics = Kinematics(robot.model)
    tracer, item = Tracer(kinematics), AxisAlign(FRAMES[name], relative_to=base)
    target, force = ca.SX.sym("target", 3), ca.SX.sym("force", 2)
    inputs = {"target": target, "feedforward": ca.SX(3, 1)}
    error, J = item.error(robot, tracer, inputs), item.jacobian(robot, tracer, inputs)
    parts = [tracer.expand(error), tracer.expand(J), curvature(kinematics, tracer.forces(ca.dot(force, error)))]
    return ca.Function("H", [kinematics.q, target, force], parts)


@pytest.mark.parametrize(
    ("where", "angle"),
    covering([("panda", "world"), ("talos", "world"), ("talos", "torso_2_link")], [0.3, 1.5, 2.6]),
)
def test_an_axis_bends_like_its_angle_and_never_about_itself(where: tuple[str, str], angle: float) -> None:
    """J'J and the curvature for the force e are the second derivative of theta^2 / 2; a turn about the axis is flat.

    Beyond 2.8 rad, where cot theta - 1/theta < -3, less of it would count.
    """
    name, base = where
    robot = wbc.robots.load(name, shapes="none")
    model, data, rng = robot.model, robot.model.createData(), np.random.default_rng(7)
    q = pin.integrate(model, robot.neutral, 0.3 * rng.normal(size=robot.nv))

    def axis(at: np.ndarray) -> np.ndarray:
        pin.framesForwardKinematics(model, data, at)
        turn = data.oMf[model.getFrameId(FRAMES[name])].rotation
        return (turn if base == "world" else data.oMf[model.getFrameId(base)].rotation.T @ turn)[:, 2]

    here = axis(q)
    across = np.cross(here, rng.normal(size=3))
    target = np.cos(angle) * here + np.sin(angle) * across / np.linalg.norm(across)

    def cost(step: np.ndarray) -> float:
        a = axis(pin.integrate(model, q, step))
        return 0.5 * float(np.arctan2(np.linalg.norm(np.cross(a, target)), a @ target)) ** 2

    h, unit = 1e-4, np.eye(robot.nv)
    wanted = np.array(
        [
            [
                (cost(h * (i + j)) - cost(h * (i - j)) - cost(h * (j - i)) + cost(-h * (i + j))) / (4 * h * h)
                for j in unit
            ]
            for i in unit
        ]
    )
    function = aligned(name, base)
    e = np.array(function(q, target, [0.0, 0.0])[0]).ravel()
    _, rows, K = (np.array(x) for x in function(q, target, e))
    assert abs(np.linalg.norm(e) - angle) < 1e-9
    assert np.abs(rows.T @ rows + K - wanted).max() < 1e-5
    if name == "panda":
        assert np.abs(K[6]).max() < 1e-12
