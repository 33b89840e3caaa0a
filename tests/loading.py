"""Robots of the examples on pages are loaded once a process, and the meshes of installed robots are read once."""

from __future__ import annotations

import functools
import sys
from typing import Any

import pytest

import wbc
from wbc.robot import Robot

_load = wbc.robots.load
_by_name = functools.cache(_load)
#: (description, kind of bodies) -> what was read of it
_bodies: dict[tuple[str, Any], list[Any]] = {}


def pytest_collection_finish() -> None:
    """To read a robot's meshes takes longer than most tests that draw it."""
    from wbc.track import clearance, scene

    read = clearance.bodies_of

    def bodies_of(robot: Robot, kind: Any) -> list[Any]:
        if not robot.source.startswith(sys.prefix):
            return read(robot, kind)
        if (robot.source, kind) not in _bodies:
            _bodies[robot.source, kind] = read(robot, kind)
        return _bodies[robot.source, kind]

    clearance.bodies_of = scene.bodies_of = bodies_of


@pytest.fixture
def loaded_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """``wbc.robots.load`` of a name alone gives the robot that it gave before."""

    def load(robot: Any, **changes: Any) -> Robot:
        return _by_name(robot) if isinstance(robot, str) and not changes else _load(robot, **changes)

    monkeypatch.setattr(wbc.robots, "load", load)
