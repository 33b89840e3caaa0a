"""Runs: walks as they are asked for, carried out, logged, and shown in a folder."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Sequence
from typing import Any

from wbc.robots import Walker
from wbc.walking.modes.commands import Commands
from wbc.walking.run.places import GridPlace, Place
from wbc.walking.run.request import ArmRequest, DriveRequest, PathRequest, Site, TwoEndedRequest, read_request
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


#: Old name, for one version -> (what it does, what to write instead)
_OLD: dict[str, tuple[Callable[..., Any], str]] = {
    "WalkRequest": (read_request, "PathRequest, DriveRequest, ArmRequest or TwoEndedRequest"),
    "perform_arm": (perform_walk, "perform_walk"),
    "perform_drive": (perform_drive, "perform_walk(..., commands=...)"),
    "perform_resume": (perform_resume, "perform_walk(ResumeRequest(...), ...)"),
    "perform_two_ended": (perform_walk, "perform_walk"),
}


def __getattr__(name: str) -> Any:
    if name not in _OLD:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    what, now = _OLD[name]
    warnings.warn(f"{__name__}.{name} is now {now}", DeprecationWarning, stacklevel=2)
    return what
