"""Classical rate resolution of redundant arms, for comparison with stacks. See docs/resolvers.md."""

from __future__ import annotations

from wbc.resolvers.extended import ExtendedJacobian
from wbc.resolvers.full_space import FullSpace
from wbc.resolvers.gradient import GradientProjection
from wbc.resolvers.problem import RateProblem, Resolver
from wbc.resolvers.pseudo_inverse import PseudoInverse
from wbc.resolvers.rank_reduction import RankReduction
from wbc.resolvers.task_priority import TaskPriority
from wbc.resolvers.virtual_arms import VirtualArms

__all__ = [
    "ExtendedJacobian",
    "FullSpace",
    "GradientProjection",
    "PseudoInverse",
    "RankReduction",
    "RateProblem",
    "Resolver",
    "TaskPriority",
    "VirtualArms",
]
