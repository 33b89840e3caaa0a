"""A retargeted motion that is made up, as writers and reports see it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from tests.retarget import clips
from wbc import robots
from wbc.multibody import pin
from wbc.retarget import Clip, MotionErrors, Skeleton, motion_figures
from wbc.robot import Robot


def motion_of(robot: Robot, clip: Clip | None = None, frames: int = 30, rate: float = 30.0) -> Any:
    """Slow sines of the joints round neutral, with a base that drifts; feet stand in the first half."""
    time = np.arange(frames) / rate
    q = []
    for at in time:
        v = 0.2 * np.sin(2.0 * at + np.arange(robot.nv))
        q.append(pin.integrate(robot.model, robot.neutral, v))
    stance = {"left_leg": time < time[-1] / 2.0}
    feet = (name for name in robot.frame_names if "ankle" in name or "foot" in name.lower())
    foot = next(feet, robot.frame_names[-1])
    far = {"left_leg": np.full(frames, 0.01)}
    figures = motion_figures(robot, rate, np.array(q), {foot: stance["left_leg"]})
    return SimpleNamespace(
        robot=robot, rate=rate, time=time, q=np.array(q), stance=stance, given_up=("left_leg from 0.1 to 0.2 s: far",),
        notes=("a note",), clip=clip or clips.sit(0, 30.0).clip,
        errors=MotionErrors.of(far, figures),
        body=SimpleNamespace(limbs={"left_leg": SimpleNamespace(end=foot, radius=0.0)}),
    )  # fmt: skip


class FakeRetargeter:
    """Takes any clip; one without a head is refused."""

    runs: list[str] = []  # noqa: RUF012 (shared on purpose: what was run)

    def __init__(
        self, robot: Robot, _skeleton: object = None, options: object = None, *, correspondence: object = None
    ) -> None:
        self.robot, self.options, self.file = robot, options, correspondence

    def correspondence(self, _skeleton: Skeleton) -> Any:
        """One that is saved as an empty file."""
        return SimpleNamespace(save=lambda file: file.write_text(""))

    def run(self, clip: Clip) -> Any:
        """Not the motion of the clip, but one of its length."""
        self.runs.append(clip.name)
        if clip.name == "stop":
            raise KeyboardInterrupt
        return motion_of(self.robot, clip, frames=12)


def humanoid() -> Robot:
    """A small one that loads quickly."""
    return robots.load("simple_humanoid", base="floating")
