"""The planner: re-grasps and swings with which a walker follows a path of its body."""

from wbc.walking.planner.planner import plan_slices, plan_walk

__all__ = ["plan_slices", "plan_walk"]
