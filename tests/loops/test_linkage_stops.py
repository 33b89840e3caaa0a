"""Linkages stop on their way within limits of position, also where slow joints take fast ones along."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.loops.mechanisms import NAMED, random_linkage, within
from tests.loops.test_torques import moving, rows_at
from wbc.robot import Robot
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.tracer import Tracer
from wbc.tasks._linkage_speed import STOP, LinkageSpeed, bend_of
from wbc.validation import Array

DT = 0.005
ACCELERATION = 5.0

#: A spatial linkage of ten joints whose third is next to its limit, its velocity, and a posture that is wanted; where
#: each joint only brakes in time on its own, no velocity is within all limits 47 ticks later
NEAR = (-0.54618, 0.603636, 1.0, 0.374401, -0.586189, -0.016647, 0.241222, -0.263215, -0.075862, 0.141892)
RATES = (-0.091477, -0.175394, 0.0, -0.070141, -0.238539, -0.279897, 0.48834, -0.070695, 0.135366, 0.056651)
WANTED = (-1.36107, 1.844615, 1.779694, -0.1701, -1.084301, -1.812027, 5.849886, 0.102587, 1.969444, -2.092089)


def limited(seed: int) -> Robot:
    """A random linkage that accelerates slowly, in a room of 1 rad."""
    robot = wbc.robots.load(random_linkage(seed), shapes="none")
    return within(robot, 1.0).with_limits(velocity=3.0, acceleration=ACCELERATION)


def test_joints_that_push_each_other_to_their_limits_brake_in_time() -> None:
    robot = limited(4)
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    controller, q, v = stack.compile(backend="vm"), robot.closed(NEAR), np.array(RATES)
    controller.reset(q)
    controller["posture"].target = WANTED
    for k in range(60):
        step = controller.step(q, v)
        assert step.status == "solved", (k, step)
        q, v = pin.integrate(robot.model, q, step.v * DT), np.array(step.v)


#: Linkages of several motions with a joint that has just left its limit: seed, configuration, velocity, and posture
#: that is wanted. Where what it does next was taken for what it did, two ticks later several joints had to turn round
#: within the tick, each by what it alone could brake by, and no motion did
LEAVING = (
    (
        135,
        (-0.119290385, -0.548131081, 0.614108181, 0.087063418, -0.942988309, -0.969471861, 0.305095947, -0.999999269),
        (-0.114560324, 0.541215224, -0.287778893, -0.462943134, 0.965766981, -0.145713465, -1.002457039, -0.000801238),
        (2.709037, -0.580707, -1.945973, -1.352604, -0.57879, -1.368106, -0.780116, -0.765341),
    ),
    (
        135,
        (-0.196061609, -0.616992102, 0.859742789, -0.043039693, -0.884550316, -0.999999164, 0.244219253, -0.954707779),
        (-0.133573989, -0.545928513, 0.864970133, 0.021802251, -0.458730835, 3.9866e-05, 0.526348812, 0.156992823),
        (-1.248764, -0.651592, 1.871732, 0.870673, 0.433662, -3.161901, 2.069822, 4.719856),
    ),
    (
        137,
        (-0.999660334, -0.999999033, -0.555813836, 0.900679299, -0.270081163, -0.488274445),
        (-0.005253871, -0.000358874, -1.31450352, 0.726639622, -0.370624408, 0.003481577),
        (1.586216, -2.436987, -4.738324, -0.194029, -1.261313, 2.756428),
    ),
)


@pytest.mark.parametrize(("seed", "begins", "rates", "wanted"), LEAVING)
def test_a_joint_that_leaves_its_limit_comes_back_no_faster_than_it_stops(
    seed: int, begins: Array, rates: Array, wanted: Array
) -> None:
    robot = limited(seed).with_limits(acceleration=20.0)
    stack = wbc.Stack(robot, 2.0 * DT).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    controller, q, v = stack.compile(command="acceleration", backend="vm"), robot.closed(begins), np.array(rates)
    controller.reset(q)
    controller["posture"].target = wanted
    for k in range(4):
        step = controller.step(q, v)
        assert step.status == "solved", (k, step)
        q, v = np.array(step.q_next), np.array(step.v)


@pytest.mark.parametrize("seed", [42, 53, 69])
def test_a_joint_that_has_no_more_to_brake_by_gives_way_to_no_rounding(seed: int) -> None:
    """The bend takes 0.95 of the limits, the row asks for the rest, and the loop is open by 1e-10."""
    rng = np.random.default_rng(seed)
    robot = wbc.robots.load(NAMED["four_bar"], shapes="none", velocity=3.0, acceleration=1.3)
    (linkage,), kin = robot.loops.linkages, Tracer(Kinematics(robot.model))
    look = ca.Function("bend", [kin.q, kin.v], [bend_of(robot, kin, linkage, robot.limits.acceleration).asked])
    q, v = moving(robot, rng)
    v *= np.sqrt(0.95 / np.linalg.norm(np.array(look(q, v)).ravel() / robot.limits.acceleration, 4))
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    controller = stack.compile(command="acceleration", backend="vm")
    for opened in 1e-10 * rng.normal(size=(8, robot.nv)):
        controller.reset(q)
        controller["posture"].target = q + v
        assert controller.step(q + opened, v).status == "solved"


def test_a_joint_that_a_fast_one_takes_along_stops_before_its_limit() -> None:
    """The heel has a fifth of the knee's velocity: where it alone would brake in time the knee cannot."""
    robot = wbc.robots.load(NAMED["four_bar"], shapes="none", velocity=3.0, acceleration=2.3)
    robot, rng = robot.with_limits(position_upper={"heel": 0.45}), np.random.default_rng(0)
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    controller, end = stack.compile(command="acceleration", backend="vm"), robot.assemblies({"heel": 0.45})[0]
    looked = 0
    for far, fast in 10.0 ** rng.uniform((-7.0, -4.0), (-3.0, -1.0), size=(120, 2)):
        q = robot.closed(end - far * way(robot, end))
        v = fast * way(robot, q)
        if v[2] * (DT + np.linalg.norm(v / 2.3, 4) / (2.0 * STOP)) > 0.45 - q[2]:
            continue
        looked += 1
        controller.reset(q)
        controller["posture"].target = end + way(robot, end)
        for _ in range(8):
            step = controller.step(q, v)
            assert step.status == "solved"
            q, v = np.array(step.q_next), np.array(step.v)
    assert looked > 40


