"""The planner: re-grasps and swings with which a walker follows a path of its body."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.walking.planner.planner import plan_slices as plan_slices, plan_walk as plan_walk
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
