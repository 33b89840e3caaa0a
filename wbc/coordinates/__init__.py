"""Task and constraint coordinates of redundant arms under manual control. See docs/coordinates.md."""

from __future__ import annotations

from wbc.analysis.rows import BodyRows, JointRows, PitchPlaneRows
from wbc.coordinates.arm_parts import Arm, Parts, parts
from wbc.coordinates.control import PairController
from wbc.coordinates.items import FollowRows, KeepRows
from wbc.coordinates.modes import MissingPartError, Mode, mode_pairs, mode_table
from wbc.coordinates.pair import CoordinatePair
from wbc.coordinates.pair_stack import PairStack, pair_stack
from wbc.coordinates.point_sets import OnCircle, OnCylinder, OnLine, OnPlane, OnSphere, PointSet
from wbc.coordinates.rows import AxisRows, Coordinate, PlaneAngleRows, PointRows

__all__ = [
    "Arm",
    "AxisRows",
    "BodyRows",
    "Coordinate",
    "CoordinatePair",
    "FollowRows",
    "JointRows",
    "KeepRows",
    "MissingPartError",
    "Mode",
    "OnCircle",
    "OnCylinder",
    "OnLine",
    "OnPlane",
    "OnSphere",
    "PairController",
    "PairStack",
    "Parts",
    "PitchPlaneRows",
    "PlaneAngleRows",
    "PointRows",
    "PointSet",
    "mode_pairs",
    "mode_table",
    "pair_stack",
    "parts",
]
