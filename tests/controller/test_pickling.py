"""Declarations cross processes: what comes out of a pickle is what went in, to the bits of a step."""

from __future__ import annotations

import copy
import dataclasses
import pickle
import sys
from dataclasses import replace
from typing import Any

import cloudpickle
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.items import ITEMS
from tests.stack import small
from tests.tasks.robots import robot
from wbc import Stack
from wbc.errors import PicklingError
from wbc.robot import Coupling, Robot
from wbc.shapes import Convex, PlacedShape, Sphere
from wbc.stack.key import key
from wbc.tasks import Expression, Item, Limit, Posture

TETRAHEDRON = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]])


def through_pickle(thing: Any) -> Any:
    return pickle.loads(pickle.dumps(thing))


def used(stack: Stack) -> Stack:
    """The stack after everything that a robot or item works out from itself was asked for."""
    key(stack, "1")
    for entry in stack.entries:
        entry.item.rows(stack.robot)
        entry.item.inputs(stack.robot)
    return stack


@pytest.mark.parametrize("class_name", ITEMS)
def test_every_item_comes_out_as_it_went_in(class_name: str) -> None:
    machine = robot("panda")
    for k, (item, _) in enumerate(ITEMS[class_name](machine)):
        stack = Stack(machine, 0.005)
        # a mechanism is in the stack already
        if class_name != "Mechanism":
            stack.add(item, name=f"item{k}")
        used(stack)
        for copied in (through_pickle, copy.deepcopy):
            other = copied(item)
            assert type(other) is type(item)
            assert other is not item
            assert set(vars(other)) == {f.name for f in dataclasses.fields(item)}
            assert other.declaration(machine) == item.declaration(machine)
            again = copied(stack)
            assert again.robot is not machine
            assert key(again, "1") == key(stack, "1")
            assert [(e.name, e.level, e.weight) for e in again.entries] == [
                (e.name, e.level, e.weight) for e in stack.entries
            ]


@pytest.mark.parametrize("name", ["panda", "talos", "kinova", "tiago", "ur5_gripper"])
def test_robots(name: str) -> None:
    """Mimic joints, unbounded joints, floating and mobile bases; nothing that was worked out is in the pickle."""
    machine = replace(wbc.robots.load(name), couplings=(Coupling(2, 1, 0.5, 0.1),))
    before = machine.fingerprint
    assert machine.dof_names
    for other in (machine, through_pickle(machine), copy.deepcopy(machine)):
        with pytest.raises(ValueError, match="read-only"):
            other.neutral[0] += 0.3
    for other in (through_pickle(machine), copy.deepcopy(machine)):
        assert set(vars(other)) == {f.name for f in dataclasses.fields(Robot)}
        assert other.model == machine.model
        assert other.fingerprint == before
        assert other.couplings == machine.couplings
        assert (other.dof_names, other.dof_units) == (machine.dof_names, machine.dof_units)
        assert dict(other.frames) == dict(machine.frames)
        with pytest.raises(ValueError, match="read-only"):
            other.limits.velocity[0] = 9.0


def test_shapes_stay_read_only() -> None:
    placed = PlacedShape(Convex(TETRAHEDRON), pin.SE3.Random(), 0.01)
    for other in (through_pickle(placed), copy.deepcopy(placed)):
        assert other.shape == placed.shape
        assert hash(other.shape) == hash(placed.shape)
        assert np.array_equal(other.placement.homogeneous, placed.placement.homogeneous)
        assert other.excess == 0.01
        with pytest.raises(ValueError, match="read-only"):
            other.shape.points[0] = 0.0
    assert through_pickle(PlacedShape(Sphere(0.2), pin.SE3.Identity())).shape == Sphere(0.2)


# Steps


def test_copies_are_independent() -> None:
    stack = small.stack()
    for other in (through_pickle(stack), copy.deepcopy(stack), copy.copy(stack)):
        other.add(Posture(), name="more")
        assert "more" not in stack


# Functions


def first_joint(kin: Any, p: Any) -> Any:
    """A function with a name."""
    return kin.q[0] - 0.25


class Ramp:
    """A callable object."""

    def __init__(self, slope: float) -> None:
        self.slope = slope

    def __call__(self, kin: Any, p: Any) -> Any:
        return self.slope * kin.q[0] - 0.25


def expression(function: Any) -> Expression:
    return Expression(function, units="rad")


def without_cloudpickle(patch: pytest.MonkeyPatch) -> None:
    patch.setitem(sys.modules, "cloudpickle", None)


def test_functions_with_a_name_need_no_other_package(monkeypatch: pytest.MonkeyPatch) -> None:
    without_cloudpickle(monkeypatch)
    assert through_pickle(expression(first_joint)).function is first_joint
    assert through_pickle(expression(Ramp(2.0))).function.slope == 2.0
    assert b"cloudpickle" not in pickle.dumps(small.stack().add(expression(first_joint)))


def test_lambdas_go_by_value() -> None:
    slope = 0.5
    item = expression(lambda kin, p: slope * kin.q[0] - 0.25)
    for loads, dumps in ((pickle.loads, pickle.dumps), (cloudpickle.loads, cloudpickle.dumps)):
        other = loads(dumps(item))
        assert other.declaration(small.arm()) == item.declaration(small.arm())
        assert other.function is not item.function
        assert other.declaration(small.arm()) != expression(lambda kin, p: 0.4 * kin.q[0] - 0.25).declaration(
            small.arm()
        )


def test_lambdas_without_cloudpickle_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    without_cloudpickle(monkeypatch)
    item = expression(lambda kin, p: kin.q[0])
    with pytest.raises(PicklingError, match="top of a module, or install cloudpickle") as caught:
        pickle.dumps(item)
    assert caught.value.field == "Expression.function"
    assert isinstance(caught.value, pickle.PicklingError)
    for name, part in (("height", item), ("bounded", Limit(item, lower=-0.1))):
        stack = small.stack().add(part, name=name)
        with pytest.raises(PicklingError, match=f"^{name}.Expression.function: ") as caught:
            pickle.dumps(stack)
        assert caught.value.field == f"{name}.Expression.function"
        # a copy in this process needs no name
        assert key(copy.deepcopy(stack), "1") == key(stack, "1")


def test_functions_that_hold_what_cannot_be_pickled() -> None:
    here = small.stack().compile(backend="vm")

    def local(kin: Any, p: Any) -> Any:
        return kin.q[0] - here.stack.dt

    with pytest.raises(PicklingError, match="cannot be pickled by value"):
        pickle.dumps(small.stack().add(expression(local), name="mine"))


# What is refused


def test_pickles_of_another_version_are_refused() -> None:
    for thing, field in ((Posture(), "joints"), (small.arm(), "limits"), (small.arm().limits, "effort")):
        state = dict(thing.__getstate__())
        del state[field]
        with pytest.raises(PicklingError, match=f"another version of this class, without {field}"):
            object.__new__(type(thing)).__setstate__(state)
    assert isinstance(Posture(), Item)


def test_controllers_stay_in_their_process() -> None:
    here = small.stack().compile(backend="vm")
    for attempt in (pickle.dumps, cloudpickle.dumps, copy.deepcopy, copy.copy):
        with pytest.raises(PicklingError, match=r"pickle controller\.stack"):
            attempt(here)
