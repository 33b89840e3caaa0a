"""The arm and its controller, compiled once for all tests of servos."""

from __future__ import annotations

import pytest

from tests.servo.plants import arm, controller
from wbc.api import Controller


@pytest.fixture(scope="session")
def control() -> Controller:
    return controller(arm())
