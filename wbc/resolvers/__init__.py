"""Classical rate resolution of redundant arms, for comparison with stacks. See docs/resolvers.md."""

from __future__ import annotations

from wbc.resolvers.classical import (
    ExtendedJacobian as ExtendedJacobian,
    GradientProjection as GradientProjection,
    PseudoInverse as PseudoInverse,
    RankReduction as RankReduction,
    TaskPriority as TaskPriority,
    VirtualArms as VirtualArms,
)
from wbc.resolvers.full_space import FullSpace as FullSpace
from wbc.resolvers.problem import RateProblem as RateProblem, Resolver as Resolver
