"""The planner: re-grasps and swings with which a walker follows a path of its body."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.walking.planner.planner import plan_slices, plan_walk
else:
    __getattr__ = lazy.attach(__name__, __file__)

__all__ = ["plan_slices", "plan_walk"]
