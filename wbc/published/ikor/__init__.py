"""The published driver of redundant arms by Full Space Parameterization, and its runs.

Source: IKOR, inverse kinematics on redundant systems; ORNL/TM-13096. What its listing has wrong is in
:mod:`wbc.published.ikor.legacy`, what is not legible is assumed in :mod:`wbc.published.ikor.machines`.
"""

from __future__ import annotations

from wbc.published.ikor.cases import case, differences, printed
from wbc.published.ikor.driver import Code, CourseRun, Driver, Stop
from wbc.published.ikor.files import IkorFileError
from wbc.published.ikor.legacy import legacy_hermies
from wbc.published.ikor.lines import Trajectory, arc_from, line_to, posed, straight
from wbc.published.ikor.machines import ArmMachine, airarm, hermies, machine_of, planar, without_platform
from wbc.published.ikor.settings import Method, Settings, Switch

__all__ = [
    "ArmMachine",
    "Code",
    "CourseRun",
    "Driver",
    "IkorFileError",
    "Method",
    "Settings",
    "Stop",
    "Switch",
    "Trajectory",
    "airarm",
    "arc_from",
    "case",
    "differences",
    "hermies",
    "legacy_hermies",
    "line_to",
    "machine_of",
    "planar",
    "posed",
    "printed",
    "straight",
    "without_platform",
]
