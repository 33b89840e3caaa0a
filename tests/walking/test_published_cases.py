"""Cases that the published planner fails, as its own tests assert with their times: ours walks them."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence

import numpy as np
import pytest

from wbc.robots import Walker
from wbc.walking import Structure, remove_rows
from wbc.walking.body_path import grid_path
from wbc.walking.checker import Rules, check_walk
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Tick, Walk
from wbc.walking.planner.planner import plan_walk
from wbc.walking.run.recording import WalkRecorder

INCH = 0.0254


class Walked:
    """A walk from its beginning, with a recorder."""

    def __init__(self, machine: Walker, structure: Structure, stack: WalkStack, points: Sequence, speed: float) -> None:  # type: ignore[type-arg]
        self.machine, self.structure = machine, structure
        plan = plan_walk(machine, structure, grid_path(points, speed * INCH), detour=True)
        self.walk = Walk(machine, structure, plan, stack=stack)
        self.recorder, self.ticks = WalkRecorder(self.walk), list[Tick]()

    def tick(self, tick: Tick) -> None:
        self.ticks.append(tick)
        self.recorder.tick(tick)

    def arrives(self, folder: pathlib.Path) -> None:
        """At least two hands hold at every tick, and the checker, which knows no planner, finds nothing."""
        assert self.walk.run(self.tick) == "arrived"
        assert min(sum(hand == "closed" for hand in tick.hands) for tick in self.ticks) >= 2
        urdf = self.machine.urdf(folder / "robot.urdf")
        report = check_walk(self.recorder.log()[0], urdf, self.structure, Rules(sub_samples=1))
        assert report.ok, str(report)


@pytest.mark.parametrize(("start", "goal"), [(6, 13), (18, 11)])
def test_15_four_inches_a_second_along_the_cylinder(
    machine: Walker, structure: Structure, stack: WalkStack, start: int, goal: int, tmp_path: pathlib.Path
) -> None:
    it = Walked(machine, structure, stack, [(13, start), (13, goal)], 4.0)
    it.arrives(tmp_path)
    # Ramps at both ends take half a second
    assert it.walk.plan.path.duration / (it.walk.time - 0.5) >= 0.98


def test_16_four_rows_removed(machine: Walker, structure: Structure, stack: WalkStack, tmp_path: pathlib.Path) -> None:
    it = Walked(machine, remove_rows(structure, "12-15"), stack, [(13, 9), (13, 18)], 2.0)
    it.arrives(tmp_path)
    assert 9 * 9.25 / it.walk.time >= 1.0  # in/s


def test_17_a_reversal_after_five_seconds(
    machine: Walker, structure: Structure, stack: WalkStack, tmp_path: pathlib.Path
) -> None:
    it = Walked(machine, structure, stack, [(13, 6), (13, 18)], 3.0)
    while it.walk.time < 5.0 - 1e-9:
        it.tick(it.walk.tick())
    here = 6 + 3 * it.walk.path_time / 9.25
    it.walk.go(grid_path([(13, here), (13, 6)], 3.0 * INCH))
    it.arrives(tmp_path)
    assert np.abs(it.walk.q[2] + 6 * 9.25 * INCH) < 0.002  # +A is -z
