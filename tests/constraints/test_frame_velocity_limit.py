"""FrameVelocityLimit: its rows times v against Pinocchio's frame velocities, in axes, relative, bad declarations."""

from __future__ import annotations

import numpy as np
import pytest

from tests.constraints.robots import robot
from tests.evaluation import probe
from wbc.tasks.frame_velocity_limit import FrameVelocityLimit


def test_limits_are_run_time_values_and_rows_are_the_limited_axes() -> None:
    bot = robot("panda")
    item = FrameVelocityLimit("panda_hand", linear=(np.inf, 0.2, 0.3), angular=(np.inf, np.inf, 1.0))
    assert [(r.label, r.unit) for r in item.rows(bot)] == [("y", "m/s"), ("z", "m/s"), ("rz", "rad/s")]
    assert [(i.name, i.size, i.unit) for i in item.inputs(bot)] == [("linear", 2, "m/s"), ("angular", 1, "rad/s")]
    full = probe(FrameVelocityLimit("panda_hand", linear=1.0, angular=1.0), bot)(bot.neutral)[0]
    matrix, _, upper = probe(item, bot)(bot.neutral)
    assert matrix == pytest.approx(full[[1, 2, 5]])
    assert upper.tolist() == [0.2, 0.3, 1.0]
    assert probe(item, bot)(bot.neutral, linear=[0.0, 4.0])[2].tolist() == [0.0, 4.0, 1.0]
