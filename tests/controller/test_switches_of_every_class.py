"""One walk over the registry: whatever is switched off, by any of its switches, is as if it were not declared."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tests.items import ITEMS, SWITCHED
from tests.tasks.robots import random_configuration, robot
from wbc import Controller, Stack
from wbc.controller import core_of
from wbc.errors import NotFiniteError, RangeError, ShapeError
from wbc.robot import Robot
from wbc.tasks import JointLimits, Posture

DT = 0.005
STATES = 3


@cache
def machine() -> Robot:
    return robot("panda")


def declared(class_name: str | None) -> Controller:
    """A posture and joint limits, and one item of the class."""
    stack = Stack(machine(), DT).add(Posture(), name="posture").add(JointLimits(), name="limits")
    if class_name is not None:
        item, given = ITEMS[class_name](machine())[0]
        stack.add(item, name="it")
        out = stack.compile(backend="vm")
        out["it"].set(**given)
        return out
    return stack.compile(backend="vm")


@cache
def plain() -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...]:
    """(q, v, command) of the stack without the item."""
    one, rng = declared(None), np.random.default_rng(11)
    one.reset(machine().neutral)
    out = []
    for _ in range(STATES):
        q, v = random_configuration(machine(), rng), 0.2 * rng.uniform(-1.0, 1.0, machine().nv)
        out.append((q, v, one.step(q, v).v.copy()))
    return tuple(out)


def is_as_without(one: Controller) -> None:
    for q, v, wanted in plain():
        step = one.step(q, v)
        assert np.abs(step.v - wanted).max() < 1e-9
        assert not any(row.item == "it" for row in (*step.binding, *step.relaxed))


@pytest.mark.parametrize("class_name", SWITCHED)
def test_switched_off_is_not_declared(class_name: str) -> None:
    one = declared(class_name)
    one.reset(machine().neutral)
    it, block = one["it"], core_of(one).layout.blocks["it"]
    rows = len(block.rows)
    before = one.step(plain()[0][0], plain()[0][1])._data
    it.enabled = False
    is_as_without(one)
    it.enabled = True
    it.mask = 0
    is_as_without(one)
    it.mask = np.zeros(rows)
    is_as_without(one)
    it.mask = 1
    if block.form == "task":
        it.weight = 0.0
        is_as_without(one)
        it.weight = 1.0
        # half the weight in the mask is half the weight
        it.mask = 0.5
        halved = core_of(one).tick.weight[block.span].copy()
        it.mask, it.weight = 1.0, 0.5
        assert np.array_equal(core_of(one).tick.weight[block.span], halved)
        it.weight = 1.0
    # and on again is as before
    core_of(one).tick.reset()
    assert np.allclose(np.frombuffer(one.step(*plain()[0][:2])._data), np.frombuffer(before), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("class_name", SWITCHED)
def test_bad_values_and_switches_change_nothing(class_name: str) -> None:
    one = declared(class_name)
    it, rows = one["it"], len(core_of(one).layout.blocks["it"].rows)
    buffers = [getattr(core_of(one).tick, name) for name in ("weight", "enabled", "bound_enabled", "p")]
    before = [b.copy() for b in buffers]
    for name, bad, kind in (
        ("mask", -1.0, RangeError),
        ("mask", np.ones(rows + 1), ShapeError),
        ("mask", "on", ShapeError),
        ("enabled", 2, ShapeError),
        ("enabled", None, ShapeError),
    ):
        with pytest.raises(kind, match=rf"^it\.{name}"):
            setattr(it, name, bad)
    for slot in core_of(one).layout.blocks["it"].slots.values():
        for bad in ("text", np.full(slot.size or 1, np.nan), np.zeros(slot.size + 11), None):
            with pytest.raises((ShapeError, NotFiniteError), match=rf"^it\.{slot.input.name}"):
                setattr(it, slot.input.name, bad)
            with pytest.raises((ShapeError, NotFiniteError), match=rf"^it\.{slot.input.name}"):
                it.set(**{slot.input.name: bad})
        low = 0.0 if slot.input.direction else slot.input.low - 1.0
        if np.isfinite(low):
            with pytest.raises(RangeError, match=rf"^it\.{slot.input.name}"):
                setattr(it, slot.input.name, np.full(slot.size, low) if slot.input.size else low)
    if core_of(one).layout.blocks["it"].form == "task":
        with pytest.raises(RangeError, match=r"^it\.weight"):
            it.weight = -1.0
    else:
        with pytest.raises(RangeError, match="on \\(1\\) or off \\(0\\)"):
            it.mask = 0.5
        with pytest.raises(AttributeError, match=r"^it\.weight"):
            it.weight = 1.0
    assert all(np.array_equal(a, b) for a, b in zip(before, buffers, strict=True))
    assert (it.enabled, it.mask.tolist()) == (True, [1.0] * rows)
