"""What comes of a clip: a motion of a robot, and how good it is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wbc.retarget.clip import Array, Clip, Marks
from wbc.retarget.figures import motion_figures
from wbc.retarget.plan import MotionPlan
from wbc.retarget.poses import frame_poses
from wbc.retarget.robot_body import RobotBody
from wbc.robot import Robot


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
        figures: of :func:`~wbc.retarget.motion_figures`.
    """

    points: dict[str, Array]
    figures: dict[str, Any]

    @property
    def mean(self) -> float:
        """Mean distance of all key points from their targets [m]."""
        return float(np.mean([values.mean() for values in self.points.values()]))

    def __str__(self) -> str:
        worst, figures = max(self.points, key=lambda name: float(self.points[name].max())), self.figures
        beyond = ", ".join(f"{what} {figures[f'{what}_breaches']}" for what in ("position", "velocity", "acceleration"))
        return (
            f"key points {1e3 * self.mean:.1f} mm in the mean, "
            f"{worst} {1e3 * self.points[worst].max():.0f} mm at most; slide {1e3 * figures['slide']:.3f} mm, "
            f"penetration {1e3 * figures.get('penetration', 0.0):.3f} mm; frames beyond limits: {beyond}; "
            f"jumps {figures['jumps']}"
        )


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
    plan: MotionPlan
    every: int
    all_q: Array

    @cached_property
    def errors(self) -> MotionErrors:
        """See :class:`MotionErrors`."""
        body, plan, fixed = self.body, self.plan, self.robot.base == "fixed"
        figures = motion_figures(
            self.robot, self.rate, self.q, {body.limbs[limb].end: stands for limb, stands in self.stance.items()},
            ground=None if fixed else 0.0, balls={own.end for own in body.limbs.values() if own.radius > 0.0},
        )  # fmt: skip
        targets: dict[str, tuple[str, Array]] = {} if fixed else {"pelvis": (body.pelvis, plan.pelvis)}
        for name, limb in plan.limbs.items():
            own = body.limbs[name]
            if body.plan.upright and own.middle:
                targets[f"{name} middle"] = (own.middle, limb.middle)
            if own.wrist and name.endswith("arm"):
                targets[f"{name} wrist"] = (own.wrist, limb.wrist)
            targets[name] = (own.end, limb.end)
        _, positions = frame_poses(self.robot, tuple(frame for frame, _ in targets.values()), self.q)
        far = {
            name: np.linalg.norm(positions[:, i] - target[:: self.every], axis=1)
            for i, (name, (_, target)) in enumerate(targets.items())
        }
        return MotionErrors(far, figures)
