"""Compensation of relative motion with an arm that measures: a manipulator with a level hand on a table that moves.

Source: M. Hirabayashi, MIT M.S. thesis, 1981 (DTIC AD-A181 415), inches and degrees there, SI here. What it has wrong
is shown in tests/published/test_relative_motion.py and told in docs/relative_motion.md.
"""

from __future__ import annotations

from wbc.published.relative_motion.arms import (
    INCH,
    Potentiometers,
    hand,
    hanging,
    levelled,
    manipulator,
    measured,
    measuring_arm,
    published_measured,
    wrist_drives,
)
from wbc.published.relative_motion.motion import Held, LevelHand, deviation, hold_on_table, straight_line
from wbc.published.relative_motion.printed import (
    Measured,
    commanded,
    line_errors,
    predicted,
    registration,
    residuals,
    slopes,
    start,
    tables,
)
from wbc.published.relative_motion.recursion import MasterSlave

__all__ = [
    "INCH",
    "Held",
    "LevelHand",
    "MasterSlave",
    "Measured",
    "Potentiometers",
    "commanded",
    "deviation",
    "hand",
    "hanging",
    "hold_on_table",
    "levelled",
    "line_errors",
    "manipulator",
    "measured",
    "measuring_arm",
    "predicted",
    "published_measured",
    "registration",
    "residuals",
    "slopes",
    "start",
    "straight_line",
    "tables",
    "wrist_drives",
]