def way(robot: Robot, q: Array) -> Array:
    """The motion that the loop leaves, its fastest joint at 1."""
    motion = np.linalg.svd(rows_at(robot, q))[2][-1]
    return motion / np.abs(motion).max() * np.sign(motion[0])


@pytest.mark.parametrize("seed", [1, 4, 5])
@pytest.mark.parametrize("later", [False, True])
def test_the_row_of_a_joint_says_where_it_stops(seed: int, later: bool) -> None:
    """At the speed about which the row is straight its side and slopes are those of q + v (dt + t) + c t^2 / 2."""
    robot, rng = limited(seed), np.random.default_rng(seed)
    kin = Tracer(Kinematics(robot.model))
    (linkage,) = robot.loops.linkages
    item = LinkageSpeed(wbc.tasks.JointLimits())
    rows = (item.later_rows if later else item.velocity_rows)(robot, kin, {}, ca.SX(DT))
    bend = bend_of(robot, kin, linkage, np.full(len(linkage.dofs), ACCELERATION)).asked
    look = ca.Function("rows", [kin.q, kin.v], [rows.matrix, rows.lower, rows.upper, bend])
    q, v = moving(robot, rng)
    v *= 0.1
    matrix, lower, upper, bent = (np.array(part) for part in look(q, v))
    speed, begins, reach = size(v), q + (0.5 * DT * v if later else 0.0), robot.nv**0.25 * DT

    kept, h = robot.limits, 1e-6
    first = len(matrix) - robot.nv
    for k in range(robot.nv):
        # The end next to which it stops, from which it may move off; bends are not counted on to turn it round
        middle = 0.5 * (kept.position_lower[k] + kept.position_upper[k])
        sign = 1.0 if begins[k] + v[k] * (DT + 0.5 * speed / STOP) > middle else -1.0
        end, row = (kept.position_upper[k], upper) if sign > 0.0 else (kept.position_lower[k], lower)
        toward, bends = max(sign * v[k], 0.0), sign * max(sign * bent[k, 0], 0.0)
        # The speed at which it would stop at its limit but for the bend, of those that it may reach
        room = max(2.0 * sign * (end - begins[k]), 0.0)
        about = STOP * (np.sqrt(DT**2 + room / (toward / speed + 1e-12) / STOP) - DT)
        about = min(max(about, speed - reach), speed + reach)
        there = v / speed * about

        time = DT + 0.5 * about / STOP

        def stop(velocity: Array, k: int = k, leaves: float = time * (toward == 0.0), bends: float = bends) -> float:
            """Where it stops if it bends as at v, but for its speed; what leaves the limit may be back after a time."""
            stops = 0.5 * size(velocity) / STOP
            bent = 0.5 * (size(velocity) / speed * stops) ** 2 * bends
            return float(begins[k] + velocity[k] * (leaves or DT + stops) + bent)

        assert matrix[first + k] @ there - row[first + k, 0] == pytest.approx((stop(there) - end) / time, abs=1e-9)
        slopes = [(stop(there + h * unit) - stop(there - h * unit)) / (2.0 * h) for unit in np.eye(robot.nv)]
        assert matrix[first + k] == pytest.approx(np.array(slopes) / time, abs=1e-6)


def size(velocity: Array) -> float:
    """s of a velocity."""
    return float(np.linalg.norm(velocity / ACCELERATION, 4))
