"""Compensation of relative motion with an arm that measures: a manipulator with a level hand on a table that moves.

Source: M. Hirabayashi, MIT M.S. thesis, 1981 (DTIC AD-A181 415), inches and degrees there, SI here. What it has wrong
is shown in tests/published/test_relative_motion.py and told in docs/relative_motion.md.
"""

from __future__ import annotations

from wbc.published.relative_motion.arms import (
    INCH as INCH,
    Potentiometers as Potentiometers,
    hand as hand,
    hanging as hanging,
    levelled as levelled,
    manipulator as manipulator,
    measured as measured,
    measuring_arm as measuring_arm,
    published_measured as published_measured,
    wrist_drives as wrist_drives,
)
from wbc.published.relative_motion.motion import (
    Held as Held,
    LevelHand as LevelHand,
    deviation as deviation,
    hold_on_table as hold_on_table,
    straight_line as straight_line,
)
from wbc.published.relative_motion.printed import (
    Measured as Measured,
    commanded as commanded,
    line_errors as line_errors,
    predicted as predicted,
    registration as registration,
    residuals as residuals,
    slopes as slopes,
    start as start,
    tables as tables,
)
from wbc.published.relative_motion.recursion import MasterSlave as MasterSlave
