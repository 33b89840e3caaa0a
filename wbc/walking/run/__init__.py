"""Runs: walks as they are asked for, carried out, logged, and shown in a folder."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from wbc.robots import Walker
from wbc.walking.modes.commands import Commands
from wbc.walking.run.places import GridPlace, Place
from wbc.walking.run.request import ArmRequest, DriveRequest, PathRequest, Site, TwoEndedRequest
from wbc.walking.run.resume_mode import ResumeRequest
from wbc.walking.run.session import WalkRun, perform_walk

__all__ = [
    "ArmRequest",
    "DriveRequest",
    "GridPlace",
    "PathRequest",
    "ResumeRequest",
    "Site",
    "TwoEndedRequest",
    "WalkRun",
    "perform_walk",
]


def perform_drive(request: DriveRequest, walker: Walker, commands: Commands, **more: Any) -> WalkRun:
    """``perform_walk(request, walker, commands=commands)``."""
    return perform_walk(request, walker, commands=commands, **more)


def perform_resume(
    folder: str | os.PathLike[str],
    walker: Walker,
    *,
    at: float | None = None,
    points: Sequence[Place] = (),
    **more: Any,
) -> WalkRun:
    """``perform_walk(ResumeRequest(folder, at, points), walker)``."""
    return perform_walk(ResumeRequest(folder, at, tuple(points)), walker, **more)
