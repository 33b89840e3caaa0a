"""Every test starts from the same random numbers, whichever tests ran before it in its process."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

#: State of the generators of a module of tests as its import left them
_STATES: dict[ModuleType, dict[str, Any]] = {}


@pytest.fixture(autouse=True)
def same_random_numbers(request: pytest.FixtureRequest) -> None:
    """Seed Pinocchio and set the generators of the test's module back to where its import left them."""
    pin.seed(0)
    module = request.module
    generators = {name: value for name, value in vars(module).items() if isinstance(value, np.random.Generator)}
    states = _STATES.setdefault(module, {name: value.bit_generator.state for name, value in generators.items()})
    for name, state in states.items():
        generators[name].bit_generator.state = state
