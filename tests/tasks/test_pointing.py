"""Axes, cameras, distances and momentum: values by scipy and Pinocchio, singular directions, bad input."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.evaluation import numbers, slope
from tests.items import ITEMS
from tests.models import placement
from tests.rates import axes
from tests.tasks.robots import FRAMES, NAMES, random_configuration, robot
from wbc.api import Controller
from wbc.robot import Limits, Robot
from wbc.tasks import AxisAlign, Distance, Item, LookAt, Momentum

STATES = 2
HAND = "panda_hand"


def declared(name: str, *classes: str) -> list[tuple[Item, dict[str, Any]]]:
    return [pair for cls in classes for pair in ITEMS[cls](robot(name))]


@pytest.mark.parametrize("name", ["panda", "talos"])
@pytest.mark.parametrize("short", [0.0, 1e-12, 1e-6, 1e-3, 0.1])
def test_opposite_and_aligned_directions(name: str, short: float) -> None:
    """Finite with rows of unit size at and near theta = pi and 0; at pi the turn is about ``around``."""
    machine = robot(name)
    rng = np.random.default_rng(11)
    for item, _ in declared(name, "AxisAlign"):
        assert isinstance(item, AxisAlign)
        found = numbers(item, machine)
        for _ in range(STATES):
            q = random_configuration(machine, rng)
            frame = placement(machine, item.relative_to, q).actInv(placement(machine, item.frame, q))
            rows, angle = frame.rotation @ axes(item), rng.uniform(-np.pi, np.pi)
            tilted = pin.exp3(short * (np.cos(angle) * rows[:, 0] + np.sin(angle) * rows[:, 1])) @ rows[:, 2]
            for sign in (1.0, -1.0):
                here = found(q, {"target": sign * tilted, "feedforward": np.zeros(3)})
                e = here["value"]
                assert all(np.isfinite(x).all() for x in here.values())
                sizes = np.linalg.svd(here["jacobian"], compute_uv=False)
                assert sizes[0] < 10.0
                np.testing.assert_allclose(np.linalg.norm(e), short if sign > 0 else np.pi - short, rtol=0, atol=1e-9)
                if sign < 0 and short <= 1e-12:
                    np.testing.assert_allclose(e, [np.pi, 0.0], rtol=0, atol=1e-12)
                if short >= 1e-6:
                    wanted = -short if sign > 0 else np.pi - short
                    np.testing.assert_allclose(e, wanted * np.array([np.cos(angle), np.sin(angle)]), rtol=0, atol=1e-8)


@pytest.mark.parametrize("axis", [(0, 0, 1), (0, 0, -3), (1, 0, 0), (0, 2, 0), (1, 1, 1), (-1e-9, 5, 3), (1e200, 0, 1)])
def test_row_axes_of_any_axis(axis: tuple[float, float, float]) -> None:
    from wbc.tasks._pointing import row_axes

    item = AxisAlign(HAND, axis=axis)
    rows = row_axes(item.axis, item.around)
    np.testing.assert_allclose(rows.T @ rows, np.eye(3), rtol=0, atol=1e-15)
    assert np.linalg.det(rows) > 0
    np.testing.assert_allclose(
        rows[:, 2],
        np.array(axis) / np.linalg.norm(np.array(axis) / np.abs(axis).max()) / np.abs(axis).max(),
        rtol=0,
        atol=1e-15,
    )


def controller(item: Item, machine: Robot) -> Controller:
    stack = wbc.Stack(machine, dt=0.01)
    stack.add(item, name="item")
    return stack.compile(backend="vm")


@pytest.mark.parametrize("relative", [False, True])
def test_camera_fades_where_the_target_is(relative: bool) -> None:
    machine, f = wbc.robots.load("panda"), FRAMES["panda"]
    base = f.base if relative else "world"
    item = LookAt(f.tip, offset=(0.02, 0.0, 0.05), relative_to=base)
    tick, q = controller(item, machine), random_configuration(machine, np.random.default_rng(2))
    tick.step(q)
    camera = placement(machine, base, q).actInv(placement(machine, f.tip, q)).act(np.array(item.offset))
    width = item.width * machine.characteristic_length
    for away in np.eye(3):
        for distance in (0.0, 1e-13, 1e-6, 0.05, 0.3, 0.7, 1.001, 3.0):
            tick["item"].target = camera + distance * width * away
            tick["item"].feedforward = (0.1, -0.2, 0.3)
            step = tick.step(q)
            assert np.isfinite(step.v).all()
            assert np.isfinite(step.residuals["item"].values).all()
            assert (np.abs(step.v).max() == 0.0) == (distance <= 0.05)
            assert step.faded == (("item",) if distance < 1.0 else ())


@pytest.mark.parametrize("relative", [False, True])
def test_coinciding_points_part_along_z_of_the_other_frame(relative: bool) -> None:
    machine, f = robot("panda"), FRAMES["panda"]
    base = f.base if relative else "world"
    q = random_configuration(machine, np.random.default_rng(2))
    found = numbers(Distance(f.tip, base, offset=(0.02, 0.0, 0.05)), machine)
    other = placement(machine, base, q)
    point = other.actInv(placement(machine, f.tip, q)).act(np.array((0.02, 0.0, 0.05)))
    still = {"feedforward": 0.0, "point_velocity": np.zeros(3), "target": 0.1}
    here = found(q, still | {"point": point})
    np.testing.assert_allclose(here["value"], [-0.1], rtol=0, atol=1e-9)
    v = np.random.default_rng(3).uniform(-1, 1, machine.nv)
    tip = slope(lambda t: other_z(machine, base, f.tip, pin.integrate(machine.model, q, t * v), point))
    np.testing.assert_allclose(here["jacobian"] @ v, tip, rtol=0, atol=1e-6)


def other_z(machine: Robot, base: str, frame: str, q: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Height of the first point above the second, along the other frame's z axis."""
    first = placement(machine, frame, q).act(np.array((0.02, 0.0, 0.05)))
    return (placement(machine, base, q).actInv(first) - point)[2:]


