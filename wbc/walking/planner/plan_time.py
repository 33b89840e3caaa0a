"""The least time in which the joint path of a whole plan can be carried out, by reachability analysis (toppra)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import ShapeError
from wbc.robots import BodyLimb, Walker
from wbc.trajectory.laws.law import Law
from wbc.trajectory.least_time.time_optimal import time_optimal
from wbc.trajectory.paths.path import PolynomialPath
from wbc.trajectory.paths.waypoints import cubic_spline
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.planner.grips.table import Grips
from wbc.walking.planner.plan import NoPlanError, Plan
from wbc.walking.planner.swings.law import SwingLaw
from wbc.walking.planner.swings.swings import SETTLE

#: Rows are at most so far apart in the plan's time [s]
CELL = 0.05
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


class PlannedJoints(NamedTuple):
    """What a plan has the arms do.

    Attributes:
        time: of the plan ``[n]``, delays included, from 0 [s].
        path_time: u of the body then ``[n]`` [s].
        joints: of all arms, one after the other ``[n, joints]`` [rad].
        kept: whether the time up to the next row is the planned one: a hand opens, settles or closes ``[n - 1]``.
    """

    time: Array
    path_time: Array
    joints: Array
    kept: NDArray[np.bool_]


def planned_joints(walker: Walker, plan: Plan) -> PlannedJoints:
    """Angles of all arms over the time of a plan: held hands by closed-form inverse kinematics of pose and hold, the
    swinging one by its law.

    Raises:
        ShapeError: a plan of a machine without the walker's arms, or without its grips. NoPlanError: one that is not
            complete.
    """
    limb, grips, latch = limb_of(walker), plan.grips, walker.arm_data.latch_time
    if grips is None or len(plan.chain) != len(walker.arms) or len(plan.laws) != len(plan.regrasps):
        raise ShapeError("plan", list(plan.start), "expected a plan with its grips and laws, see follow_plan")
    if not plan.complete:
        raise NoPlanError("plan", plan.reached, plan.reason)
    spacing, names = plan.path.spacing, [arm.name for arm in walker.arms]
    time, place, kept = _times(latch, plan)
    samples = place / spacing
    joints = np.empty((len(time), len(names), len(limb.position_limits)))
    for arm in range(len(names)):
        mine = [k for k, step in enumerate(plan.regrasps) if names.index(step.arm) == arm]
        ends = [*(swing_times(plan)[k] for k in mine), (np.inf, np.inf)]
        begin = -np.inf
        for grip, end in zip(plan.chain[arm], ends, strict=True):
            rows = (time >= begin) & (time <= end[0])
            joints[rows, arm] = _held(grips, grip, samples[rows])
            begin = end[1]
        for k, source, target in zip(mine, plan.chain[arm], plan.chain[arm][1:], strict=False):
            lift, land = swing_times(plan)[k]
            rows = (time > lift) & (time < land)
            part = np.clip((time[rows] - lift - latch) / (land - lift - _extra(latch)), 0.0, 1.0)
            joints[rows, arm] = _swung(walker, plan, arm, (source, target), plan.laws[k], part, samples[rows])
    return PlannedJoints(time, place, joints.reshape(len(time), -1), kept)


def _extra(latch: float) -> float:
    """Of a swing, besides its law [s]."""
    return 2.0 * latch + SETTLE


def swing_times(plan: Plan) -> list[tuple[float, float]]:
    """Times of the plan at which each hand begins to open and has closed [s]."""
    out, late = list[tuple[float, float]](), 0.0
    for step in plan.regrasps:
        # As SwingLaw.of: it comes when the next grip begins, if it does not hold the body up
        whole = max(step.duration, 0.0 if step.delay else step.land - step.lift)
        out.append((step.lift + late, step.lift + late + whole))
        late += whole - (step.land - step.lift)
    return out


def _times(latch: float, plan: Plan) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Waypoints: time of the plan, path time, and which stretches between them take the planned time."""
    known, at, spans = [0.0], [0.0], list[tuple[float, bool]]()
    for (lift, land), step in zip(swing_times(plan), plan.regrasps, strict=True):
        known, at = [*known, lift, land], [*at, step.lift, step.land]
        spans += [(lift, False), (lift + latch, True), (land - latch - SETTLE, False), (land, True)]
    known.append(known[-1] + plan.path.duration - at[-1])
    at.append(plan.path.duration)
    times, kept = [np.zeros(1)], list[bool]()
    for end, keeps in [*spans, (known[-1], False)]:
        begin = float(times[-1][-1])
        # What is shorter than rounding is no stretch
        if end - begin > 1e-6:
            cells = int(np.ceil((end - begin) / CELL - 1e-9))
            times.append(np.linspace(begin, end, cells + 1)[1:])
            kept += [keeps] * cells
    time = np.concatenate(times)
    return time, np.interp(time, known, at), np.array(kept)


