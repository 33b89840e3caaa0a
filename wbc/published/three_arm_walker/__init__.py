"""The published planner of a three-armed grasping walker: free gait on a cylinder of handholds.

Source: M. R. Patterson's thesis on a three-armed walking robot, text and Fortran listing. Where both disagree both are
there and the listing is the default. What neither prints is :class:`WalkerCalibration`.
"""

from __future__ import annotations

from wbc.published.three_arm_walker.machine.calibration import WalkerCalibration
from wbc.published.three_arm_walker.record import PublishedLog
from wbc.published.three_arm_walker.supervisor import PublishedOutcome
from wbc.published.three_arm_walker.walker import PublishedWalker

__all__ = ["PublishedLog", "PublishedOutcome", "PublishedWalker", "WalkerCalibration"]
