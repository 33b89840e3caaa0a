"""Task and constraint coordinates of redundant arms under manual control. See docs/coordinates.md."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.analysis.rows import BodyRows as BodyRows, JointRows as JointRows, PitchPlaneRows as PitchPlaneRows
    from wbc.coordinates.advice.adviser import Advice as Advice, Adviser as Adviser, Basis as Basis
    from wbc.coordinates.advice.automatic import AutomaticPairs as AutomaticPairs
    from wbc.coordinates.advice.complete_sets import (
        CompleteSet as CompleteSet,
        smallest_complete_sets as smallest_complete_sets,
    )
    from wbc.coordinates.advice.determinant_places import ClosedForm as ClosedForm, closed_form as closed_form
    from wbc.coordinates.advice.modes import (
        Mode as Mode,
        mode_pairs as mode_pairs,
        mode_row as mode_row,
        mode_table as mode_table,
        modes_of as modes_of,
        restriction_table as restriction_table,
    )
    from wbc.coordinates.advice.pair_survey import (
        PairSurvey as PairSurvey,
        advice_time as advice_time,
        survey_pairs as survey_pairs,
    )
    from wbc.coordinates.arms.arm_parts import Arm as Arm, MissingPartError as MissingPartError, Parts as Parts
    from wbc.coordinates.arms.published_trees import (
        TREES as TREES,
        TreeSet as TreeSet,
        TreeSets as TreeSets,
        tree_sets as tree_sets,
    )
    from wbc.coordinates.arms.which_parts import parts as parts
    from wbc.coordinates.control.conditioning import Conditioning as Conditioning
    from wbc.coordinates.control.cues import MotionCue as MotionCue, motion_cue as motion_cue
    from wbc.coordinates.control.pair_controller import PairController as PairController
    from wbc.coordinates.control.pair_stack import PairStack as PairStack, pair_stack as pair_stack
    from wbc.coordinates.control.pair_step import PairStep as PairStep
    from wbc.coordinates.control.rank_loss import Condition as Condition
    from wbc.coordinates.control.starts import regular_start as regular_start
    from wbc.coordinates.items import FollowRows as FollowRows, KeepRows as KeepRows
    from wbc.coordinates.pair import CoordinatePair as CoordinatePair
    from wbc.coordinates.plots import DriveLog as DriveLog, plot_drives as plot_drives
    from wbc.coordinates.point_sets import (
        OnCircle as OnCircle,
        OnCylinder as OnCylinder,
        OnLine as OnLine,
        OnPlane as OnPlane,
        OnSphere as OnSphere,
        PointSet as PointSet,
    )
    from wbc.coordinates.rows import (
        AxisRows as AxisRows,
        Coordinate as Coordinate,
        PlaneAngleRows as PlaneAngleRows,
        PointRows as PointRows,
    )
    from wbc.coordinates.system.carrying import CarriedMotion as CarriedMotion, Leg as Leg, carry as carry
    from wbc.coordinates.system.system_motion import (
        PairCount as PairCount,
        SystemMotion as SystemMotion,
        count_pairs as count_pairs,
        system_coordinates as system_coordinates,
    )
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
