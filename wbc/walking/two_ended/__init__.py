"""The two-ended arm walks: end over end along holds, by the planner's search and the loop of every walk."""

from wbc.walking.holds.built_in import grapple_row
from wbc.walking.two_ended.planner import TwoEndedPlan, plan_two_ended
from wbc.walking.two_ended.postures import touching_distance
from wbc.walking.two_ended.walk import TwoEndedStack, TwoEndedWalk

__all__ = ["TwoEndedPlan", "TwoEndedStack", "TwoEndedWalk", "grapple_row", "plan_two_ended", "touching_distance"]
