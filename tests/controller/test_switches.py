"""Run-time switches, masks, weights and gains: the same answer as from a stack that is declared that way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.controller.stacks import DT, FRAMES, controller, inside, robot
from wbc import Controller, Stack
from wbc.shapes import HalfSpace, Sphere
from wbc.tasks import (
    CenterOfMass,
    Damping,
    Elbow,
    EndEffector,
    Expression,
    Fixed,
    FrameVelocityLimit,
    Hold,
    Item,
    JointLimits,
    Obstacle,
    PitchPlane,
    PitchPlaneLimit,
    Posture,
)
from wbc.tasks.base import registry

TIP, MIDDLE, PLANE = FRAMES["panda"].tip, FRAMES["panda"].middle, FRAMES["panda"].plane
JOINTS = robot("panda").joint_names
LINKS = tuple(robot("panda").shapes)[1:]
STATES = 8
TARGET = pin.SE3(pin.exp3(np.array([0.3, 2.0, 0.7])), np.array([0.4, 0.2, 0.6]))


@dataclass(frozen=True, eq=False)
class Kind:
    """An item, the rows to keep, and an item that has these rows only; values to write before."""

    item: Item
    keep: tuple[int, ...] = ()
    part: Item | None = None
    values: Mapping[str, Any] = field(default_factory=dict)
    #: values of the part where they are not those of the item
    part_values: Mapping[str, Any] | None = None


KINDS = {
    "pose, position": Kind(
        EndEffector(TIP),
        (0, 1, 2),
        EndEffector(TIP, kind="position"),
        {"target": TARGET},
        {"target": TARGET.translation},
    ),
    "pose, orientation": Kind(
        EndEffector(TIP),
        (3, 4, 5),
        EndEffector(TIP, kind="orientation"),
        {"target": TARGET},
        {"target": TARGET.rotation},
    ),
    "elbow": Kind(
        Elbow(MIDDLE),
        (1, 2),
        Expression(lambda kin, p: kin.position(MIDDLE)[1:] - np.array([0.1, 0.4]), units="m"),
        {"target": (0.5, 0.1, 0.4)},
        {},
    ),
    "mass": Kind(
        CenterOfMass(),
        (2,),
        Expression(lambda kin, p: kin.center_of_mass()[2] - 0.3, units="m"),
        {"target": (0.1, 0.1, 0.3)},
        {},
    ),
    "posture": Kind(Posture(), (0, 2, 5), Posture((JOINTS[0], JOINTS[2], JOINTS[5])), {"target": np.full(7, 0.3)}),
    "damping": Kind(
        Damping(weights=(1, 2, 3, 4, 5, 6, 7)), (1, 6), Damping(weights=(0, 2, 0, 0, 0, 0, 7)), {"weight": 3.0}
    ),
    "plane": Kind(PitchPlane(*PLANE), values={"target": 1.0}),
    "expression": Kind(
        Expression(lambda kin, p: kin.q[:2] - 1.0, units="rad"),
        (1,),
        Expression(lambda kin, p: kin.q[1] - 1.0, units="rad"),
    ),
    "limits": Kind(JointLimits(margin=0.4), (1, 3), JointLimits(margin=0.4, joints=(JOINTS[1], JOINTS[3]))),
    "fixed": Kind(Fixed(JOINTS[:3], acceleration=False), (0, 3, 4, 5, 6), Fixed(JOINTS[0], acceleration=False)),
    "hold": Kind(Hold(TIP), (0, 1, 2), Hold(TIP, kind="position")),
    "hold, turning": Kind(Hold(TIP), (3, 4, 5), Hold(TIP, kind="orientation")),
    "speed": Kind(FrameVelocityLimit(TIP, linear=0.1, angular=0.1), (3, 4, 5), FrameVelocityLimit(TIP, angular=0.1)),
    "ball": Kind(
        Obstacle(Sphere(0.2), links=LINKS, pose=pin.SE3(np.eye(3), np.array([0.4, 0.0, 0.5]))),
        (0, 1),
        Obstacle(Sphere(0.2), links=LINKS[0], pose=pin.SE3(np.eye(3), np.array([0.4, 0.0, 0.5]))),
        {"rate": 2.0},
    ),
    "floor": Kind(
        Obstacle(HalfSpace(), links=LINKS),
        (0, 1, 2),
        Obstacle(HalfSpace(), links=LINKS[0]),
        {"pose": pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.2])), "rate": 2.0},
    ),
    "plane limit": Kind(PitchPlaneLimit(*PLANE, lower=-0.6, upper=0.6), values={"rate": 2.0}),
}


def declare(item: Item | None, backend: str) -> Controller:
    """A posture that leaves nothing singular, and the item."""
    stack = Stack(robot("panda"), DT).add(Posture(weights=(1, 1.5, 1, 2, 1, 1, 0.5)), name="rest", weight=0.3)
    if item is not None:
        stack.add(item, name="item")
    return stack.compile(backend=backend)


@cache
def without() -> Controller:
    return declare(None, "vm")


def write(controller: Controller, values: Mapping[str, Any]) -> None:
    for key, value in values.items():
        setattr(controller["item"], key, value)


def answers(controller: Controller) -> np.ndarray:
    """Commands at some states, each about a measured velocity, towards a posture far away."""
    rng, out = np.random.default_rng(8), []
    controller.reset(robot("panda").neutral)
    controller["rest"].target, controller["rest"].gain = np.array([1.0, -1.0, 1.5, -0.5, -1.5, 0.2, 2.0]), 3.0
    for _ in range(STATES):
        q = inside(robot("panda"), rng, 0.7)
        out.append(controller.step(q, 0.3 * rng.normal(size=7)).v)
    return np.array(out)


def close(one: np.ndarray, two: np.ndarray) -> bool:
    return bool(np.abs(one - two).max() < 1e-12)


def differ(one: np.ndarray, two: np.ndarray) -> bool:
    return bool(np.abs(one - two).max() > 1e-4)


def test_every_class_is_here() -> None:
    shipped = {name for name, kind in registry().items() if kind.__module__.startswith("wbc.tasks")} - {"Mechanism"}
    assert {type(kind.item).__name__ for kind in KINDS.values()} == shipped


@pytest.mark.parametrize("name", KINDS)
def test_switched_off_is_not_there(name: str) -> None:
    one = declare(KINDS[name].item, "vm")
    write(one, KINDS[name].values)
    on, off = answers(one), answers(without())
    assert differ(on, off)
    one["item"].enabled = False
    assert close(answers(one), off)
    one["item"].enabled = True
    assert close(answers(one), on)
    one["item"].mask = 0.0
    assert close(answers(one), off)
    one["item"].mask = 1.0
    assert close(answers(one), on)
    if one.layout.blocks["item"].form == "task":
        one["item"].weight = 0.0
        assert close(answers(one), off)


@pytest.mark.parametrize("name", [name for name, kind in KINDS.items() if kind.part is not None])
def test_a_masked_row_is_not_there(name: str) -> None:
    kind = KINDS[name]
    one, other = declare(kind.item, "vm"), declare(kind.part, "vm")
    write(one, kind.values)
    write(other, kind.values if kind.part_values is None else kind.part_values)
    whole = answers(one)
    mask = np.zeros(len(one.layout.blocks["item"].rows))
    mask[list(kind.keep)] = 1.0
    one["item"].mask = mask
    part = answers(one)
    assert differ(part, whole)
    assert differ(part, answers(without()))
    assert close(part, answers(other))
    assert np.array_equal(one["item"].mask, mask)


def test_each_side_of_a_plane_limit() -> None:
    """With one side off: the whole limit where that side does not bind, and no limit where it alone binds."""
    whole, lower, upper, none = (declare(PitchPlaneLimit(*PLANE, lower=-0.6, upper=0.6), "vm") for _ in range(4))
    rng, seen = np.random.default_rng(9), set()
    for each, mask in ((whole, (1, 1)), (lower, (1, 0)), (upper, (0, 1)), (none, (0, 0))):
        each.reset(robot("panda").neutral)
        each["item"].mask, each["item"].rate = mask, 2.0
        each["rest"].target = np.zeros(7)
    for _ in range(20):
        q = inside(robot("panda"), rng, 0.7)
        steps = [each.step(q, np.zeros(7)) for each in (whole, lower, upper, none)]
        rows = [b.row for b in steps[0].binding]
        for row, kept, dropped in (("lower", 1, 2), ("upper", 2, 1)):
            if rows == [row]:
                seen.add(row)
                assert close(steps[kept].v, steps[0].v)
                assert close(steps[dropped].v, steps[3].v)
                assert differ(steps[kept].v, steps[3].v)
    assert seen == {"lower", "upper"}


def arm(backend: str, **hand: Any) -> Controller:
    stack = Stack(robot("panda"), DT)
    stack.add(EndEffector(TIP, gain=hand.get("gain")), name="hand", weight=hand.get("weight", 1.0))
    stack.add(Posture(), name="posture", weight=hand.get("posture", 0.01))
    stack.add(JointLimits(), name="limits")
    return stack.compile(backend=backend)


def walk(one: Controller, ticks: int = 8) -> list[bytes]:
    """A few ticks in open loop towards a target; all numbers of each."""
    q = inside(robot("panda"), np.random.default_rng(2), 0.3)
    out = []
    for tick in range(ticks):
        step = one.step(q)
        if tick == 0:
            one["hand"].target = TARGET
        q = pin.integrate(robot("panda").model, q, DT * step.v)
        out.append(step._data)
    return out


@pytest.mark.parametrize("backend", ["vm", "native"])
def test_weights_and_gains_written_are_weights_and_gains_declared(backend: str) -> None:
    declared, written = arm(backend, weight=0.3, posture=0.2), arm(backend)
    written["hand"].weight, written["posture"].weight = 0.3, 0.2
    assert walk(written) == walk(declared)
    if backend == "vm":
        declared, written = arm(backend, gain=7.5), arm(backend)
        assert written["hand"].gain == EndEffector.default_gain
        written["hand"].gain = 7.5
        assert declared["hand"].gain == 7.5
        assert walk(written) == walk(declared)
    assert walk(arm(backend)) != walk(declared)


@pytest.mark.parametrize("backend", ["vm", "native"])
def test_a_mask_multiplies_declared_row_weights(backend: str) -> None:
    """Row weight = weight * mask * declared row weight / scale^2."""
    one = controller("everything", "panda", backend=backend)
    span, length = one.layout.blocks["hand_in_base"].span, one.stack.length
    one["hand_in_base"].mask, one["hand_in_base"].weight = (1, 0, 2, 3, 0.5, 7), 0.25
    declared, scale = np.array([1, 2, 3, 4, 5, 0]), np.array([length] * 3 + [1.0] * 3)
    expected = 0.25 * np.array([1, 0, 2, 3, 0.5, 7]) * declared / scale**2
    np.testing.assert_allclose(one.tick.weight[span], expected, rtol=1e-15)
    one["hand_in_base"].enabled = False
    assert not one.tick.weight[span].any()
    one["hand_in_base"].enabled = True
    np.testing.assert_allclose(one.tick.weight[span], expected, rtol=1e-15)


@pytest.mark.parametrize("switch", ["ball", "limits", "posture"])
def test_switches_of_the_compiled_tick(switch: str) -> None:
    """The compiled tick with an item off against the virtual machine with the same item off, and against itself on."""
    found: dict[tuple[str, bool], np.ndarray] = {}
    for backend in ("native", "vm"):
        for on in (True, False):
            one = controller("arm", "panda", 0.3, backend=backend)
            one["hand"].enabled = False
            one["ball"].pose, one["ball"].rate = pin.SE3(np.eye(3), np.array([0.4, 0.0, 0.5])), 2.0
            one["posture"].target = np.array([1.0, -1.0, 1.5, -0.5, -1.5, 0.2, 2.0])
            one[switch].enabled = on
            rng = np.random.default_rng(8)
            steps = [one.step(inside(robot("panda"), rng, 0.7), 0.1 * rng.normal(size=7)) for _ in range(STATES)]
            found[backend, on] = np.array([s.v for s in steps])
    for on in (True, False):
        assert np.abs(found["native", on] - found["vm", on]).max() < 1e-6
    assert differ(found["native", True], found["native", False])


def test_an_item_that_is_off_binds_nothing_and_still_reports() -> None:
    one = declare(KINDS["floor"].item, "vm")
    write(one, {"pose": pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.8])), "enabled": False})
    one["rest"].enabled = False
    step = one.step(robot("panda").neutral)
    assert step.margins["item"].min() < 0.0
    assert step.binding == ()
    assert step.relaxed == ()
    one["item"].enabled = True
    assert {b.item for b in one.step(robot("panda").neutral).binding} == {"item"}
