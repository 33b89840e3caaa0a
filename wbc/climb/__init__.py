"""Free gait of any limbed robot on any structure: limbs, contacts, a planner of stances and motions, and their loop."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.climb.along import BodyTrack as BodyTrack, plan_along as plan_along
    from wbc.climb.at_rest import standing as standing
    from wbc.climb.balance import Equilibrium as Equilibrium
    from wbc.climb.climber import Climber as Climber, ClimbLimb as ClimbLimb
    from wbc.climb.contacts import (
        ContactKind as ContactKind,
        FlatFoot as FlatFoot,
        GripHand as GripHand,
        PointFoot as PointFoot,
        SuctionPad as SuctionPad,
    )
    from wbc.climb.first import first_stance as first_stance
    from wbc.climb.goal import BodyPlace as BodyPlace, LimbAt as LimbAt, Route as Route
    from wbc.climb.grids import (
        cylinder_grid as cylinder_grid,
        plane_grid as plane_grid,
        truss_grid as truss_grid,
    )
    from wbc.climb.loop import ClimbLoop as ClimbLoop
    from wbc.climb.motion import MotionOptions as MotionOptions, carry_out as carry_out
    from wbc.climb.places import body_frames as body_frames
    from wbc.climb.plan import ContactMove as ContactMove, ContactPlan as ContactPlan
    from wbc.climb.planning import ClimbOptions as ClimbOptions, plan_climb as plan_climb
    from wbc.climb.reach import LimbReach as LimbReach
    from wbc.climb.scene import ClimbScene as ClimbScene, Foothold as Foothold, SceneBody as SceneBody
    from wbc.climb.scene_files import read_scene as read_scene, save_scene as save_scene
    from wbc.climb.search import (
        NoStancesError as NoStancesError,
        StanceOptions as StanceOptions,
        find_stances as find_stances,
    )
    from wbc.climb.stance import FREE_LIMB as FREE_LIMB, Stance as Stance, StancePath as StancePath
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
