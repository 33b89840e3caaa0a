"""A pair of task and constraint coordinates: what an operator commands, and what is held meanwhile."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from wbc import validation
from wbc.analysis.kept_hash import keeps_hash
from wbc.analysis.rows import BodyRows
from wbc.coordinates import expressions
from wbc.coordinates.rows import Coordinate, coordinates
from wbc.errors import DuplicateNameError, RangeError, ShapeError
from wbc.robot import Robot


@keeps_hash
@dataclass(frozen=True)
class CoordinatePair:
    """Task coordinates are commanded, constraint coordinates are held or have prescribed rates:

        minimise |D (v_T - J_T v)|   subject to   J_C v = v_C - gain e            [m/s, rad/s]

    D divides rows in metres by the stack's length, by default the robot's characteristic length. With as many rows as
    joints in all the answer is unique where [J_T; J_C] is regular; with more, constraints stay exact and the task
    follows in the least-squares sense; with fewer, of all rates that do it the joints have those of the least norm.

    Attributes:
        task, constraint: one declaration or several: :class:`wbc.analysis.BodyRows`, ``JointRows``, ``PitchPlaneRows``,
            :class:`AxisRows`, :class:`PlaneAngleRows`, :class:`PointRows`.
            A task that takes all joints needs no constraint: ``()``.
        name: how it is called; default: "task | constraint".
        metric: distance of the three points that stand for a whole pose in the task, see :class:`FollowRows` [m].

    Source: E. Dupuis, PhD thesis, McGill University, 2001, chapter 2 and appendix B.

    Raises:
        ShapeError, DuplicateNameError, RangeError: no task, the same coordinate twice, a metric without a pose.
    """

    task: tuple[Coordinate, ...]
    constraint: tuple[Coordinate, ...]
    name: str = field(default="", compare=False)
    metric: float | None = None

    def __init__(self, task: Any, constraint: Any, name: str = "", metric: float | None = None) -> None:
        put = object.__setattr__
        put(self, "task", coordinates("CoordinatePair.task", task))
        nothing = isinstance(constraint, tuple | list) and not constraint
        put(self, "constraint", () if nothing else coordinates("CoordinatePair.constraint", constraint))
        rows = self.rows
        for k, one in enumerate(rows):
            if one in rows[:k]:
                raise DuplicateNameError("CoordinatePair", str(one), "these coordinates are given twice")
        if not isinstance(name, str):
            raise ShapeError("CoordinatePair.name", name, "expected a text")
        text = " | ".join(", ".join(map(str, side)) or "nothing" for side in (self.task, self.constraint))
        put(self, "name", name or text)
        if metric is not None:
            metric = validation.scalar("CoordinatePair.metric", metric, low=0.0, open_low=True, unit="m")
            if not any(is_pose(one) for one in self.task):
                raise RangeError("CoordinatePair.metric", metric, "three points stand for a pose; the task has none")
        put(self, "metric", metric)

    @property
    def rows(self) -> tuple[Coordinate, ...]:
        """Task, then constraint."""
        return (*self.task, *self.constraint)

    def swapped(self) -> CoordinatePair:
        """Task and constraint exchanged: what was commanded is held, what was held moves the arm within itself."""
        task, held = (", ".join(map(str, side)) for side in (self.constraint, self.task))
        return replace_pair(self, task=self.constraint, constraint=self.task, name=f"{task} | {held}")

    def counts(self, robot: Robot) -> tuple[int, int]:
        """Rows of task and constraint on a robot, checked.

        Raises:
            UnknownNameError, RangeError: a name that the robot does not have; rows that no joint moves; constraints
                that leave the task nothing.
        """
        for field_name, side in (("task", self.task), ("constraint", self.constraint)):
            for one in side:
                expressions.check(robot, f"CoordinatePair.{field_name}", one)
        n, p = (sum(len(expressions.labels(robot, one)) for one in side) for side in (self.task, self.constraint))
        if p >= robot.nv:
            reason = f"{p} constraint rows leave the task none of {robot.nv} joints"
            raise RangeError("CoordinatePair.constraint", self.name, reason)
        return n, p

    def over_determined(self, robot: Robot) -> bool:
        """Whether there are more rows than joints, so that the task follows in the least-squares sense."""
        return sum(self.counts(robot)) > robot.nv

    def under_determined(self, robot: Robot) -> bool:
        """Whether there are fewer rows than joints, so that rates of the least norm are chosen."""
        return sum(self.counts(robot)) < robot.nv

    def __str__(self) -> str:
        return self.name


def pairs_of(pairs: Any, *, some: bool = True) -> list[CoordinatePair]:
    """One pair or several, as a list; none of them only without ``some``.

    Raises:
        ShapeError: something else.
    """
    given = [pairs] if isinstance(pairs, CoordinatePair) else list(validation.items("pairs", pairs, "CoordinatePairs"))
    if (some and not given) or not all(isinstance(p, CoordinatePair) for p in given):
        expected = "one CoordinatePair or several" if some else "CoordinatePairs"
        raise ShapeError("pairs", pairs, f"expected {expected}")
    return given


def replace_pair(pair: CoordinatePair, **changes: Any) -> CoordinatePair:
    """A pair with some fields changed; a metric that no longer has its pose is dropped."""
    given = {name: getattr(pair, name) for name in ("task", "constraint", "name", "metric")} | changes
    if not any(is_pose(one) for one in given["task"]):
        given["metric"] = None
    return CoordinatePair(**given)


def is_pose(one: Coordinate) -> bool:
    """All six rows of a frame."""
    return isinstance(one, BodyRows) and len(one.translation) + len(one.rotation) == 6
