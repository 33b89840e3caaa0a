"""The least time in which the joint path of a whole plan can be carried out, by reachability analysis (toppra)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc import validation
from wbc.robots import Walker, WalkerData
from wbc.trajectory.law import Law
from wbc.trajectory.least_time import time_optimal
from wbc.trajectory.path import PolynomialPath
from wbc.trajectory.waypoints import cubic_spline
from wbc.validation import Array
from wbc.walking.planner.joints_of_plan import PlannedJoints, planned_joints
from wbc.walking.planner.plan import Plan

#: Intervals of the law's grid between two waypoints: on fewer the limits are passed between them
INTERVALS = 16
#: The plan's time passes at most so many times as fast as planned
FASTEST = 20.0
#: Largest second derivative of the plan's time while hands open, settle and close [1/s]: so large that it does not bind
STEADY = 1e3
#: A limit binds where so much of it is used
BINDS = 0.98
#: Times at which that is looked at are so far apart [s]
LOOK = 0.005


@dataclass(frozen=True, eq=False)
class PlanTime:
    """The least time of a plan.

    Attributes:
        planned: duration of the plan, with the time for which swings delay it [s].
        law: coordinates of all arms, and a last one that limits how fast the plan's time passes; its path coordinate s
            is the plan's time.
        arms: names, in the order of the coordinates.
    """

    planned: float
    law: Law
    arms: tuple[str, ...]

    @property
    def least(self) -> float:
        """[s]."""
        return self.law.duration

    @property
    def factor(self) -> float:
        """least / planned."""
        return self.least / self.planned

    def at(self, time: Array) -> Array:
        """s(t), the plan's time [s] at times of the law [s]."""
        times = np.clip(validation.real_array("time", time), 0.0, self.least)
        return self.law.timing.evaluate(np.atleast_1d(times).ravel()).reshape(times.shape)

    @cached_property
    def binding(self) -> dict[str, float]:
        """Parts of the least time in which something binds, the largest first: joints ("arm1 joint 2") by rate or
        acceleration, and "pace", the bound of ds/dt: in latches, and where next to nothing moves.
        """
        state = self.law.at(np.arange(0.5 * LOOK, self.least, LOOK))
        limits = self.law.limits
        assert limits.velocity is not None
        assert limits.acceleration is not None
        used = np.maximum(np.abs(state.velocity) / limits.velocity, np.abs(state.acceleration) / limits.acceleration)
        names = [*(f"{arm} joint {k}" for arm in self.arms for k in range(1, 7)), "pace"]
        first = np.where(used.max(axis=1) >= BINDS, used.argmax(axis=1), -1)
        parts = {name: float((first == k).mean()) for k, name in enumerate(names)}
        return dict(sorted(((n, p) for n, p in parts.items() if p > 0.0), key=lambda item: -item[1]))


def least_plan_time(walker: Walker, plan: Plan) -> PlanTime:
    """The least time T of the joint path q(s) of a plan, s its time:

        min T  such that  |dq/dt| <= rates, |d2q/dt2| <= accelerations,  ds/dt <= 1 in latches, <= 20 elsewhere

    for all joints of all arms, from rest to rest; q is a cubic spline through waypoints that are at most 0.05 s apart.
    A hand takes its latch time to open, and to settle and close, so these stretches take no less than planned; over the
    one waypoint before and behind them the bound goes from 1 to 20. Order and places of all motions stay: it is the
    least time along this path, not over all plans. Limits are those of the joints, nothing of them is left to feedback.

    Raises:
        ShapeError, NoPlanError: as of :func:`wbc.walking.planner.joints_of_plan.planned_joints`.

    Source: see :func:`wbc.trajectory.time_optimal`.
    """
    table = planned_joints(walker, plan)
    data = walker.data
    assert isinstance(data, WalkerData)
    arms = len(walker.arms)
    rates, accelerations = ([*(tuple(v) * arms), most] for v, most in _limits(data))
    count = INTERVALS * (len(table.time) - 1)
    law = time_optimal(_spline(table), rates, accelerations, intervals=count)
    return PlanTime(float(table.time[-1]), law, tuple(arm.name for arm in walker.arms))


def _limits(data: WalkerData) -> tuple[tuple[tuple[float, ...], float], ...]:
    """Limits of the joints of an arm, and of the coordinate that limits how fast the plan's time passes."""
    return (tuple(data.joint_rates), 1.0), (tuple(data.joint_accelerations), STEADY)


def _spline(table: PlannedJoints) -> PolynomialPath:
    """The joint path over the plan's time, and a coordinate z with dz/ds = 1 in what is kept and 1 / FASTEST elsewhere,
    linear between the two.
    """
    s, spans = table.time, np.diff(table.time)
    slope = np.full(len(s), 1.0 / FASTEST)
    slope[:-1][table.kept] = slope[1:][table.kept] = 1.0
    gained = 0.5 * (slope[1:] + slope[:-1]) * spans
    z = np.concatenate([[0.0], np.cumsum(gained)])[:-1]
    clock = np.stack([np.zeros(len(spans)), 0.5 * np.diff(slope) / spans, slope[:-1], z])
    return PolynomialPath(s, np.concatenate([cubic_spline(s, table.joints, "not-a-knot"), clock[..., None]], axis=2))
