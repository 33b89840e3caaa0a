"""Boxes, polyhedra and cones: margins where they are singular or infinite, and bad declarations and run-time values."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.evaluation import Numbers, numbers
from tests.models import placement
from tests.tasks.robots import FRAMES, random_configuration, robot
from wbc.api import Controller
from wbc.controller import core_of
from wbc.errors import BoundsError, NotFiniteError, ShapeError, UnknownNameError, WbcError
from wbc.tasks import AxisCone, GazeCone, Item, JointLimits, Posture, WorkspaceBox, WorkspacePolyhedron
from wbc.tasks._cone import COINCIDENT

HAND = "panda_hand"
INF = np.inf


# Margins at singular places


def defaults(found: Numbers, **values: Any) -> dict[str, Any]:
    return {d.name: d.default for d in found.item.inputs(found.robot)} | values


@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 0, 0), (0, -1, 0), (1, -2, 0.5)])
@pytest.mark.parametrize("relative", [False, True])
@pytest.mark.parametrize("name", ["panda", "talos"])
def test_cone_has_a_derivative_at_every_angle(name: str, relative: bool, axis: tuple[float, float, float]) -> None:
    """Unit slope at and beyond the cone, so at pi, too; slope 0 on the axis; nothing jumps on the way."""
    machine, f, rng, half = robot(name), FRAMES[name], np.random.default_rng(1), 0.5
    base = f.base if relative else "world"
    found = numbers(AxisCone(f.tip, half, axis=axis, relative_to=base), machine)
    unit = np.array(axis) / np.linalg.norm(axis)
    across = np.cross(unit, [0.3, 0.5, -0.8])
    across /= np.linalg.norm(across)
    q = random_configuration(machine, rng)
    seen = placement(machine, base, q).rotation.T @ placement(machine, f.tip, q).rotation
    spin = relative_spin(machine, f.tip, base, q)
    for theta in (0.0, 1e-12, 1e-7, 0.2, half, 1.0, 3.0, np.pi - 1e-7, np.pi - 1e-12, np.pi):
        direction = seen @ pin.exp3(theta * across) @ unit
        here = found(q, defaults(found, direction=direction, half_angle=half))
        wanted = half - theta if theta > half else (half**2 - theta**2) / (2 * half)
        assert here["value"][0] == pytest.approx(wanted, abs=4e-10)
        assert np.isfinite(here["jacobian"]).all()
        # Turning the frame about an axis b across its own changes the angle by at most 1 a radian: J = slope b' spin
        slope = np.linalg.norm(np.linalg.lstsq(spin.T, here["jacobian"][0], rcond=None)[0])
        assert slope == pytest.approx(min(theta / half, 1.0), abs=1e-6)


def relative_spin(machine: Any, frame: str, base: str, q: np.ndarray) -> np.ndarray:
    """Angular velocity of a frame against a base, in its own axes, as a matrix of v."""
    model, data = machine.model, machine.model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)

    def spin(name: str) -> np.ndarray:
        if name == "world":
            return np.zeros((3, machine.nv))
        return np.array(pin.getFrameJacobian(model, data, model.getFrameId(name), pin.LOCAL_WORLD_ALIGNED))[3:]

    return placement(machine, frame, q).rotation.T @ (spin(frame) - spin(base))


@pytest.mark.parametrize("distance", [0.0, 1e-13, 0.9 * COINCIDENT, 1.1 * COINCIDENT, 1e-6])
@pytest.mark.parametrize("half", [0.1, 1.5, np.pi])
def test_view_has_a_derivative_in_its_apex(half: float, distance: float) -> None:
    machine, apex = robot("panda"), np.array([0.1, -0.2, 0.05])
    found = numbers(GazeCone(HAND, half, apex=tuple(apex)), machine)
    q = random_configuration(machine, np.random.default_rng(2))
    for ray in [*np.eye(3), *-np.eye(3), np.ones(3) / np.sqrt(3)]:
        point = placement(machine, HAND, q).act(apex + distance * ray)
        here = found(q, defaults(found, point=point))
        assert abs(here["value"][0]) < np.pi * (distance + 3 * COINCIDENT)
        assert np.isfinite(here["jacobian"]).all()
        assert np.abs(here["jacobian"]).max() < 4.0
        assert np.isfinite(here["drift"]).all()


@pytest.mark.parametrize("theta", [0.0, np.pi])
def test_view_along_its_axis(theta: float) -> None:
    """Ahead and straight behind: the value is that of the formula and some way leads out."""
    machine, half = robot("panda"), 0.4
    found = numbers(GazeCone(HAND, half), machine)
    q = random_configuration(machine, np.random.default_rng(3))
    point = placement(machine, HAND, q).act(np.array([0.0, 0.0, np.cos(theta)]))
    here = found(q, defaults(found, point=point))
    assert here["value"][0] == pytest.approx(half / 2 if theta == 0.0 else half - np.pi, abs=1e-9)
    assert np.isfinite(here["jacobian"]).all()
    assert np.abs(here["jacobian"]).max() > 0.05


# Infinite sides and walls that cross


def stack(*items: Item) -> wbc.Stack:
    out = wbc.Stack(wbc.robots.load("panda", shapes="none"), 0.01)
    for k, item in enumerate(items):
        out.add(item, name=f"item {k}")
    return out.add(Posture(), name="rest").add(JointLimits(acceleration=False), name="limits")


Q = np.array([0.0, -0.5, 0.0, -2.0, 0.3, 1.6, 0.7])


@cache
def guarded(backend: str) -> Controller:
    box, walls = WorkspaceBox(HAND, lower=-2.0, upper=2.0), WorkspacePolyhedron(HAND, np.eye(3), offsets=-2.0)
    return stack(box, walls, AxisCone(HAND, 3.0), GazeCone(HAND, 3.0)).compile(backend=backend)


def fresh(backend: str) -> Controller:
    controller = guarded(backend)
    controller["item 0"].set(lower=[-2.0] * 3, upper=[2.0] * 3, lower_rate=np.zeros(3), upper_rate=np.zeros(3))
    controller["item 1"].offsets = [-2.0] * 3
    controller.reset(Q)
    controller["rest"].target = Q
    return controller


@pytest.mark.parametrize("backend", ["vm", "native"])
def test_infinite_sides_are_no_limit(backend: str) -> None:
    controller = fresh(backend)
    controller["item 0"].set(lower=[-INF, -INF, 0.0], upper=INF * np.ones(3))
    controller["item 1"].offsets = [-INF, 0.0, -INF]
    step = controller.step(Q)
    assert step.status == "solved"
    assert step.certificate.error_bound < 1e-6
    assert np.isfinite(step.v).all()
    for margins in (step.margins, step.margins_ahead):
        assert np.isinf(margins["item 0"]).tolist() == [True, True, False, True, True, True]
        assert (margins["item 0"] > 0).all()
        assert np.isinf(margins["item 1"]).tolist() == [True, False, True]
    assert controller["item 0"].lower.tolist() == [-INF, -INF, 0.0]


@pytest.mark.parametrize("backend", ["vm", "native"])
def test_infinite_sides_beside_rows_that_give_way(backend: str) -> None:
    """A wall half a metre past the hand asks for more than the joints can; the infinite sides stay out of it."""
    controller = fresh(backend)
    controller["item 0"].set(lower=[-INF, -INF, 1.2], upper=INF * np.ones(3))
    controller["item 1"].offsets = [0.9, -INF, -INF]
    controller["item 0"].rate = controller["item 1"].rate = 50.0
    step = controller.step(Q)
    assert step.status == "relaxed"
    assert {(slack.item, slack.row) for slack in step.relaxed} <= {("item 0", "z.lower"), ("item 1", "plane[0]")}
    assert np.isfinite(step.v).all()
    assert np.abs(step.v).max() > 0.1


def test_sides_that_are_left_out_have_no_rows() -> None:
    machine = robot("panda")
    labels = [row.label for row in WorkspaceBox(HAND, upper=1.0).rows(machine)]
    assert labels == ["x.upper", "y.upper", "z.upper"]
    assert [d.name for d in WorkspaceBox(HAND, upper=1.0).inputs(machine)] == ["upper", "upper_rate"]
    assert len(WorkspaceBox(HAND, lower=0.0, upper=1.0).rows(machine)) == 6
    assert [row.unit for row in AxisCone(HAND, 1.0).rows(machine)] == ["rad"]
    assert [row.unit for row in GazeCone(HAND, 1.0).rows(machine)] == ["m"]


def test_first_values_are_not_in_the_code() -> None:
    machine, turned = robot("panda"), pin.SE3.Random()
    pairs = [
        (WorkspaceBox(HAND, lower=0.0), WorkspaceBox(HAND, lower=(1, 2, 3))),
        (WorkspacePolyhedron(HAND, np.eye(3)), WorkspacePolyhedron(HAND, np.eye(3), offsets=(1, 2, 3), pose=turned)),
        (AxisCone(HAND, 1.0), AxisCone(HAND, 2.0, direction=(1, 0, 0))),
        (GazeCone(HAND, 1.0), GazeCone(HAND, 2.0, point=(1, 0, 0))),
    ]
    for one, other in pairs:
        assert one.declaration(machine) == other.declaration(machine)
    others = [WorkspaceBox(HAND, upper=0.0), WorkspaceBox(HAND, lower=0.0, upper=1.0)]
    others += [WorkspaceBox(HAND, lower=0.0, offset=(0, 0, 1)), WorkspacePolyhedron(HAND, -np.eye(3))]
    others += [AxisCone(HAND, 1.0, axis=(1, 0, 0)), GazeCone(HAND, 1.0, apex=(0, 0, 1))]
    keys = [repr(item.declaration(machine)) for item in (*[one for one, _ in pairs], *others)]
    assert len(set(keys)) == len(keys)


# Bad declarations


# Bad run-time values

VALUES: dict[str, tuple[str, dict[str, Any], type[WbcError], str]] = {
    "lower above upper": ("item 0", {"lower": [0.0, 0.0, 2.5]}, BoundsError, "item 0.lower"),
    "upper below lower": ("item 0", {"upper": [2.0, -2.5, 2.0]}, BoundsError, "item 0.upper"),
    "both crossed": ("item 0", {"lower": [3.0] * 3, "upper": [3.0, 2.9, 3.0]}, BoundsError, "lower is above upper"),
    "one good, one bad": ("item 0", {"upper": [3.0] * 3, "lower": [0.0, 1.0]}, ShapeError, "item 0.lower"),
    "wrong infinity": ("item 0", {"lower": [INF, 0.0, 0.0]}, NotFiniteError, "-inf for no limit"),
    "unknown": ("item 0", {"lower": [0.0] * 3, "middle": 1.0}, UnknownNameError, "item 0.middle"),
    "no input": ("item 0", {"enabled": False}, UnknownNameError, "item 0.enabled"),
    "offsets": ("item 1", {"offsets": [INF, 0.0, 0.0]}, NotFiniteError, "-inf for no limit"),
}


@pytest.mark.parametrize("case", VALUES)
def test_bad_value_changes_nothing(case: str) -> None:
    name, values, error, text = VALUES[case]
    controller = fresh("vm")
    before = core_of(controller).tick.p.copy()
    ways: list[Callable[[], None]] = [lambda: controller[name].set(**values)]
    if len(values) == 1 and "enabled" not in values:
        ((key, value),) = values.items()
        ways.append(lambda: setattr(controller[name], key, value))
    for way in ways:
        with pytest.raises(WbcError) as caught:
            way()
        assert isinstance(caught.value, error)
        assert text in str(caught.value)
        assert np.array_equal(core_of(controller).tick.p, before)


def test_a_box_moves_past_itself() -> None:
    """Each side alone would cross the other."""
    controller = fresh("vm")
    controller["item 0"].set(lower=[5.0] * 3, upper=[6.0] * 3)
    controller["item 0"].set(lower=[-6.0] * 3, upper=[-5.0] * 3)
    controller["item 0"].lower = controller["item 0"].upper
    assert controller["item 0"].lower.tolist() == [-5.0] * 3


def test_directions_are_kept_at_unit_length() -> None:
    controller = fresh("vm")
    for given in ([0, 0, 5], np.array([0.0, 0.0, 1e-9]), [0, 0, 1e200]):
        controller["item 2"].direction = given
        assert controller["item 2"].direction.tolist() == [0.0, 0.0, 1.0]
