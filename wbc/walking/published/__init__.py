"""The published planner of a three-armed grasping walker: free gait on a cylinder of handholds.

Source: M. R. Patterson's thesis on a three-armed walking robot, text and Fortran listing. Where both disagree both are
there and the listing is the default. What neither prints is :class:`Calibration`.
"""

from __future__ import annotations

from wbc.walking.published.calibration import Calibration
from wbc.walking.published.record import Log
from wbc.walking.published.supervisor import Outcome
from wbc.walking.published.walker import PublishedWalker

__all__ = ["Calibration", "Log", "Outcome", "PublishedWalker"]
