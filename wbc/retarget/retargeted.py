"""What comes of a clip: a motion of a robot, which contacts stand in it, what was not served, and how good it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wbc.retarget.clip import Array, Clip, Marks, intervals
from wbc.retarget.figures import motion_figures
from wbc.retarget.poses import frame_poses
from wbc.retarget.robot_body import RobotBody
from wbc.retarget.targets import Targets
from wbc.robot import Robot

#: A stance counts from where its contact is this near to its place [m]
LANDED = 4e-5
#: A contact that comes to stand so much later than the skeleton's is reported [s]
LATE = 0.05
#: A key point farther than this from its target is reported [m]
FAR = 0.1
#: If it stays there for longer than this [s]
LONG = 0.1
#: Times in which something is not served are one where they are less apart than this [s]
TOGETHER = 0.05


@dataclass(frozen=True)
class GivenUp:
    """What was not served, and when.

    Attributes:
        name: of the limb or the row that gave way. start, end: of the time [s]. reason: in words.
    """

    name: str
    start: float
    end: float
    reason: str

    def __str__(self) -> str:
        return f"{self.name} from {self.start:.2f} to {self.end:.2f} s: {self.reason}"


@dataclass(frozen=True)
class MotionErrors:
    """How good a motion is, at its frames.

    Attributes:
        points: key point -> distance from its target at each frame [frames] [m].
        figures: of :func:`~wbc.retarget.motion_figures`; ``error``: mean of all distances; ``errors``: by key point.
    """

    points: dict[str, Array]
    figures: dict[str, Any]

    @classmethod
    def of(cls, points: dict[str, Array], figures: dict[str, Any]) -> MotionErrors:
        """Those of some distances, and of figures of :func:`~wbc.retarget.motion_figures`."""
        errors = {name: {"mean": float(d.mean()), "largest": float(d.max())} for name, d in points.items()}
        mean = float(np.mean([one["mean"] for one in errors.values()]))
        return cls(points, {**figures, "error": mean, "errors": errors})

    @property
    def mean(self) -> float:
        """Mean distance of all key points from their targets [m]."""
        return float(self.figures["error"])

    def __str__(self) -> str:
        figures = self.figures
        lines = [f"slide in stance: {1e3 * figures['slide']:.3g} mm at most"]
        lines += [f"  {foot}: {1e3 * slide:.3g} mm" for foot, slide in figures["slides"].items()]
        if "penetration" in figures:
            deepest, frames = 1e3 * figures["penetration"], figures["penetration_frames"]
            lines.append(f"below the ground: {deepest:.3g} mm at most, {frames} frames beyond 1 mm")
        for what, share in (("position", ""), ("velocity", "fastest"), ("acceleration", "quickest")):
            most = f", at most {figures[share]:.3g} of the limit" if share else ""
            lines.append(f"{what} limits: {figures[f'{what}_breaches']} frames beyond them{most}")
        lines += [f"jumps: {figures['jumps']}", f"key points from their targets: {1e3 * self.mean:.3g} mm in the mean"]
        points = [(name, 1e3 * far["mean"], 1e3 * far["largest"]) for name, far in figures["errors"].items()]
        return "\n".join([*lines, *(f"  {name}: {mean:.3g} mm, {most:.3g} mm at most" for name, mean, most in points)])


@dataclass(frozen=True, eq=False)
class Retargeted:
    """A motion of a robot.

    Attributes:
        robot: with the limits that were kept, and frames ``retarget_...`` at pelvis, chest, feet and hands.
        rate: frames a second [Hz]. time: of the frames [s].
        q: configurations, the root's pose first [frames, nq].
        stance: limb -> whether its contact stands [frames].
        given_up: what was not served, in the order of time.
        notes: what was found in the clip, and of the correspondence.
        clip: that the motion follows.
        body: limbs of the robot. plan: targets of the ticks. every: a frame is so many ticks.
        all_q: configurations at all ticks [ticks, nq].
    """

    robot: Robot
    rate: float
    time: Array
    q: Array
    stance: dict[str, Marks]
    given_up: tuple[GivenUp, ...]
    notes: tuple[str, ...]
    clip: Clip
    body: RobotBody
    plan: Targets
    every: int
    all_q: Array

    @cached_property
    def errors(self) -> MotionErrors:
        """See :class:`MotionErrors`."""
        limbs = self.body.limbs
        figures = motion_figures(
            self.robot, self.rate, self.q, {limbs[limb].end: stands for limb, stands in self.stance.items()},
            ground=None if self.robot.base == "fixed" else 0.0,
            balls={own.end for own in limbs.values() if own.contact == "point"},
        )  # fmt: skip
        points = key_points(self.body, self.plan)
        _, places = frame_poses(self.robot, tuple(frame for frame, _ in points.values()), self.q)
        targets = np.stack([target[:: self.every] for _, target in points.values()], axis=1)
        return MotionErrors.of(dict(zip(points, np.linalg.norm(places - targets, axis=2).T, strict=True)), figures)


def key_points(body: RobotBody, plan: Targets) -> dict[str, tuple[str, Array]]:
    """Name -> frame of the robot, and where the plan wants it [ticks, 3] [m]."""
    out = {} if body.robot.base == "fixed" else {"pelvis": (body.pelvis, plan.pelvis)}
    for name, (_, middle, wrist, end) in zip(plan.limbs, plan.chains.transpose(1, 2, 0, 3), strict=True):
        own = body.limbs[name]
        if body.plan.upright:
            out[f"{name} middle"] = own.middle, middle
            if own.wrist and name.endswith("arm"):
                out[f"{name} wrist"] = own.wrist, wrist
        out[name] = own.end, end
    return out


def served(
    robot: Robot, body: RobotBody, plan: Targets, q: Array, gave: Sequence[tuple[int, tuple[str, ...]]]
) -> tuple[dict[str, Marks], tuple[GivenUp, ...]]:
    """Limb -> whether its contact stands [ticks], of each stance the longest time for which nothing slips; and what was
    not served: rows that gave way at ticks, contacts that come late or are not held, and limbs far from their targets.
    """
    ends = {name: at for name, at in key_points(body, plan).items() if name in plan.limbs or name.endswith("wrist")}
    rotations, positions = frame_poses(robot, tuple(frame for frame, _ in ends.values()), q)
    far: dict[str, Array] = {}
    for k, (name, (_, target)) in enumerate(ends.items()):
        away = (positions[:, k] - target)[:, None]
        if name in plan.turns and body.limbs[name].contact == "flat":
            # Of a sole the corner that is farthest off
            away = away + body.limbs[name].corners @ np.swapaxes(rotations[:, k] - plan.turns[name], 1, 2)
        far[name] = np.linalg.norm(away, axis=2).max(axis=1)
    stance, given = dict[str, Marks](), list[GivenUp]()

    def say(name: str, marks: Marks, reason: str, least: float = 0.0) -> None:
        runs: list[tuple[int, int]] = []
        for a, b in intervals(marks):
            start = runs.pop()[0] if runs and (a - runs[-1][1]) * plan.dt < TOGETHER else a
            runs.append((start, b))
        given.extend(GivenUp(name, a * plan.dt, b * plan.dt, reason) for a, b in runs if (b - a) * plan.dt > least)

    for row in dict.fromkeys(name for _, names in gave for name in names):
        ticks = [tick for tick, names in gave if row in names]
        say(row, np.isin(np.arange(len(q)), ticks), "gave way to limits of the joints")
    for name, stands in zip(plan.limbs, plan.stands.T, strict=True):
        stance[name], late = np.zeros((2, len(q)), dtype=bool)
        for a, b in intervals(stands):
            still = intervals(far[name][a:b] <= LANDED)
            first, last = max(still, key=lambda run: run[1] - run[0], default=(b - a, b - a))
            stance[name][a + first : a + last] = True
            late[a : a + first] = first * plan.dt > LATE
        say(name, late, "comes to stand later than the skeleton")
        hand = far.get(f"{name} wrist", far[name])
        say(name, hand > FAR, f"is more than {FAR} m from its target: out of reach", LONG)
    return stance, tuple(sorted(given, key=lambda one: (one.start, one.name)))
