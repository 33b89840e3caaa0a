"""The three-armed walker on the published cylinder, and its compiled stack."""

from __future__ import annotations

import pytest

import wbc
from wbc.robots import Walker
from wbc.walking import Structure, cylinder
from wbc.walking.loop.stack import WalkStack


@pytest.fixture(scope="session")
def machine() -> Walker:
    return wbc.robots.walker()


@pytest.fixture(scope="session")
def structure() -> Structure:
    return cylinder(rigid=True)


@pytest.fixture(scope="session")
def stack(machine: Walker, structure: Structure) -> WalkStack:
    return WalkStack(machine, structure, collisions=False)