def _held(grips: Grips, grip: int, samples: Array) -> Array:
    """Postures of a grip at fractional samples, by a cubic spline through those at samples ``[n, 6]``."""
    from scipy.interpolate import CubicSpline

    first, last, offset = int(grips.first[grip]), int(grips.last[grip]), int(grips.offset[grip])
    rows = grips.postures[offset : offset + last - first + 1]
    out: Array = CubicSpline(np.arange(first, last + 1), rows)(np.clip(samples, first, last))
    return out


def _swung(
    walker: Walker, plan: Plan, arm: int, ends: tuple[int, int], law: SwingLaw, part: Array, samples: Array
) -> Array:
    """Postures of a swinging arm at parts of its law's time ``[n, 6]``."""
    assert plan.grips is not None
    aims = [law.at(float(x) * law.duration) for x in part]
    place, blend = np.array([aim.position for aim in aims]), np.array([aim.blend for aim in aims])
    limb = limb_of(walker)
    first, last = (_held(plan.grips, grip, samples)[:, limb.guided :] for grip in ends)
    frames = plan.path.blended(samples) @ walker.arms[arm].base.homogeneous
    guide = first + blend[:, None] * (last - first)
    angles, _ = limb.follow(frames[None], place[None], guide[None], walker.margins)
    out: Array = angles[0]
    return out


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
        names = [
            *(f"{arm} joint {k}" for arm in self.arms for k in range(1, len(limits.velocity) // len(self.arms) + 1)),
            "pace",
        ]
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
        ShapeError, NoPlanError: as of :func:`planned_joints`.

    Source: see :func:`wbc.trajectory.time_optimal`.
    """
    table = planned_joints(walker, plan)
    arms = len(walker.arms)
    rates, accelerations = ([*(tuple(v) * arms), most] for v, most in _limits(limb_of(walker)))
    count = INTERVALS * (len(table.time) - 1)
    law = time_optimal(_spline(table), rates, accelerations, intervals=count)
    return PlanTime(float(table.time[-1]), law, tuple(arm.name for arm in walker.arms))


def _limits(limb: BodyLimb) -> tuple[tuple[tuple[float, ...], float], ...]:
    """Limits of the joints of an arm, and of the coordinate that limits how fast the plan's time passes."""
    return (limb.joint_rates, 1.0), (limb.joint_accelerations, STEADY)


def _spline(table: PlannedJoints) -> PolynomialPath:
    """The joint path over the plan's time, and a coordinate z with dz/ds = 1 where the planned time stays and
    1 / FASTEST elsewhere, linear between the two.
    """
    s, spans = table.time, np.diff(table.time)
    slope = np.full(len(s), 1.0 / FASTEST)
    slope[:-1][table.kept] = slope[1:][table.kept] = 1.0
    gained = 0.5 * (slope[1:] + slope[:-1]) * spans
    z = np.concatenate([[0.0], np.cumsum(gained)])[:-1]
    clock = np.stack([np.zeros(len(spans)), 0.5 * np.diff(slope) / spans, slope[:-1], z])
    return PolynomialPath(s, np.concatenate([cubic_spline(s, table.joints, "not-a-knot"), clock[..., None]], axis=2))
