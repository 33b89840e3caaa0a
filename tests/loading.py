"""Robots of the examples on pages are loaded once a process: an item's page loads its robot, and most have the same."""

from __future__ import annotations

import functools
from typing import Any

import pytest

import wbc
from wbc.robot import Robot

_load = wbc.robots.load
_by_name = functools.cache(_load)


@pytest.fixture
def loaded_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """``wbc.robots.load`` of a name alone gives the robot that it gave before."""

    def load(robot: Any, **changes: Any) -> Robot:
        return _by_name(robot) if isinstance(robot, str) and not changes else _load(robot, **changes)

    monkeypatch.setattr(wbc.robots, "load", load)