def test_first_value_of_the_point_is_that_of_the_field() -> None:
    machine, f = wbc.robots.load("talos"), FRAMES["talos"]
    tick = controller(Distance(f.tip, f.base, point=(0.1, 0.2, 0.3)), machine)
    step = tick.step(machine.neutral)
    assert np.abs(step.v).max() < 1e-9
    assert tick["item"].point.tolist() == [0.1, 0.2, 0.3]
    second = placement(machine, f.base, machine.neutral).act(np.array((0.1, 0.2, 0.3)))
    first = placement(machine, f.tip, machine.neutral).translation
    assert tick["item"].target == pytest.approx(np.linalg.norm(first - second), abs=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_rows_of_momentum_count_alike(name: str) -> None:
    """A body of the robot's mass and mean inertia that moves at L a second and turns at 1 rad/s costs 1 a row."""
    machine = robot(name)
    data, length = machine.model.createData(), machine.characteristic_length
    pin.ccrba(machine.model, data, machine.neutral, np.zeros(machine.nv))
    mass, mean = data.Ig.mass, np.trace(data.Ig.inertia) / 3
    wanted = np.repeat([1 / (mass * length) ** 2, 1 / mean**2], 3)
    np.testing.assert_allclose(Momentum().row_weights(machine), wanted, rtol=1e-12)
    np.testing.assert_allclose(Momentum("angular").row_weights(machine), wanted[3:], rtol=1e-12)
    weighed = Momentum("linear", weights=(1, 2, 0)).row_weights(machine)
    np.testing.assert_allclose(weighed, wanted[:3] * np.array([1, 2, 0]), rtol=1e-12)


def test_momentum_of_a_point_mass_has_finite_weights() -> None:
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "turn")
    model.appendBodyToJoint(joint, pin.Inertia(2.0, np.array([0.3, 0.0, 0.0]), np.zeros((3, 3))), pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    none = np.full(1, np.inf)
    single = Robot("single", model, Limits(-none, none, none, none, none))
    assert np.isfinite(Momentum().row_weights(single)).all()
    tick = controller(Momentum(), single)
    tick["item"].target = (0.0, 0.6, 0.0, 0.0, 0.0, 0.0)
    np.testing.assert_allclose(tick.step([0.0]).v, [1.0], rtol=1e-5)
