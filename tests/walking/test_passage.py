"""Whether a body can pass among obstacles, by boxes of poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from bench.walk.reference import passage as module
from bench.walk.reference.passage import passage
from wbc.robots import Walker
from wbc.shapes import Box
from wbc.validation import Array
from wbc.walking import Obstacle, plane


def bar(name: str, y: float, length: float) -> Obstacle:
    return Obstacle(name, Box((0.1, length, 0.8)), pin.SE3(np.eye(3), np.array([2.0, y, 1.3])))


@pytest.mark.parametrize(
    ("bars", "kind"),
    [
        ([bar("wall", 1.5, 9.0)], "impossible"),
        # A gap as wide as the body, and one that is half as wide
        ([bar("left", -1.5, 4.0), bar("right", 3.5, 4.0)], "undecided"),
        ([bar("left", -1.4, 4.2), bar("right", 3.1, 4.0)], "impossible"),
    ],
)
def test_a_wall_is_not_passed(
    machine: Walker, bars: list[Obstacle], kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "SIDE", 0.06)
    monkeypatch.setattr(module, "BESIDE", 0.2)
    whole = plane()
    outside = (whole.positions[:, :2] < [0.5, 0.0]).any(axis=1) | (whole.positions[:, :2] > [3.5, 1.5]).any(axis=1)
    few = whole.without([whole.ids[k] for k in np.flatnonzero(outside)])
    there = replace(few, obstacles=tuple(bars))
    down: Array = np.diag([1.0, -1.0, -1.0, 1.0])
    first, last = down.copy(), down.copy()
    first[:3, 3], last[:3, 3] = (1.0, 0.7, 1.32), (3.0, 0.7, 1.32)
    found = passage(machine, there, first, last)
    assert found.kind == kind
    assert set(found.around) == (set() if kind == "undecided" else {f"obstacle {one.id}" for one in bars})
