"""What contacts bear, how they open, and what a tick says where they cannot hold."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import linprog

from tests.pinocchio_state import PinocchioState
from tests.torque.problems import DT, controller, robot
from tests.torque.referee import cone
from wbc.api import Stack
from wbc.errors import CommandError
from wbc.tasks import EndEffector, LineContact, PointContact, RigidGrasp, SurfaceContact


@pytest.mark.parametrize(
    ("item", "ends"),
    [
        (SurfaceContact("any", half_lengths=(0.12, 0.05), friction=0.7), [(a, b) for a in (1, -1) for b in (1, -1)]),
        (LineContact("any", half_length=0.12, friction=0.7), [(1, 0), (-1, 0)]),
    ],
)
def test_wrenches_are_exactly_those_of_forces_at_the_ends(
    item: SurfaceContact | LineContact, ends: list[tuple[int, int]]
) -> None:
    """Sums of forces within pyramids at corners or ends are allowed; others, found by linear programming, are not."""
    F, low, _ = cone(item)
    mu = item.friction / np.sqrt(2)
    rays = [np.array([a * mu, b * mu, 1.0]) for a, b in itertools.product((1, -1), repeat=2)]
    places = [np.array([0.12 * a, 0.05 * b, 0.0]) for a, b in ends]
    whole, axes = np.column_stack([np.r_[f, np.cross(p, f)] for p in places for f in rays]), list(item.axes)
    assert not np.delete(whole, axes, axis=0).any()
    generators, rng, outside = whole[axes], np.random.default_rng(0), 0
    inside = generators @ rng.exponential(1.0, (generators.shape[1], 200)) ** 3
    assert (F @ inside >= low[:, None] - 1e-9).all()
    scale = np.array([0.6, 0.6, 1.0, 0.06, 0.13, 0.08])[axes]
    for w in rng.normal(size=(300, len(axes))) * scale + np.eye(6)[2, axes]:
        allowed = bool((F @ w >= low - 1e-9).all())
        possible = linprog(np.zeros(generators.shape[1]), A_eq=generators, b_eq=w).status == 0
        assert allowed == possible, w
        outside += not possible
    assert 30 < outside < 270


@pytest.mark.parametrize("edges", [4, 5, 8])
def test_a_pyramid_is_within_coulombs_cone_and_touches_it(edges: int) -> None:
    friction = 0.6
    F, low, _ = cone(PointContact("any", friction=friction, edges=edges))
    angles, sizes = np.linspace(0.0, 2 * np.pi, 720, endpoint=False), np.linspace(0, 1, 401)
    around = np.array([np.cos(angles), np.sin(angles)])
    # rows x angles x sizes
    value = F[:, 2, None, None] + (F[:, :2] @ around)[:, :, None] * sizes
    radius = sizes[(value >= low[:, None, None] - 1e-12).all(axis=0).sum(axis=1) - 1]
    assert radius.max() <= friction + 1e-9
    assert radius.max() >= friction - 0.003
    assert radius.min() >= np.cos(np.pi / edges) * friction - 0.003


def test_a_grip_bears_what_it_is_rated_for_along_each_axis() -> None:
    F, low, high = cone(RigidGrasp("any", force=300.0, torque=(80.0, 90.0, 100.0)))
    assert np.array_equal(F, np.eye(6))
    assert np.array_equal(high, [300.0, 300.0, 300.0, 80.0, 90.0, 100.0])
    assert np.array_equal(low, -high)


def standing() -> tuple[object, np.ndarray, np.ndarray]:
    bot = robot("talos")
    return bot, bot.neutral.copy(), np.zeros(bot.nv)


def test_feet_carry_the_weight_and_an_open_contact_bears_nothing() -> None:
    bot, q, v = standing()
    tick = controller("talos").clone()
    tick.reset(q)
    step = tick.step(q, v)
    assert step.status == "solved"
    tick["palm"].enabled = False
    step = tick.step(q, v)
    forces, weight = step.forces, pin.computeTotalMass(bot.model) * 9.81
    assert not forces["palm"].any()
    assert forces["left foot"][2] + forces["right foot"][2] == pytest.approx(weight, rel=1e-3)
    for side in ("left foot", "right foot"):
        tick[side].enabled = False
    step = tick.step(q, v)
    assert step.status == "solved"
    assert not any(f.any() for f in step.forces.values())
    # nothing bears the robot, so its centre of mass falls
    data = bot.model.createData()
    pin.centerOfMass(bot.model, data, q, v, step.a)
    assert data.acom[0] == pytest.approx([0.0, 0.0, -9.81], abs=1e-6)
    tick["left foot"].enabled = True
    assert tick.step(q, v).forces["left foot"][2] > 0.5 * weight


def test_a_hand_presses_with_the_force_that_is_asked_for() -> None:
    _, q, v = standing()
    tick = controller("talos").clone()
    tick.reset(q)
    tick.step(q, v)
    tick["palm force"].set(target=np.array([0.0, 0.0, 10.0]))
    tick["palm force"].weight = 10.0
    step = tick.step(q, v)
    assert step.forces["palm"] == pytest.approx([0.0, 0.0, 10.0], abs=0.05)


def test_a_load_is_handed_over_by_a_ramp_without_a_jump_in_torque() -> None:
    """The price of the right foot's wrench rises until it bears nothing; it opens, closes, and takes its load back."""
    _, q, v = standing()
    tick = controller("talos").clone()
    tick["palm"].enabled = False
    tick.reset(q)
    last = first = tick.step(q, v)
    jumps = []

    def ramp(weight: float) -> None:
        nonlocal last
        tick["right foot force"].ramp(weight, 0.1)
        for _ in range(50):
            step = tick.step(q, v)
            jumps.append(float(np.abs(step.torque - last.torque).max()))
            last = step

    ramp(1e8)
    assert last.forces["right foot"][2] < 0.01
    for closed in (False, True):
        tick["right foot"].enabled = closed
        jumps.append(float(np.abs(tick.step(q, v).torque - last.torque).max()))
        # the foot bears nothing; what is left is the torque that kept it where it was
        assert jumps[-1] < 4.0
    ramp(1e-4)
    assert last.forces["right foot"] == pytest.approx(first.forces["right foot"], abs=1e-3)
    # without ramps it is this much at once
    tick["right foot"].enabled = False
    assert max(jumps) < 20.0 < 0.7 * np.abs(tick.step(q, v).torque - last.torque).max()


