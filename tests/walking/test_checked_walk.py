"""A walk of the planner and the controller, broken in five ways: the checker catches each one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wbc.robots import Walker
from wbc.walking import Structure
from wbc.walking.body_path import grid_path
from wbc.walking.checker import Rules, check_walk
from wbc.walking.holds.surface import CylinderSurface
from wbc.walking.log.log import CLOSED, OPEN, WalkLog
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.planner import plan_walk
from wbc.walking.run.recording import WalkRecorder

INCH = 0.0254
FEW = Rules(sub_samples=1)


@pytest.fixture(scope="module")
def log(machine: Walker, structure: Structure, stack: WalkStack) -> WalkLog:
    walk = Walk(
        machine, structure, plan_walk(machine, structure, grid_path([(13, 9), (13, 14)], 6 * INCH)), stack=stack
    )
    recorder = WalkRecorder(walk)
    assert walk.run(recorder.tick) == "arrived"
    return recorder.log()[0]


@pytest.fixture(scope="module")
def urdf(machine: Walker, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machine.urdf(tmp_path_factory.mktemp("robot") / "robot.urdf")


def changed(log: WalkLog, name: str, place: object, value: object) -> WalkLog:
    array = np.array(getattr(log, name))
    array[place] = value
    return replace(log, **{name: array})  # type: ignore[arg-type]


def a_joint_a_degree_off(log: WalkLog) -> WalkLog:
    arm = int((log.hand_state == CLOSED).all(axis=0).argmax())
    ramp = np.radians(1.0) * np.clip(np.arange(len(log)) / 50.0, 0.0, 1.0)
    q = np.array(log.q)
    q[:, 6 * arm + 1] += ramp
    return replace(log, q=q, v=np.append(np.diff(q, axis=0) / log.dt, np.zeros((1, q.shape[1])), axis=0))


def a_hold_dropped(log: WalkLog) -> WalkLog:
    row = int(np.flatnonzero((log.hand_state == OPEN).any(axis=1))[20])
    arm = int((log.hand_state[row] == CLOSED).argmax())
    part = slice(row, row + 30), arm
    return changed(changed(log, "hand_state", part, OPEN), "hand_hold", part, -1)


def two_hands_swapped(log: WalkLog) -> WalkLog:
    return replace(log, hand_hold=log.hand_hold[:, [1, 0, 2]], hand_state=log.hand_state[:, [1, 0, 2]])


def faster_by_a_twentieth(log: WalkLog) -> WalkLog:
    meta = {**log.meta, "dt": log.dt / 1.05}
    return replace(log, t=log.t / 1.05, v=log.v * 1.05, twist_body=log.twist_body * 1.05, meta=meta)


FAULTS: list[tuple[Callable[[WalkLog], WalkLog], str]] = [
    (a_joint_a_degree_off, "held hand off its hold"),
    (a_hold_dropped, "hands that hold"),
    (two_hands_swapped, "held hand off its hold"),
    (faster_by_a_twentieth, "joint rate / limit"),
]


def test_the_walk_as_it_was_is_sound(log: WalkLog, urdf: Path, structure: Structure) -> None:
    report = check_walk(log, urdf, structure, FEW)
    assert report.ok, str(report)
    assert (log.hand_state == OPEN).any()


@pytest.mark.parametrize(("fault", "kind"), FAULTS, ids=[fault.__name__ for fault, _ in FAULTS])
def test_a_walk_that_was_changed_is_caught(
    log: WalkLog, urdf: Path, structure: Structure, fault: Callable[[WalkLog], WalkLog], kind: str
) -> None:
    assert kind in {finding.kind for finding in check_walk(fault(log), urdf, structure, FEW).violations}


def test_a_link_two_inches_in_the_surface_is_caught(log: WalkLog, urdf: Path, structure: Structure) -> None:
    sound = check_walk(log, urdf, structure, FEW)["clearance of the structure"]
    surface = structure.surface
    assert isinstance(surface, CylinderSurface)
    # Links come as near as the least clearance; the surface is raised until the nearest is two inches in it, and the
    # hands, whose holds no longer stand on it, are farther in
    raised = replace(structure, surface=CylinderSurface(surface.pose, surface.radius + sound.worst + 2 * INCH))
    found = check_walk(log, urdf, raised, FEW)["clearance of the structure"]
    assert not found.ok
    assert found.worst < -2 * INCH + 1e-3
    assert "surface" in found.where
