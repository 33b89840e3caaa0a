"""Laws of least time within torques, speeds of frames and affine forces, and along paths of poses."""

from __future__ import annotations

import pickle
from functools import cache

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from wbc.errors import InfeasibleError, RangeError, ShapeError, UnknownNameError
from wbc.trajectory import geodesic_path, pose_spline, spline_path, time_optimal

KEPT = 1.0 + 1e-6
TIP = "panda_hand_tcp"


@cache
def panda():
    return wbc.robots.load("panda")


def waypoints(seed, spread=0.5, count=4):
    robot = panda()
    return robot.neutral + np.random.default_rng(seed).uniform(-spread, spread, (count, robot.nv))


def torques(robot, state):
    data = robot.model.createData()
    rows = zip(state.position, state.velocity, state.acceleration, strict=True)
    return np.array([pin.rnea(robot.model, data, q, v, a) for q, v, a in rows])


@pytest.mark.parametrize("seed", range(3))
def test_torques_are_kept_between_samples_too(seed):
    robot = panda()
    limit = 0.6 * robot.limits.effort
    law = time_optimal(waypoints(seed), 10.0, 100.0, torque=limit, robot=robot)
    worst = law.certificate.worst["torque"]
    assert worst.kind == "sampled"
    assert 0.0 < worst.spacing < 0.01
    assert worst.ratio <= KEPT
    # Another density, from outside: within the limit, and within what lies between samples of it
    seen = np.abs(torques(robot, law.at(np.linspace(0.0, law.duration, 5003))) / limit).max()
    assert worst.ratio - worst.between - 1e-3 < seen <= worst.ratio
    assert worst.between < 0.02
    # Without torques it is faster, and breaks them
    free = time_optimal(waypoints(seed), 10.0, 100.0)
    assert free.duration < law.duration
    assert np.abs(torques(robot, free.at(np.linspace(0.0, free.duration, 1001))) / limit).max() > 1.05


def test_torques_stay_with_the_law():
    robot = panda()
    law = time_optimal(waypoints(3), 2.0, 10.0, torque=robot.limits.effort, robot=robot)
    used = law.certificate.worst["torque"].ratio
    assert law.reversed().certificate.worst["torque"].ratio == pytest.approx(used, rel=1e-2)
    assert law.scaled(0.3).certificate.worst["torque"].ratio > used
    assert law.then(law.reversed()).certificate.worst["torque"].ratio == pytest.approx(used, rel=1e-2)
    assert "torque" in law.sliced(0.1, 0.2).certificate.worst
    copy = pickle.loads(pickle.dumps(law))
    assert copy.certificate.worst["torque"].ratio == used


def test_arms_that_cannot_be_held_are_refused_with_joint_and_torque():
    robot = panda()
    data = robot.model.createData()
    path = waypoints(4)
    limit = np.full(robot.nv, np.inf)
    resting = abs(pin.rnea(robot.model, data, path[0], np.zeros(robot.nv), np.zeros(robot.nv))[1])
    limit[1] = 0.5 * resting
    with pytest.raises(InfeasibleError, match=f"standing still .*{robot.dof_names[1]}, whose limit is") as caught:
        time_optimal(path, 2.0, 10.0, torque=limit, robot=robot)
    assert caught.value.field == "torque"
    with pytest.raises(InfeasibleError, match="standing still"):
        time_optimal(path[[0, 0]], 2.0, 10.0, torque=limit, robot=robot)
    limit[1] = 1.5 * resting
    assert time_optimal(path[[0, 0]], 2.0, 10.0, torque=limit, robot=robot).certificate.satisfied


def test_a_pendulum_against_gravity_has_the_closed_form():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "lift")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(2.0, 0.1), pin.SE3.Identity())
    robot = wbc.robots.load("panda")
    limits = wbc.robot.limits.Limits(*(np.array([x]) for x in (-9.0, 9.0, 100.0, 100.0, 100.0)))
    lift = type(robot)(name="lift", model=model, limits=limits)
    weight = 2.0 * 9.81
    # Up with 30 N: (30 - m g) / m upwards, braked by (30 + m g) / m; d = T^2 / 2 / (1 / up + 1 / down)
    up, down = (30.0 - weight) / 2.0, (30.0 + weight) / 2.0
    law = time_optimal([[0.0], [1.0]], 100.0, torque=30.0, robot=lift)
    assert law.duration == pytest.approx(np.sqrt(2.0 * (1.0 / up + 1.0 / down)), rel=2e-3)
    assert law.certificate.satisfied