def test_a_wrench_that_nothing_bears_moves_contacts_by_name() -> None:
    _, q, v = standing()
    tick = controller("talos").clone()
    tick.reset(q)
    tick["left foot"].least = 3000.0
    step = tick.step(q, v)
    assert step.status == "relaxed"
    assert step.forces["left foot"][2] >= 3000.0 - 1e-6
    assert {slack.unit for slack in step.relaxed} <= {"m/s^2", "rad/s^2"}
    assert any(slack.item.endswith("foot") for slack in step.relaxed)
    assert (np.abs(step.torque) <= tick.stack.robot.limits.effort).all()
    assert "left foot wrench/normal" in str(step.explain())


def test_motors_that_are_too_weak_give_the_motion_of_contacts_up() -> None:
    _, q, v = standing()
    tick = controller("talos").clone()
    tick.reset(q)
    tick["torque_limits"].scale = 0.02
    step = tick.step(q, v)
    assert step.status == "relaxed"
    assert {s.unit for s in step.relaxed} <= {"m/s^2", "rad/s^2", "N", "N m"}
    assert (np.abs(step.torque) <= 0.02 * tick.stack.robot.limits.effort + 1e-12).all()


def test_a_tick_without_an_answer_bears_the_weight_and_damps() -> None:
    _, q, v = standing()
    tick = controller("talos").clone()
    tick.reset(q)
    held = tick.step(q, v).forces
    v = v + 0.01
    tick["left foot"].target = pin.SE3(np.eye(3), np.array([1e300, 0.0, 0.0]))
    step = tick.step(q, v)
    assert step.status == "braked"
    weight = 9.81 * pin.computeTotalMass(tick.stack.robot.model)
    for name, force in step.forces.items():
        assert force == pytest.approx(held[name], abs=0.2 * weight)
    assert np.abs(step.a + 20.0 * v).max() < 5.0
    assert np.isfinite(step.torque).all()
    assert (np.abs(step.torque) <= tick.stack.robot.limits.effort).all()


def test_squeezing_grips_share_a_load_within_their_ratings() -> None:
    """The walker pulls its hand hard: no grip exceeds its rating, whatever is asked for."""
    tick, bot = controller("walker").clone(), robot("walker")
    q, v = bot.neutral.copy(), np.zeros(bot.nv)
    tick.reset(q)
    tick["hand"].target = tick["hand"].target + np.array([3.0, 0.0, 0.0])
    tick["hand"].set(stiffness=400.0, damping=40.0)
    most = 0.0
    for _ in range(30):
        step = tick.step(q, v)
        for name in ("grip 1", "grip 2"):
            load = np.abs(step.forces[name]) / np.array([300.0, 300.0, 300.0, 80.0, 90.0, 100.0])
            most = max(most, float(load.max()))
        q, v = pin.integrate(bot.model, q, 0.5 * (v + step.v) * DT), step.v
    # the tolerance of rows in the certificate: 3e-5 N of 300 N
    assert 0.99 < most <= 1.0 + 1e-7


def test_velocity_and_acceleration_level_hold_the_frame() -> None:
    bot = robot("walker")
    stack = Stack(bot, dt=DT).add(EndEffector("arm3_hand", kind="position"), name="hand")
    stack.add(RigidGrasp("arm1_hand", force=300.0), name="grip")
    for command in ("velocity", "acceleration"):
        tick = stack.compile(command=command, backend="vm")
        tick.reset(bot.neutral)
        tick["hand"].target = tick["hand"].target + 0.3
        step = tick.step(bot.neutral, np.zeros(bot.nv))
        J = PinocchioState(bot.model, bot.neutral, np.zeros(bot.nv)).frame("arm1_hand").J
        assert np.abs(J @ step.command).max() < 1e-9
        assert np.abs(step.command).max() > 0.01
        for name in ("torque", "forces"):
            with pytest.raises(CommandError, match="commands"):
                getattr(step, name)


def test_robots_without_mass_have_no_torques() -> None:
    import wbc.robots

    bare = wbc.robots.load("walker")
    stack = Stack(bare, dt=DT).add(EndEffector("arm3_hand"), name="hand")
    with pytest.raises(CommandError, match="no mass"):
        stack.compile(command="torque")
    assert stack.commanding("acceleration").command == "acceleration"
