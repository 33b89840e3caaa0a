"""The published driver of redundant arms by Full Space Parameterization, and its runs.

Source: IKOR, inverse kinematics on redundant systems; ORNL/TM-13096. What its listing has wrong is in
:mod:`wbc.published.ikor.legacy`, what is not legible is assumed in :mod:`wbc.published.ikor.machines`.
"""

from __future__ import annotations

from wbc.published.ikor.cases import case as case, differences as differences, printed as printed
from wbc.published.ikor.driver import Code as Code, CourseRun as CourseRun, Driver as Driver, Stop as Stop
from wbc.published.ikor.files import IkorFileError as IkorFileError
from wbc.published.ikor.legacy import legacy_hermies as legacy_hermies
from wbc.published.ikor.lines import (
    Trajectory as Trajectory,
    arc_from as arc_from,
    line_to as line_to,
    posed as posed,
    straight as straight,
)
from wbc.published.ikor.machines import (
    ArmMachine as ArmMachine,
    airarm as airarm,
    hermies as hermies,
    machine_of as machine_of,
    planar as planar,
    without_platform as without_platform,
)
from wbc.published.ikor.settings import Method as Method, Settings as Settings, Switch as Switch