def frame_speeds(robot, state):
    data, frame = robot.model.createData(), robot.model.getFrameId(TIP)
    out = []
    for q, v in zip(state.position, state.velocity, strict=True):
        pin.forwardKinematics(robot.model, data, q, v)
        velocity = pin.getFrameVelocity(robot.model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        out.append(np.linalg.norm(velocity.linear))
    return np.array(out)


def test_speed_of_a_frame_is_kept_and_used():
    robot = panda()
    law = time_optimal(waypoints(5), 3.0, 30.0, cartesian_speed={TIP: 0.8}, robot=robot)
    worst = law.certificate.worst["cartesian_speed"]
    assert worst.kind == "sampled"
    assert worst.ratio <= KEPT
    seen = frame_speeds(robot, law.at(np.linspace(0.0, law.duration, 3001))).max()
    assert 0.95 * 0.8 < seen <= 0.8 * KEPT
    free = time_optimal(waypoints(5), 3.0, 30.0)
    assert frame_speeds(robot, free.at(np.linspace(0.0, free.duration, 501))).max() > 0.8


def test_forces_between_speeds_at_the_ends():
    robot = panda()
    arguments = {"torque": 0.6 * robot.limits.effort, "robot": robot, "cartesian_speed": {TIP: 1.5}}
    path = spline_path(waypoints(6))
    law = time_optimal(path, 2.0, 20.0, start_speed=0.3, end_speed=0.2, **arguments)
    assert law.certificate.satisfied
    tangents = path.evaluate(path.knots[[0, -1]], 1)
    reached = law.at([0.0, law.duration]).velocity
    np.testing.assert_allclose(reached, tangents * np.array([[0.3], [0.2]]), atol=1e-9)


def test_a_cup_on_a_tray_does_not_slip():
    # A cart on a line carries a cup with friction 0.3: F w <= g on its contact force (normal, along)
    def contact(q, v, a):
        return np.array([9.81, a[0]])

    cone = np.array([[-0.3, 1.0], [-0.3, -1.0]])
    law = time_optimal([[0.0], [2.0]], 10.0, 50.0, inequality={"cup": (contact, cone, [0.0, 0.0])})
    assert law.certificate.worst["cup"].kind == "sampled"
    assert law.certificate.satisfied
    assert law.duration == pytest.approx(2.0 * np.sqrt(2.0 / (0.3 * 9.81)), rel=1e-3)
    assert np.abs(law.at(np.linspace(0.0, law.duration, 999)).acceleration).max() <= 0.3 * 9.81 * KEPT
    bounded = time_optimal([[0.0], [2.0]], 10.0, inequality=(lambda q, v, a: a, [[1.0], [-1.0]], [2.0, 4.0]))
    assert bounded.duration == pytest.approx(np.sqrt(2.0 * 2.0 * (1.0 / 2.0 + 1.0 / 4.0)), rel=5e-3)


def test_bad_input():
    robot = panda()
    with pytest.raises(UnknownNameError) as unknown:
        time_optimal(waypoints(1), 1.0, 1.0, cartesian_speed={"panda_hnd": 1.0}, robot=robot)
    assert unknown.value.field == "cartesian_speed"
    with pytest.raises(RangeError) as slow:
        time_optimal(waypoints(1), 1.0, 1.0, cartesian_speed={TIP: 0.0}, robot=robot)
    assert slow.value.field == f"cartesian_speed.{TIP}"
    with pytest.raises(ShapeError) as narrow:
        time_optimal(waypoints(1)[:, :5], 1.0, 1.0, torque=10.0, robot=robot)
    assert narrow.value.field == "path"
    with pytest.raises(ShapeError) as odd:
        time_optimal([[0.0], [1.0]], 1.0, 1.0, inequality=(lambda q, v, a: [1.0, 2.0, 3.0], np.eye(2), [1.0, 1.0]))
    assert odd.value.field == "inequality.function"
    floating = wbc.robots.load("talos")
    with pytest.raises(RangeError) as free:
        time_optimal(np.eye(2, floating.nv), 1.0, 1.0, torque=10.0, robot=floating)
    assert free.value.field == "robot"


def pose(seed):
    rng = np.random.default_rng(seed)
    return pin.SE3(pin.exp3(rng.uniform(-1.0, 1.0, 3)), rng.uniform(-0.5, 0.5, 3))


def test_straight_line_without_turning_has_the_closed_form():
    start, end = pin.SE3.Identity(), pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0]))
    law = time_optimal(geodesic_path(start, end), acceleration=1.0, velocity=np.inf)
    assert law.space == "poses"
    assert law.duration == pytest.approx(2.0, rel=1e-3)
    np.testing.assert_allclose(law.at(law.duration).position, end.homogeneous, atol=1e-9)


def test_speeds_of_the_origin_and_of_turning_are_kept():
    path = pose_spline([pose(k) for k in range(4)])
    law = time_optimal(path, acceleration=5.0, cartesian_speed={"linear": 0.4, "angular": 0.9})
    assert law.certificate.worst["cartesian_speed"].kind == "sampled"
    assert law.certificate.worst["acceleration"].ratio <= 1.0 + 1e-6
    assert law.certificate.satisfied
    state = law.at(np.linspace(0.0, law.duration, 2001))
    linear = np.linalg.norm(state.velocity[:, :3], axis=1).max() / 0.4
    angular = np.linalg.norm(state.velocity[:, 3:], axis=1).max() / 0.9
    assert 0.95 < max(linear, angular) <= 1.0 + 1e-6
    assert np.abs(state.acceleration).max() <= 5.0 * (1.0 + 1e-6)
    for end in (0.0, law.duration):
        assert not law.at(end).velocity.round(9).any()


def test_parts_of_a_pose_are_linear_and_angular():
    with pytest.raises(UnknownNameError) as caught:
        time_optimal(geodesic_path(pose(0), pose(1)), 1.0, 1.0, cartesian_speed={"tip": 1.0})
    assert caught.value.field == "cartesian_speed"
    assert caught.value.choices[0] in ("linear", "angular")


def test_a_turn_of_nearly_nothing_between_two_others() -> None:
    """Its law is slowed until the samples of the slower one find nothing beyond its limits."""
    turns = (0.0, 0.5, 0.5 + 1e-5, 0.9)
    places = ([0.0, 0.0, 0.0], [0.5, 0.2, 0.0], [0.5, 0.2, 0.0], [0.8, 0.0, 0.1])
    poses = [(p, [0.0, 0.0, np.sin(a / 2), np.cos(a / 2)]) for p, a in zip(places, turns, strict=True)]
    assert time_optimal(pose_spline(poses), 1.0, 2.0).certificate.satisfied
