"""Paths between configurations under the constraints of a stack, and laws of motion along them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.plan.follower import FollowedState as FollowedState, PathFollower as PathFollower
    from wbc.plan.path import PlannedPath as PlannedPath
    from wbc.plan.planner import (
        MotionPlanner as MotionPlanner,
        NoPathError as NoPathError,
        PlanningOptions as PlanningOptions,
    )
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
