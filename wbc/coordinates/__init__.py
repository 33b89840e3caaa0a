"""Task and constraint coordinates of redundant arms under manual control. See docs/coordinates.md."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.analysis.rows import BodyRows, JointRows, PitchPlaneRows
    from wbc.coordinates.advice.adviser import Advice, Adviser, Basis
    from wbc.coordinates.advice.automatic import AutomaticPairs
    from wbc.coordinates.advice.complete_sets import CompleteSet, smallest_complete_sets
    from wbc.coordinates.advice.determinant_places import ClosedForm, closed_form
    from wbc.coordinates.advice.modes import Mode, mode_pairs, mode_row, mode_table, modes_of, restriction_table
    from wbc.coordinates.advice.pair_survey import PairSurvey, advice_time, survey_pairs
    from wbc.coordinates.arms.arm_parts import Arm, MissingPartError, Parts
    from wbc.coordinates.arms.published_trees import TREES, TreeSet, TreeSets, tree_sets
    from wbc.coordinates.arms.which_parts import parts
    from wbc.coordinates.control.conditioning import Conditioning
    from wbc.coordinates.control.cues import MotionCue, motion_cue
    from wbc.coordinates.control.pair_controller import PairController
    from wbc.coordinates.control.pair_stack import PairStack, pair_stack
    from wbc.coordinates.control.pair_step import PairStep
    from wbc.coordinates.control.rank_loss import Condition
    from wbc.coordinates.control.starts import regular_start
    from wbc.coordinates.items import FollowRows, KeepRows
    from wbc.coordinates.pair import CoordinatePair
    from wbc.coordinates.plots import DriveLog, plot_drives
    from wbc.coordinates.point_sets import OnCircle, OnCylinder, OnLine, OnPlane, OnSphere, PointSet
    from wbc.coordinates.rows import AxisRows, Coordinate, PlaneAngleRows, PointRows
    from wbc.coordinates.system.carrying import CarriedMotion, Leg, carry
    from wbc.coordinates.system.system_motion import PairCount, SystemMotion, count_pairs, system_coordinates
else:
    __getattr__ = lazy.attach(__name__, __file__)

__all__ = [
    "TREES",
    "Advice",
    "Adviser",
    "Arm",
    "AutomaticPairs",
    "AxisRows",
    "Basis",
    "BodyRows",
    "CarriedMotion",
    "ClosedForm",
    "CompleteSet",
    "Condition",
    "Conditioning",
    "Coordinate",
    "CoordinatePair",
    "DriveLog",
    "FollowRows",
    "JointRows",
    "KeepRows",
    "Leg",
    "MissingPartError",
    "Mode",
    "MotionCue",
    "OnCircle",
    "OnCylinder",
    "OnLine",
    "OnPlane",
    "OnSphere",
    "PairController",
    "PairCount",
    "PairStack",
    "PairStep",
    "PairSurvey",
    "Parts",
    "PitchPlaneRows",
    "PlaneAngleRows",
    "PointRows",
    "PointSet",
    "SystemMotion",
    "TreeSet",
    "TreeSets",
    "advice_time",
    "carry",
    "closed_form",
    "count_pairs",
    "mode_pairs",
    "mode_row",
    "mode_table",
    "modes_of",
    "motion_cue",
    "pair_stack",
    "parts",
    "plot_drives",
    "regular_start",
    "restriction_table",
    "smallest_complete_sets",
    "survey_pairs",
    "system_coordinates",
    "tree_sets",
]


def __dir__() -> list[str]:
    return __all__
