"""Typed handles: the checker knows the values of every class, misspelt ones fail there (misspelt.py) and when set."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

import wbc
from tests.controller.stacks import robot
from tests.items import ITEMS
from wbc.errors import DuplicateNameError, UnknownAttributeError, UnknownNameError
from wbc.pages import stub
from wbc.stack.layout import Layout
from wbc.tasks import EndEffector, Posture, WorkspaceBox, registry
from wbc.tasks.inputs import SENSED

#: Classes whose inputs their declaration names, and what only stacks add
OPEN = {"Expression", "Limit", "Direction"}
#: The others, without what tests declare
SHIPPED = sorted(n for n, k in registry().items() if k.__module__.startswith("wbc.tasks.") and n not in OPEN)


@pytest.mark.parametrize("name", SHIPPED)
def test_every_value_of_an_item_is_in_the_stub(name: str) -> None:
    known, seen = set(stub.values(registry()[name])), set[str]()
    bot = robot("panda")
    for item, _ in ITEMS[name](bot):
        stack = wbc.Stack(bot, 0.01)
        stack.add(item, name="it")
        slots = set(Layout(stack).blocks["it"].slots)
        seen |= slots
        assert slots <= known, item
    # Nothing that no item of a class has, but what items of it may have where accelerations or meshes are
    assert known - seen <= {"weight", "price", "stiffness", "damping", "rate", "acceleration", *SENSED}


def test_the_stub_is_what_the_declarations_say() -> None:
    assert stub.stale() == [], "run make docs"


def test_a_misspelt_value_fails_with_the_nearest_name() -> None:
    hand = EndEffector("panda_hand_tcp")
    controller = wbc.Stack(robot("panda"), 0.01).add(hand, name="hand").compile(backend="vm")
    for handle in (controller["hand"], controller[hand]):
        with pytest.raises(UnknownAttributeError, match="did you mean 'target'"):
            handle.taget = 3
        with pytest.raises(UnknownAttributeError, match="did you mean 'gain'"):
            handle.get("gian")
    controller[hand].gain = 3.0
    assert controller["hand"].get("gain") == 3.0


def test_a_misspelt_item_of_a_report_fails_with_the_nearest_name(tmp_path: Path) -> None:
    stack = wbc.Stack(robot("panda"), 0.01).add(EndEffector("panda_hand_tcp"), name="hand")
    stack.add(WorkspaceBox("panda_hand", upper=(9.0, 9.0, 9.0)), name="box")
    controller = stack.compile(backend="vm")
    with controller.record(tmp_path / "ticks.npz"):
        step = controller.step(controller.stack.robot.neutral)
    recording, batch = wbc.Recording(tmp_path / "ticks.npz"), controller.batch(2).step(step.q_next)
    for report in (step, recording, batch):
        for field, name, near in (("residuals", "hnad", "hand"), ("margins", "bax", "box")):
            entries = getattr(report, field)
            assert entries.get(name) is None
            with pytest.raises(UnknownNameError, match=f"{field}: unknown name, did you mean '{near}'"):
                entries[name]
    with pytest.raises(UnknownNameError, match=r"inputs: unknown name, did you mean 'hand\.target'"):
        recording.inputs["hand.traget"]


def test_an_item_is_found_as_it_was_added() -> None:
    hand, posture, other = EndEffector("panda_hand_tcp"), Posture(), EndEffector("panda_link5")
    stack = wbc.Stack(robot("panda"), 0.01).add(hand, name="hand").add(posture, name="a").add(posture, name="b")
    for items in (stack.compile(backend="vm"), stack.inverse_kinematics(goals=["hand"], backend="vm")):
        assert items[hand] is items["hand"]
        assert hand in items
        assert other not in items
        with pytest.raises(UnknownNameError, match="hand"):
            items[other]
        with pytest.raises(DuplicateNameError, match="as a, b"):
            items[posture]
        with pytest.raises(UnknownNameError):
            items[dataclasses.replace(hand)]
