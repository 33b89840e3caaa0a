"""The published walker and its cylinder, for tests that ask for them."""

from __future__ import annotations

import pytest

from wbc.climb import ClimbScene, machines
from wbc.climb.climber import Climber
from wbc.climb.grids import cylinder_grid


@pytest.fixture(scope="module")
def walker() -> Climber:
    return machines.climber("walker")


@pytest.fixture(scope="module")
def scene() -> ClimbScene:
    return cylinder_grid()
