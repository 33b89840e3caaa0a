"""Rigid bodies: what is conserved, what grips hold, what motors and encoders do, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.refusals import assert_refused
from tests.simulation.machines import HANDS, heavy, held, off, random_torque, residual, velocity
from wbc.errors import NotFiniteError, RangeError, ShapeError, UnknownNameError
from wbc.simulation import (
    Command,
    CommandKind,
    Encoders,
    GripKind,
    Ground,
    Motors,
    PinocchioPlant,
    PlantError,
    RealTime,
    level,
)
from wbc.simulation.dynamics import ConstrainedDynamics, step_midpoint, step_rk4
from wbc.simulation.ground import Distance
from wbc.simulation.stability import largest_step

ROBOT = heavy().robot


def torque(values: np.ndarray) -> Command:
    return Command(CommandKind.TORQUE, values)


def test_momentum_and_energy_stay_in_free_motion() -> None:
    plant = PinocchioPlant(ROBOT)
    plant.reset(ROBOT.neutral, 0.0, v=velocity(ROBOT, 0.5))
    momentum, energy = plant.momentum, plant.energy
    plant.advance(0.2)
    assert plant.momentum == pytest.approx(momentum, abs=1e-10)
    assert plant.energy == pytest.approx(energy, rel=1e-10)
    assert plant.given == pytest.approx(np.zeros(6), abs=1e-10)


@pytest.mark.parametrize(("step", "order"), [(step_rk4, 4), (step_midpoint, 2)])
@pytest.mark.parametrize("root", ["free", "planar", "ball"])
def test_integrators_have_their_order(step: object, order: int, root: str) -> None:
    joint = {"free": pin.JointModelFreeFlyer(), "planar": pin.JointModelPlanar(), "ball": pin.JointModelSpherical()}
    model = pin.Model()
    model.addJoint(0, joint[root], pin.SE3.Identity(), "root")
    model.appendBodyToJoint(1, pin.Inertia.FromBox(3.0, 0.2, 0.5, 0.9), pin.SE3.Identity())
    model.addJoint(1, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.2])), "arm")
    model.appendBodyToJoint(2, pin.Inertia.FromBox(2.0, 0.1, 0.4, 0.2), pin.SE3(np.eye(3), np.array([0.2, 0.1, 0.0])))
    dynamics, v0, tau = (
        ConstrainedDynamics(model, 20.0),
        np.random.default_rng(1).normal(size=model.nv),
        np.zeros(model.nv),
    )

    def end(count: int) -> np.ndarray:
        q, v = pin.neutral(model), v0
        for _ in range(count):
            q, v = step(dynamics, q, v, lambda q, v: tau, 0.4 / count)  # type: ignore[operator]
        return np.append(pin.difference(model, pin.neutral(model), q), v)

    errors = [np.linalg.norm(end(n) - end(320)) for n in (10, 20)]
    assert np.log2(errors[0] / errors[1]) > order - 0.4


@pytest.mark.parametrize("kind", GripKind)
@pytest.mark.parametrize("count", [1, 2, 3])
def test_grips_hold_and_their_wrenches_are_those_of_the_motion(kind: GripKind, count: int) -> None:
    plant, tau = PinocchioPlant(ROBOT, integrator="midpoint"), random_torque(ROBOT, 3.0, count)
    plant.reset(ROBOT.neutral, 0.0, v=velocity(ROBOT, 0.1, count))
    before = plant.momentum
    held(plant, count, kind)
    rates = [np.abs(ROBOT.jacobian(plant.state.q, hand)[:3] @ plant.state.v).max() for hand in HANDS[:count]]
    assert max(rates) < 1e-9
    plant.apply(torque(tau))
    plant.advance(0.1)
    assert off(plant) < 1e-6
    assert residual(plant, tau) < 1e-8
    assert plant.given == pytest.approx(before - plant.momentum, abs=1e-9)
    for wrench in plant.wrenches.values():
        assert wrench[{"pose": slice(6, 6), "axis": slice(5, 6), "position": slice(3, 6)}[kind]] == pytest.approx(0.0)


def test_drift_of_a_grip_decays_at_its_rate() -> None:
    plant = PinocchioPlant(ROBOT)
    pose = ROBOT.pose(ROBOT.neutral, HANDS[0])
    plant.grasp(HANDS[0], pin.SE3(pose.rotation, pose.translation + np.array([0.004, 0.0, 0.0])))
    plant.advance(0.2)
    # Critically damped from rest: e (1 + r t) exp(-r t)
    assert off(plant) == pytest.approx(0.004 * 5.0 * np.exp(-4.0), rel=0.02)


def test_gravity_gives_what_the_grips_take() -> None:
    moon = wbc.robots.with_masses(wbc.robots.walker(), (0.0, 0.0, -1.62)).robot
    plant = PinocchioPlant(moon, integrator="midpoint")
    plant.advance(0.1)
    mass = pin.computeTotalMass(moon.model)
    assert plant.momentum[2] == pytest.approx(-0.162 * mass)
    assert plant.given == pytest.approx(np.zeros(6), abs=1e-6)
    held(plant, 3)
    start = plant.given
    assert start[2] < -0.05 * mass
    taken = np.zeros(3)
    for _ in range(50):
        plant.advance(0.001)
        for name, wrench in plant.wrenches.items():
            taken -= 0.001 * moon.pose(plant.state.q, name).rotation @ wrench[:3]
    assert plant.given[:3] - start[:3] == pytest.approx(taken, abs=1e-3)


def test_motors_are_late_slow_weak_and_rub() -> None:
    robot = wbc.robots.load("panda")
    gravity = np.zeros(3)
    plant = PinocchioPlant(robot, motors=Motors(effort=5.0, delay=0.002), gravity=gravity)
    plant.apply(torque(np.full(robot.nv, 9.0)))
    plant.advance(0.002)
    assert not plant.state.v.any()
    before = plant.acceleration(np.full(robot.nv, 5.0))
    plant.advance(0.001)
    assert plant.state.v == pytest.approx(0.001 * before, rel=0.01)
    slow = PinocchioPlant(robot, motors=Motors(lag=0.01), gravity=gravity)
    slow.apply(torque(np.ones(robot.nv)))
    slow.advance(0.01)
    assert slow._state.motors.torque == pytest.approx(np.full(robot.nv, 1.0 - np.exp(-1.0)))
    rubbing = PinocchioPlant(robot, motors=Motors(viscous=0.2, coulomb=0.02, slip_speed=0.1), gravity=gravity)
    rubbing.reset(robot.neutral, 0.0, v=np.full(robot.nv, 0.4))
    energy = rubbing.energy
    rubbing.advance(0.05)
    assert rubbing.energy < 0.99 * energy
    fast = PinocchioPlant(robot, motors=Motors(no_load_speed=10.0), gravity=gravity)
    fast.apply(torque(np.full(robot.nv, 50.0)))
    fast.advance(0.3)
    assert 5.0 < np.abs(fast.state.v[0]) < 11.0
    geared = PinocchioPlant(robot, motors=Motors(gear=10.0, rotor=0.01))
    assert geared.model.armature == pytest.approx(robot.model.armature + 1.0)


def test_a_payload_is_part_of_its_body() -> None:
    robot = wbc.robots.load("panda")
    ball = pin.Inertia.FromSphere(3.0, 0.05)
    plant, bare = PinocchioPlant(robot, payloads={"panda_hand": ball}), PinocchioPlant(robot)
    assert pin.computeTotalMass(plant.model) == pytest.approx(pin.computeTotalMass(bare.model) + 3.0)
    twist = robot.jacobian(robot.neutral, "panda_hand") @ np.ones(robot.nv)
    plant.reset(robot.neutral, 0.0, v=np.ones(robot.nv))
    bare.reset(robot.neutral, 0.0, v=np.ones(robot.nv))
    kinetic = 0.5 * (3.0 * twist[:3] @ twist[:3] + ball.inertia[0, 0] * twist[3:] @ twist[3:])
    height = robot.pose(robot.neutral, "panda_hand").translation[2]
    assert plant.energy - bare.energy == pytest.approx(kinetic + 3.0 * 9.81 * height)


def test_encoders_round_and_err_and_the_base_does_not() -> None:
    plant = PinocchioPlant(ROBOT, encoders=Encoders(position=1e-3, velocity=1e-2, resolution=1e-4), seed=4)
    read = [plant.read() for _ in range(50) if plant.advance(0.001) is None]
    errors = np.array([state.q - ROBOT.neutral for state in read])
    assert not errors[:, :7].any()
    assert errors[:, 7:].std() == pytest.approx(1e-3, rel=0.1)
    assert np.array([state.v for state in read])[:, 6:].std() == pytest.approx(1e-2, rel=0.1)
    counts = read[-1].q[7:] / 1e-4
    assert counts == pytest.approx(np.round(counts), abs=1e-6)
    assert plant.read() is plant.read()


def ball_on_ground(
    gravity: object = (0.0, 0.0, -9.81), **ground: float | Distance
) -> tuple[wbc.robot.Robot, PinocchioPlant]:
    """A free body of 2 kg whose frame is a ball of 0.1 m."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(2.0, 0.1), pin.SE3.Identity())
    model.addFrame(pin.Frame("ball", 1, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    walker = wbc.robots.load("walker")
    limits = replace(walker.limits, **{k: getattr(walker.limits, k)[:6] for k in vars(walker.limits) if k != "source"})
    robot = wbc.robot.Robot("ball", model, limits, "floating", pin.neutral(model))
    return robot, PinocchioPlant(robot, ground=Ground({"ball": 0.1}, **ground), gravity=gravity)  # type: ignore[arg-type]


def test_a_body_rests_on_the_ground_and_friction_holds_it() -> None:
    robot, plant = ball_on_ground(stiffness=2e4, damping=200.0, friction=0.5)
    q = robot.neutral.copy()
    q[2] = 0.1
    plant.reset(q, 0.0)
    plant.advance(1.0)
    assert plant.state.q[2] == pytest.approx(0.1 - 2.0 * 9.81 / 2e4, abs=1e-6)
    q[2] = 0.085
    assert_refused(lambda: plant.reset(q, 0.0), RangeError, "impossible contact")


def round_wall(points: np.ndarray) -> np.ndarray:
    """Distance from a cylinder of 2 m about z, from outside."""
    return np.asarray(np.linalg.norm(points[..., :2], axis=-1) - 2.0)


@pytest.mark.parametrize("distance", [round_wall, level(0.3)], ids=["cylinder", "plane"])
@pytest.mark.parametrize("friction", [0.4, 0.1])
def test_a_body_on_a_surface(distance: Distance, friction: float) -> None:
    """With gravity 0.25 rad off the normal: at rest it is mg cos / k deep and mg sin / k aside.

    tan 0.25 is 0.255: on a surface of less friction it slides, and gains speed.
    """
    place = np.array([1.9, 0.9, 0.4])

    def normal(at: np.ndarray) -> np.ndarray:
        step = 1e-6 * np.eye(3)
        slope = distance(at + step) - distance(at - step)
        return np.asarray(slope / np.linalg.norm(slope))

    for _ in range(5):
        place = place + (0.1 - float(distance(place))) * normal(place)
    n = normal(place)
    side = np.cross(n, np.cross([0.3, 0.5, 0.8], n))
    side /= np.linalg.norm(side)
    pull = 9.81 * (np.sin(0.25) * side - np.cos(0.25) * n)
    robot, plant = ball_on_ground(pull, distance=distance, stiffness=2e4, damping=200.0, friction=friction)
    q = robot.neutral.copy()
    q[:3] = place
    plant.reset(q, 0.0)
    plant.advance(0.2)
    moved, speed = plant.state.q[:3] - place, np.linalg.norm(plant.state.v[:3])
    if friction > np.tan(0.25):
        assert moved @ n == pytest.approx(-2.0 * 9.81 * np.cos(0.25) / 2e4, rel=0.02)
        assert moved @ side == pytest.approx(2.0 * 9.81 * np.sin(0.25) / 2e4, rel=0.02)
        assert speed < 1e-4
    else:
        assert speed == pytest.approx(0.2 * 9.81 * (np.sin(0.25) - friction * np.cos(0.25)), rel=0.15)
    assert plant.given @ np.append(pull, np.zeros(3)) > 0.0


def test_a_step_that_is_too_coarse_is_refused_with_the_largest_that_works() -> None:
    motors = Motors(coulomb=20.0)
    with pytest.raises(RangeError, match="the largest that works is") as caught:
        PinocchioPlant(ROBOT, 0.01, motors=motors)
    most = float(str(caught.value).split("works is ")[1].split(" s")[0])
    plant = PinocchioPlant(ROBOT, most, motors=motors)
    plant.reset(ROBOT.neutral, 0.0, v=velocity(ROBOT, 1e-3))
    plant.advance(200 * most)
    assert np.abs(plant.state.v).max() < 1e-3
    assert largest_step(np.eye(1), np.zeros((1, 1)), np.eye(1), 0.0, "rk4") == pytest.approx(0.9 * 2.785, rel=1e-3)
    assert largest_step(np.eye(1), np.zeros((1, 1)), np.zeros((1, 1)), 0.0, "rk4") == np.inf


def test_bad_robots_and_contacts_are_refused_by_name() -> None:
    massless = wbc.robots.load("walker")
    assert_refused(lambda: PinocchioPlant(massless), RangeError, "singular")
    model = ROBOT.model.copy()
    model.inertias[3].mass = -1.0
    assert_refused(lambda: PinocchioPlant(replace(ROBOT, model=model)), RangeError, "arm1_joint2 have a negative mass")
    plant = PinocchioPlant(ROBOT)
    far = pin.SE3(np.eye(3), np.ones(3))
    assert_refused(lambda: plant.grasp(HANDS[0], far), RangeError, "impossible contact")
    assert_refused(lambda: plant.grasp("arm1_hnad", far), UnknownNameError, "arm1_hand")
    held(plant, 1)
    assert_refused(lambda: plant.grasp(HANDS[0], far), RangeError, "held already")
    assert_refused(lambda: plant.release(HANDS[1]), UnknownNameError, HANDS[0])
    assert_refused(lambda: plant.apply(Command(CommandKind.VELOCITY, np.zeros(24))), UnknownNameError, "torque")
    assert_refused(lambda: plant.apply(torque(np.zeros(3))), ShapeError, "command")
    assert_refused(lambda: plant.apply(torque(np.full(24, np.nan))), NotFiniteError, "command")
    assert_refused(lambda: PinocchioPlant(ROBOT, motors=Motors(delay=0.0015)), RangeError, "delay")
    assert_refused(lambda: PinocchioPlant(ROBOT, motors=Motors(viscous=-1.0)), RangeError, "viscous")
    assert_refused(lambda: PinocchioPlant(ROBOT, integrator="euler"), UnknownNameError, "rk4")  # type: ignore[arg-type]
    assert_refused(lambda: Ground({"arm1_hand": -1.0}), RangeError, "arm1_hand")


def test_what_blows_up_says_so() -> None:
    plant = PinocchioPlant(ROBOT, motors=Motors(effort=np.inf))
    plant.apply(torque(random_torque(ROBOT, 1e9)))
    with pytest.raises(PlantError, match="blown up"):
        plant.advance(1.0)


def test_faults() -> None:
    plant = PinocchioPlant(ROBOT)
    held(plant, 2)
    plant.limp("arm3_joint2")
    before = plant.state.v.copy()
    tau = np.zeros(ROBOT.nv)
    tau[ROBOT.dofs("arm3_joint2")] = 50.0
    plant.apply(torque(tau))
    plant.advance(0.01)
    assert plant.state.v == pytest.approx(before, abs=1e-9)
    start = plant.grips[HANDS[0]].pose.translation.copy()
    plant.slip(HANDS[0], (0.0, 0.01, 0.0), 0.1)
    plant.advance(0.3)
    assert plant.grips[HANDS[0]].pose.translation - start == pytest.approx([0.0, 0.001, 0.0])
    assert off(plant) < 1e-4
    plant.lose(HANDS[1])
    assert (plant.lost(), plant.lost()) == ((HANDS[1],), ())
    assert set(plant.grips) == {HANDS[0]}


def test_real_time_takes_as_long_as_it_says() -> None:
    robot = wbc.robots.load("panda")
    plant = RealTime(PinocchioPlant(robot), pace=10.0)
    plant.reset(robot.neutral, 0.0)
    import time

    begin = time.perf_counter()
    plant.advance(0.1)
    assert time.perf_counter() - begin >= 0.01
    assert plant.read().time == pytest.approx(0.1)


def test_level_ground_is_a_distance() -> None:
    assert level(0.5)(np.array([[0.0, 0.0, 2.0]])) == pytest.approx([1.5])
